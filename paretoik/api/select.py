"""Choose one point of a front by a preference; a closed loop is followed anew where it needs to be."""

from __future__ import annotations

from pathlib import Path

from paretoik.api.progress import Observer
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import is_loop, reweigh
from paretoik.front.front import Choice, Front, Preference


def select(
    front: Front,
    preference: Preference,
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    observe: Observer | bool | None = None,
) -> tuple[Front, Choice]:
    """Return the point that a preference chooses, and the front that it belongs to.

    That is ``front`` itself, or, of a closed loop and other weights than its own, the front of a new run with them at
    every step, kept in ``out``. ``overwrite`` and ``observe`` are those of ``solve``.

    Raises InvalidInput where the preference does not suit the front, its loop cannot be loaded, or ``out`` has no
    new run to hold; Infeasible where the front is empty or the loop blocked.
    """
    if front.problem is None and is_loop(front):
        raise InvalidInput("select: wants the closed loop that the run followed, but its problem cannot be loaded")
    problem = reweigh(front.problem, front, preference)
    if problem is not None:
        reference = front.provenance.get("problem")
        front = solve(problem, out=out, overwrite=overwrite, reference=reference, observe=observe)
    elif out is not None:
        raise InvalidInput("out: wants a closed loop and other weights than its own, to keep a new run in")
    return front, front.select(preference)
