"""A preference by an aspiration: values that one would like to have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from paretoik.arrays import Values
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.front.front import Choice, Front
from paretoik.front.preference_options import OPTIONS
from paretoik.front.preferences.named_numbers import named_numbers, named_text
from paretoik.front.reason import list_words, percent, quantity
from paretoik.front.subset import check_front, check_known
from paretoik.front.ties import first_row
from paretoik.tables import html_representation


@check_call
@dataclass(frozen=True, init=False, eq=False)
class Aspiration:
    """Values of the objectives that one would like, by name, in their own units and sign; those not named are free.

    Chooses the least achievement function of Wierzbicki (1980; Miettinen 1999, section 3.5.2): max (Z_i − a_i) over the
    named objectives + 1e-4 Σ (Z_i − a_i) over all, a_i the aspiration's share of the stored range, 0 where none is
    named. Within the reachable set that is the point that betters the wishes the most, outside the one that misses them
    the least, each measured where it is worst. Every point can be had so that gains, beside each other one, at least a
    ten-thousandth of what it gives up. An objective without a range says nothing.

    ``Aspiration(kinetic_energy=0.05, torque_norm=0.1)``, or a mapping where a name is no identifier. Raises
    InvalidInput where a value is no finite number, none is named, or a name comes twice.
    """

    values: Mapping[str, float]

    def __init__(self, mapping: Mapping[str, float] | None = None, /, **values: float) -> None:
        named = named_numbers("aspiration", mapping, values)
        if not named:
            raise InvalidInput("aspiration: wanted a value for at least one objective, got none")
        object.__setattr__(self, "values", named)

    def __repr__(self) -> str:
        return f"Aspiration({named_text(self.values)})"

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the point with the least achievement function; raises InvalidInput where a name is no objective."""
        check_front(front)
        check_known(front, "aspiration", self.values)
        axes = np.array([front.names.index(name) for name in self.values])
        wishes = np.full(len(front.names), np.nan)
        wishes[axes] = list(self.values.values())
        excess = front.shares[:, axes] - _shares(front, wishes)[axes]
        score = excess.max(axis=1) + OPTIONS.augmentation * (
            excess.sum(axis=1) + np.delete(front.shares, axes, axis=1).sum(axis=1)
        )
        row = first_row(front, score)
        meets = _meets(front, wishes)
        met_by = front.ids[meets[:, axes].all(axis=1)].tolist()
        amounts = front.minimised[row] - np.where(front.maximised, -wishes, wishes)
        misses = {front.names[axis]: float(amounts[axis]) for axis in axes if not meets[row, axis]}
        return front.choice(
            row,
            _verdict(front, row, self.values, met_by, misses, excess[row]),
            preference=self,
            score=float(score[row]),
            details={
                "within_reach": bool(met_by),
                "misses": misses,
                "spares": {front.names[axis]: float(-amounts[axis]) for axis in axes if meets[row, axis]},
                "worst_share": float(excess[row].max()),
            },
        )


def _shares(front: Front, wishes: Values) -> Values:
    """Return where values stand in the stored ranges, 0 the best; 0 on a zero range, as of the points."""
    low, high = front.ranges.T
    distance = np.where(front.maximised, high - wishes, wishes - low)
    shares: Values = np.divide(distance, high - low, out=np.zeros_like(distance), where=high > low)
    return shares


def _meets(front: Front, wishes: Values) -> Bool[np.ndarray, "points n_obj"]:
    """Say which wishes which points meet, rounding aside."""
    missed = front.minimised - np.where(front.maximised, -wishes, wishes) > OPTIONS.rounding * np.ptp(
        front.ranges, axis=1
    )
    return np.asarray(~missed)


def _verdict(
    front: Front, row: int, wishes: Mapping[str, float], met_by: list[int], misses: Mapping[str, float], excess: Values
) -> str:
    words = list_words([_wish_in_words(front, name, value) for name, value in wishes.items()])
    point, worst = f"of {len(front)} points point {front.ids[row]}", list(wishes)[int(excess.argmax())]
    if not misses and excess.max() > -OPTIONS.rounding:
        return f"The wish, {words}, is just within reach: {point} meets it and betters it nowhere."
    if not misses:
        return (
            f"The wish, {words}, is within reach: {point} betters it by the most where it betters it least, "
            f"{percent(-excess.max())} of the range, in {worst}."
        )
    missed = list_words([f"{name} by {quantity(front, name, amount)}" for name, amount in misses.items()])
    if met_by:
        return (
            f"The wish, {words}, is within reach: point {met_by[0]} meets it, but {point} misses it by a trace alone, "
            f"{missed}, and has a lower sum of shares."
        )
    return (
        f"The wish, {words}, is out of reach: {point} misses it the least, by at most {percent(excess.max())} of a "
        f"range, in {worst}. It misses {missed}."
    )


def _wish_in_words(front: Front, name: str, value: float) -> str:
    axis = front.names.index(name)
    return f"{name} at {'least' if front.maximised[axis] else 'most'} {value:.4g} {front.units[axis]}".rstrip()
