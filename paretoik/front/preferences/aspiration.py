"""Preferences by classes of objectives, and by aspiration levels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from paretoik.arrays import Mask, Values
from paretoik.errors import InvalidInput
from paretoik.front.choice import (
    Choice,
    amounts_in_words,
    compare,
    explain,
    first_row,
    list_words,
    named_numbers,
    named_text,
    percent,
    quantity,
    with_unit,
)
from paretoik.front.geometry import PREFERENCE_OPTIONS as OPTIONS
from paretoik.front.points import Front, check_front, check_known, row_of, shares_of
from paretoik.inputs import is_integer, read_list, shown
from paretoik.tables import html_representation

CLASSES = ("improve", "improve_to", "keep", "relax_to", "free")


@dataclass(frozen=True, init=False, eq=False)
class Classify:
    """The classes of NIMBUS: every objective is in one class, relative to a current point.

    current: id of a point, or a Choice
    improve: objectives to improve as far as possible
    improve_to: objectives to improve to a value
    keep: objectives that must not get worse
    relax_to: objectives that may get worse up to a value
    free: objectives that may get worse freely

    The chosen point satisfies the classes and has the least

        max (Z_i, i to improve; Z_j − a_j, j to improve to a value) + 1e-4 ΣZ,

    with Z and the values a_j in shares of the stored ranges. Source: Miettinen and Mäkelä 1999 (NIMBUS); 2006, European
    J. of Operational Research 170; they divide by nadir − utopian, a little more than the ranges nadir − ideal. The
    current point satisfies the classes too: if it is chosen again, no other does better.

    ``Classify(choice, improve=["kinetic_energy"], relax_to={"torque_norm": 0.2})``. Raises InvalidInput if an objective
    is in two classes, none is to improve, or none may get worse; ``choose`` raises it if an objective is in no class,
    or a value is on the wrong side of the current one.
    """

    current: int
    improve: tuple[str, ...]
    improve_to: Mapping[str, float]
    keep: tuple[str, ...]
    relax_to: Mapping[str, float]
    free: tuple[str, ...]

    def __init__(
        self,
        current: int | Choice,
        /,
        *,
        improve: Sequence[str] = (),
        improve_to: Mapping[str, float] | None = None,
        keep: Sequence[str] = (),
        relax_to: Mapping[str, float] | None = None,
        free: Sequence[str] = (),
    ) -> None:
        assign = object.__setattr__
        if not isinstance(current, Choice) and not is_integer(current):
            raise InvalidInput(f"current must be a choice or an id, got {shown(current)}")
        assign(self, "current", current.id if isinstance(current, Choice) else int(current))
        for field, names in (("improve", improve), ("keep", keep), ("free", free)):
            assign(self, field, read_list(f"classify {field}", names, str, "a list of names"))
        for field, values in (("improve_to", improve_to), ("relax_to", relax_to)):
            assign(self, field, named_numbers(f"classify {field}", values, {}))
        names = self._names()
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise InvalidInput(f"classify: each objective must be in one class, got {twice[0]} in several")
        if not self.improve and not self.improve_to:
            raise InvalidInput("classify: an objective must be in improve or improve_to, got none")
        if not self.relax_to and not self.free:
            raise InvalidInput("classify: an objective must be allowed to get worse (relax_to or free), got none")

    def __repr__(self) -> str:
        classes = {field: getattr(self, field) for field in CLASSES if getattr(self, field)}
        plain = {field: dict(value) if isinstance(value, Mapping) else list(value) for field, value in classes.items()}
        return f"Classify({self.current}, {', '.join(f'{field}={value!r}' for field, value in plain.items())})"

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the best point that satisfies the classes; raises InvalidInput if these do not suit the front."""
        check_front(front)
        start = row_of(front, self.current, name="classify")
        names = self._names()
        check_known(front.names, "classify", names)
        if missing := set(front.names) - set(names):
            raise InvalidInput(f"classify: every objective must be in a class, got {sorted(missing)[0]} in none")
        values = {
            name: -value if front.maximised[front.names.index(name)] else value
            for name, value in {**self.improve_to, **self.relax_to}.items()
        }
        for field, side, wish in (("improve_to", -1.0, "better than"), ("relax_to", 1.0, "no better than")):
            for name in getattr(self, field):
                axis = front.names.index(name)
                worse = side * (values[name] - front.minimised[start, axis])
                if worse < 0 or (worse == 0 and field == "improve_to"):
                    now, value = f"{front.objectives[start, axis]:.6g}", getattr(self, field)[name]
                    raise InvalidInput(f"classify {field}: {name} must be {wish} the current {now}, got {value:g}")

        # Points in which no objective is worse than its class allows.
        limits, widths = front.minimised[start].copy(), np.ptp(front.ranges, axis=1)
        for axis, name in enumerate(front.names):
            if name in self.free or name in self.relax_to:
                limits[axis] = values.get(name, np.inf)
        within: Mask = (front.minimised <= limits + OPTIONS.rounding * widths).all(axis=1)

        # Among these the one with the least max (Z_i; Z_j − a_j) + 1e-4 ΣZ.
        lost = []
        for name in (*self.improve, *self.improve_to):
            axis = front.names.index(name)
            has_goal = name in self.improve_to and widths[axis] > 0
            lost.append((front.minimised[:, axis] - values[name]) / widths[axis] if has_goal else front.shares[:, axis])
        scores: Values = np.max(lost, axis=0) + OPTIONS.augmentation * front.shares.sum(axis=1)
        row, others = first_row(front, scores, within), int(within.sum()) - 1

        if row == start:
            outcome = f"none of {others} others that satisfy this does better, so that it stays"
            outcome = outcome if others else "no other point satisfies this, so that it stays"
        else:
            change = compare(front, start, row)
            gains = amounts_in_words(front, change.gains, better=True)
            costs = amounts_in_words(front, change.costs, better=False)
            outcome = f"point {front.ids[row]} does best of {others} others that satisfy this, with {gains} for {costs}"

        def to(values: Mapping[str, float]) -> list[str]:
            return [with_unit(front, name, f"{name} to {value:.4g}") for name, value in values.items()]

        words = [f"improve {list_words(self.improve)}"] if self.improve else []
        words += [f"improve {goal}" for goal in to(self.improve_to)]
        words += [f"keep {list_words(self.keep)}"] if self.keep else []
        words += [f"relax {goal}" for goal in to(self.relax_to)]
        words += [f"leave {list_words(self.free)} free"] if self.free else []
        verdict = f"From point {self.current}, {list_words(words)}: {outcome}."
        details = {"current": int(self.current), "within": tuple(front.ids[within].tolist())}
        return explain(front, row, verdict, preference=self, score=float(scores[row]), details=details)

    def _names(self) -> list[str]:
        return [name for field in CLASSES for name in getattr(self, field)]


@dataclass(frozen=True, init=False, eq=False)
class Aspiration:
    """Aspiration levels of objectives, by name, in their own units and sign; other objectives are free.

    The chosen point has the least achievement function of Wierzbicki (1980; Miettinen 1999, section 3.5.2):
    max (Z_i − a_i) over the named objectives + 1e-4 Σ (Z_i − a_i) over all; a_i is the aspiration level as a share of
    the stored range, 0 for other objectives. If the levels are within reach, this point exceeds them the most in its
    worst objective, else it misses them the least. Aspirations can reach every point whose gains, compared with any
    other point, are at least a ten-thousandth of its losses. An objective without a range has no effect.

    ``Aspiration(kinetic_energy=0.05, torque_norm=0.1)``, or a mapping if a name is no identifier. Raises InvalidInput
    if a value is no finite number, no objective is named, or a name is given twice.
    """

    values: Mapping[str, float]

    def __init__(self, mapping: Mapping[str, float] | None = None, /, **values: float) -> None:
        named = named_numbers("aspiration", mapping, values)
        if not named:
            raise InvalidInput("aspiration: at least one objective must have a value, got none")
        object.__setattr__(self, "values", named)

    def __repr__(self) -> str:
        return f"Aspiration({named_text(self.values)})"

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the point with the least achievement function; raises InvalidInput if a name is no objective."""
        check_front(front)
        check_known(front.names, "aspiration", self.values)
        axes = np.array([front.names.index(name) for name in self.values])
        wishes = np.full(len(front.names), np.nan)
        wishes[axes] = list(self.values.values())
        excess = front.shares[:, axes] - shares_of(front, wishes)[axes]
        score = excess.max(axis=1) + OPTIONS.augmentation * (
            excess.sum(axis=1) + np.delete(front.shares, axes, axis=1).sum(axis=1)
        )
        row = first_row(front, score)
        missed = front.minimised - np.where(front.maximised, -wishes, wishes)
        meets = ~(missed > OPTIONS.rounding * np.ptp(front.ranges, axis=1))
        met_by = front.ids[meets[:, axes].all(axis=1)].tolist()
        misses = {front.names[axis]: float(missed[row, axis]) for axis in axes if not meets[row, axis]}
        details = {
            "within_reach": bool(met_by),
            "misses": misses,
            "spares": {front.names[axis]: float(-missed[row, axis]) for axis in axes if meets[row, axis]},
            "worst_share": float(excess[row].max()),
        }
        sides = dict(zip(front.names, np.where(front.maximised, "least", "most"), strict=True))
        named = [with_unit(front, each, f"{each} at {sides[each]} {value:.4g}") for each, value in self.values.items()]
        point, worst, most = (
            f"point {front.ids[row]} of {len(front)}",
            front.names[axes[excess[row].argmax()]],
            excess[row].max(),
        )
        verdict = f"The wish, {list_words(named)}, is"
        lost = list_words([f"{name} by {quantity(front, name, amount)}" for name, amount in misses.items()])
        if not misses and most > -OPTIONS.rounding:
            verdict += f" just within reach: {point} meets it, but is not better in all of it."
        elif not misses:
            verdict += f" within reach: {point} has the largest margin in its worst objective, "
            verdict += f"{percent(-most)} of the range, in {worst}."
        elif met_by:
            verdict += f" within reach: point {met_by[0]} meets it, but {point} misses it only by a trace, {lost}, and "
            verdict += "has a lower sum of shares."
        else:
            verdict += (
                f" out of reach: {point} misses it the least, by at most {percent(most)} of a range, in {worst}. "
            )
            verdict += f"It misses {lost}."
        return explain(front, row, verdict, preference=self, score=float(score[row]), details=details)
