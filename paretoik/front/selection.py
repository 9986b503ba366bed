"""Choosing a point of a front by a preference, and going back on it; a run folder keeps the choices."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.front.choice import Choice, Preference
from paretoik.front.subset import check_has_points
from paretoik.front.viewing import show_choice
from paretoik.inputs import check_flag

if TYPE_CHECKING:  # a front asks this file for its choices
    from paretoik.front.front import Front


def select(front: Front, preference: Preference | str | Mapping[str, float] | int, *, keep: bool = True) -> Choice:
    """Return the point that a preference chooses; a closed loop is followed again with it.

    ``preference`` is one of those of ``paretoik`` or your own (``Preference``); "knee" and "compromise" stand for
    ``Knee()`` and ``Compromise()``, numbers by objective for ``Weights``, an integer for the point with that id.
    A front with a run ``folder`` keeps the choice there, in choices.json (``choices``), and has its recording,
    review.rrd, open on it, unless ``keep`` is False or it is the motion of a closed loop that was followed anew. A
    recording that cannot be replaced is left as it is, with a warning; the choice is kept.

    Raises Infeasible where the front is empty or no point suits, and InvalidInput for other preferences.
    """
    from paretoik.front.choices import keep_choice
    from paretoik.front.preferences.requests import as_preference, ask

    check_flag("keep", keep)
    check_has_points(front, "select")
    wish = as_preference(preference)
    of_problem: Callable[[Front, Preference], Choice] | None = getattr(front.problem, "select", None)
    choice = ask(wish, front) if of_problem is None else of_problem(front, wish)
    is_known = np.array_equal(choice.objectives, front.objectives[choice.index])  # no loop that was followed anew
    if keep and is_known and front.folder is not None and keep_choice(front, choice, wish):
        show_choice(front)
    return choice


def undo(front: Front) -> Choice | None:
    """Go back to the choice before the present one in the run folder, and return it; None where it was the first.

    Nothing is deleted: the next choice becomes another branch of the tree. Raises InvalidInput where there is no
    choice to go back from, or this is a part of the run's front without the point of the one before.
    """
    from paretoik.front.choices import chosen, go_back

    if front.folder is None:
        raise InvalidInput("undo: wants a front that was loaded from a run folder or saved into one")
    go_back(front.folder, front=front)
    show_choice(front)
    return chosen(front)
