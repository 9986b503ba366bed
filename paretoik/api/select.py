"""Choose one point of a front by a preference, or go back; a closed loop is followed anew where it needs to be."""

from __future__ import annotations

from collections.abc import Mapping
from os.path import relpath
from pathlib import Path

from paretoik.api.load import load_front
from paretoik.api.progress import Observer
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput, ParetoikError, warn_user
from paretoik.formulations.protocol import is_loop, reweigh
from paretoik.front.choice_tree import Choices, go_back, keep_choice
from paretoik.front.front import Choice, Front, Preference, show_choice
from paretoik.front.preferences.requests import as_preference
from paretoik.inputs import file_path
from paretoik.runs.files import RECORDING
from paretoik.runs.folder import check_other_folder


def select(
    front: Front,
    preference: Preference | str | Mapping[str, float] | int,
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    observe: Observer | bool | None = None,
) -> tuple[Front, Choice]:
    """Return the point that a preference chooses, and the front that it belongs to.

    That is ``front`` itself, or, of a closed loop and other weights than its own, the front of a new run with them at
    every step, kept in ``out``. The choice is kept in the run folder of the front that it belongs to; that of a new run
    names the ``former`` one and the choice that was the present one there. ``overwrite`` and ``observe`` are those of
    ``solve``.

    Raises InvalidInput where the preference does not suit the front, its loop cannot be loaded, or ``out`` has no
    new run to hold; InvalidRun where the file of choices is damaged; Infeasible where the front is empty or the loop
    blocked.
    """
    preference = as_preference(preference)
    if front.problem is None and is_loop(front):
        raise InvalidInput(
            "select: wants the closed loop that the run followed, but its problem is not at hand: "
            "load_front(run, problem), or --problem FILE.py:NAME"
        )
    problem = reweigh(front.problem, front, preference)
    if problem is None:
        if out is not None:
            raise InvalidInput("out: wants a closed loop and other weights than its own, to keep a new run in")
        return front, front.select(preference)
    if out is not None:
        check_other_folder("out", file_path("out", out), front.folder)
    current = front.choices.current  # before the run, should its file be damaged
    reference = front.provenance.get("problem")
    selected = solve(problem, out=out, overwrite=overwrite, reference=reference, observe=observe)
    choice = selected.select(preference, keep=False)
    if selected.folder is not None:
        run = None if front.folder is None else relpath(front.folder, selected.folder)
        former = None if run is None else {"run": run, "choice": current}
        keep_choice(selected, choice, preference, former=former)
    return selected, choice


def undo(run: Path, problem: str | None = None) -> Choices:
    """Go back to the choice before the present one of a run, and return the choices; its recording follows.

    ``problem`` is as for ``load_front``. A run whose front cannot be opened keeps its recording, with a warning. Raises
    InvalidInput where there is no choice to go back from.
    """
    choices = go_back(run)
    if (run / RECORDING).exists():
        try:
            show_choice(load_front(run, problem))
        except ParetoikError as error:
            warn_user(f"the recording stays as it was: {error}")
    return choices
