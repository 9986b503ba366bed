"""What users ask for as a preference, and its answer, checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.front.choice import Choice, Preference, is_preference
from paretoik.front.compromise import Compromise
from paretoik.front.front import Front
from paretoik.front.preferences.knee import Knee
from paretoik.front.preferences.point import Point
from paretoik.front.preferences.weights import Weights
from paretoik.inputs import is_integer, likely_spelling, shown
from paretoik.user_functions import user_function

BY_NAME: dict[str, Callable[[], Preference]] = {"knee": Knee, "compromise": Compromise}  # those that need no numbers


def as_preference(wish: Any, *, name: str = "select") -> Preference:
    """Return what a user asks for as a preference: one itself, its name, weights by objective, or the id of a point.

    Raises InvalidInput, with what works, for anything else.
    """
    if isinstance(wish, str):
        if wish in BY_NAME:
            return BY_NAME[wish]()
        names = ", ".join(map(repr, BY_NAME))
        raise InvalidInput(
            f"{name}: a preference wanted, by name {names}, got {shown(wish)}{likely_spelling(wish, BY_NAME)}; others "
            "take numbers or names, such as Weights(energy=1.0), Aspiration, Lexicographic, Bounds, Robust, Classify"
        )
    if isinstance(wish, Mapping):
        return Weights(wish)
    if is_integer(wish):
        return Point(int(wish))
    if is_preference(wish):
        return wish
    raise InvalidInput(f"{name}: a preference wanted, such as Weights(...), got {shown(wish)}")


def ask(preference: Preference, front: Front) -> Choice:
    """Return what a preference chooses of a front that has at least one point.

    Raises InvalidInput where it fails, or returns anything but a choice of this front.
    """
    kind = type(preference).__name__
    with user_function(f"select: {kind}", InvalidInput):
        choice: object = preference.choose(front)
    if not isinstance(choice, Choice):
        raise InvalidInput(f"select: wanted of {kind} a choice, front.choice(row, verdict), got {shown(choice)}")
    rows = np.flatnonzero(front.ids == choice.id)
    if rows.tolist() != [choice.index] or not np.array_equal(front.objectives[rows[0]], choice.objectives):
        raise InvalidInput(
            f"select: wanted of {kind} a point of the front that it was given, front.choice(row, verdict), "
            f"got point {choice.id} of another"
        )
    return choice if choice.preference is not None else replace(choice, preference=preference)
