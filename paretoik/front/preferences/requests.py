"""Checks of users' preferences and of the choices that they make; the preference ``Bounds``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.errors import Infeasible, InvalidInput
from paretoik.front.choice import (
    Choice,
    Preference,
    check_preference,
    explain,
    first_row,
    list_words,
    percent,
    with_unit,
)
from paretoik.front.points import (
    Bound,
    Front,
    FrontData,
    bounds_by_axis,
    check_front,
    inside,
    merge_bounds,
    row_of,
    take,
)
from paretoik.front.preferences.knee_and_compromise import Compromise, Knee, Point
from paretoik.front.preferences.weights import Weights
from paretoik.inputs import is_integer, likely_spelling, shown, user_function
from paretoik.tables import html_representation


@dataclass(frozen=True, init=False, eq=False)
class Bounds:
    """Bounds of objectives, and a preference that chooses among the points within them.

    bounds: (lower, upper) by name, in the objectives' own units and sign, None for an open side; if a name is no
        identifier, a mapping
    then: preference that chooses, by default the compromise (``Compromise``); ranges stay those of the whole front

    ``Bounds(kinetic_energy=(None, 0.05), then=Weights(torque_norm=1))``. Raises InvalidInput if a bound is not a pair.
    ``choose`` raises Infeasible if no point satisfies the bounds; the message has the nearest point and the bounds that
    it violates.
    """

    bounds: Mapping[str, Bound]
    then: Preference

    def __init__(
        self,
        mapping: Mapping[str, Bound] | None = None,
        /,
        *,
        then: Preference | str | Mapping[str, float] = "compromise",
        **bounds: Bound,
    ) -> None:
        object.__setattr__(self, "bounds", MappingProxyType(merge_bounds("bounds", mapping, bounds)))
        object.__setattr__(self, "then", as_preference(then, name="then"))

    def __repr__(self) -> str:
        return f"Bounds({dict(self.bounds)}, then={self.then!r})"

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the choice of ``then`` among the points within bounds.

        Raises InvalidInput if a name is no objective, and Infeasible if no point satisfies the bounds.
        """
        check_front(front)
        limits = bounds_by_axis(front, self.bounds)
        within = inside(front, limits)
        if not within.any():  # the nearest point has the least largest miss, as a share of a range
            low, high = limits.T
            missed = np.maximum(np.maximum(low - front.objectives, front.objectives - high), 0.0)
            width = np.ptp(front.ranges, axis=1)
            shares = missed / np.where(width > 0, width, np.maximum(np.abs(front.ranges).max(axis=1), 1e-300))
            row = first_row(front, shares.max(axis=1))
            worst, parts = int(shares[row].argmax()), list[str]()
            for axis in np.flatnonzero(missed[row]).tolist():
                name, whole = front.names[axis], "the range" if width[axis] > 0 else "the value that all have"
                text = f"{name} {front.objectives[row, axis]:.4g} misses it by {missed[row, axis]:.3g}"
                parts.append(f"{with_unit(front, name, text)} ({percent(shares[row, axis])} of {whole})")
            raise Infeasible(
                f"bounds: a point must have {_in_words(front, limits)}, got none among {len(front)} points; the "
                f"nearest is point {front.ids[row]}: {list_words(parts)}",
                motion=None if front.motions is None else front.motions[row],
                limit=front.names[worst],
                violation=float(shares[row, worst]),
            )
        part = take(front, np.flatnonzero(within))
        choice = ask(self.then, part)
        count = f"all {len(front)}" if len(part) == len(front) else f"{len(part)} of {len(front)}"
        verb = "has" if len(part) == 1 < len(front) else "have"
        verdict = f"{count.capitalize()} points {verb} {_in_words(front, limits)}. {choice.verdict}"
        details = {**choice.details, "within": tuple(part.ids.tolist())}
        row = row_of(front, choice.id)
        return explain(front, row, verdict, preference=self, score=choice.score, details=details)


def _in_words(front: FrontData, limits: Float[np.ndarray, "n_obj 2"]) -> str:
    words = []
    for axis, name in enumerate(front.names):
        sides = zip(("at least", "at most"), limits[axis].tolist(), strict=True)
        parts = [f"{side} {value:.4g}" for side, value in sides if np.isfinite(value)]
        if parts:
            words.append(with_unit(front, name, f"{name} {list_words(parts)}"))
    return list_words(words) or "no bound"


# Checks of users' preferences, and of the choices that they make.


BY_NAME: dict[str, Callable[[], Preference]] = {"knee": Knee, "compromise": Compromise}  # those without parameters


def as_preference(wish: Any, *, name: str = "select") -> Preference:
    """Return a user's request (preference, name, weights by objective, or id) as a preference.

    Raises InvalidInput, which lists valid requests, for anything else.
    """
    if isinstance(wish, str):
        if wish in BY_NAME:
            return BY_NAME[wish]()
        names = ", ".join(map(repr, BY_NAME))
        raise InvalidInput(
            f"{name} must be one of {names} or a preference, such as Weights(energy=1.0), Aspiration, Lexicographic, "
            f"Bounds, Robust or Classify, got {shown(wish)}{likely_spelling(wish, BY_NAME)}"
        )
    if isinstance(wish, Mapping):
        return Weights(wish)
    if is_integer(wish):
        return Point(int(wish))
    check_preference(name, wish)
    return wish


def ask(preference: Preference, front: FrontData) -> Choice:
    """Return the choice of a preference on a front with at least one point.

    Raises InvalidInput if the preference fails, or returns anything but a choice of this front.
    """
    kind = type(preference).__name__
    with user_function(f"select: {kind}", InvalidInput):
        choice: object = preference.choose(front)
    if not isinstance(choice, Choice):
        raise InvalidInput(f"select: {kind} must return a choice, front.choice(row, verdict), got {shown(choice)}")
    rows = np.flatnonzero(front.ids == choice.id)
    if rows.tolist() != [choice.index] or not np.array_equal(front.objectives[rows[0]], choice.objectives):
        raise InvalidInput(
            f"select: {kind} must return a point of the given front, front.choice(row, verdict), "
            f"got point {choice.id} of another front"
        )
    return choice if choice.preference is not None else replace(choice, preference=preference)
