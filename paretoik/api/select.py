"""Choose a front's point by a preference, or undo a choice."""

from __future__ import annotations

from collections.abc import Mapping
from os.path import relpath
from pathlib import Path

from paretoik.api.load import load_front
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput, ParetoikError, warn_user
from paretoik.formulations.protocol import ProblemParts, is_loop
from paretoik.front.choice_tree import Choices, go_back, keep_choice
from paretoik.front.front import Choice, Front, Preference, show_choice
from paretoik.front.preferences.requests import as_preference
from paretoik.inputs import file_path
from paretoik.progress import Observer
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
    """Return the front that a preference chooses from, and the chosen point.

    Parameters
    ----------
    front
        Front to choose from.
    preference
        Preference, its name, weights by objective, or the id of a point.
    out
        Folder for the new run of a closed loop (default: none).
    overwrite
        Whether to replace a run in ``out``, as for ``solve`` (default False).
    observe
        Observer of progress, as for ``solve``.

    Returns
    -------
    tuple[Front, Choice]
        ``front`` itself and its point; for a closed loop with other weights the front of a new run.

    Raises
    ------
    InvalidInput
        If the preference does not suit the front, its loop cannot be loaded, or ``out`` is given without a new run.
    InvalidRun
        If the file of choices is damaged.
    Infeasible
        If the front is empty or the loop is blocked.

    Notes
    -----
    A closed loop that gets other weights than its own is run again with these weights at every step, and saved in
    ``out``. The choice is saved in the run folder of its front; that of a new run names the ``former`` run and its
    present choice.
    """
    preference = as_preference(preference)
    if front.problem is None and is_loop(front):
        raise InvalidInput(
            "front must be loaded with its ClosedLoop, got none: load_front(run, problem), or --problem FILE.py:NAME"
        )
    problem = ProblemParts(front.problem).reweigh(front, preference)
    if problem is None:
        if out is not None:
            raise InvalidInput("out must be None unless a closed loop gets other weights than its own, got a folder")
        return front, front.select(preference)
    if out is not None:
        check_other_folder("out", file_path("out", out), front.folder)
    current = front.choices.current  # read before the run, in case its file is damaged
    reference = front.provenance.get("problem")
    selected = solve(problem, out=out, overwrite=overwrite, reference=reference, observe=observe)
    choice = selected.select(preference, keep=False)
    if selected.folder is not None:
        run = None if front.folder is None else relpath(front.folder, selected.folder)
        former = None if run is None else {"run": run, "choice": current}
        keep_choice(selected, choice, preference, former=former)
    return selected, choice


def undo(run: Path, problem: str | None = None) -> Choices:
    """Restore the previous choice of a run, in its recording too; return the choices.

    ``problem`` is as for ``load_front``. If the front cannot be loaded, the recording stays, with a warning. Raises
    InvalidInput if there is no choice to go back from.
    """
    choices = go_back(run)
    if (run / RECORDING).exists():
        try:
            show_choice(load_front(run, problem))
        except ParetoikError as error:
            warn_user(f"the recording stays as it was: {error}")
    return choices
