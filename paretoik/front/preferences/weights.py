"""A preference by weights."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from types import MappingProxyType

import numpy as np

from paretoik.arrays import Values
from paretoik.errors import InvalidInput
from paretoik.front.front import Choice, Front
from paretoik.front.ties import first_row


@dataclass(frozen=True, init=False, eq=False)
class Weights:
    """Weights of the objectives, by name; an objective that is not named has weight 0.

    Chooses as in Marcos et al. (2012), Eqs. 19 and 20: each objective is normalised by the front's stored range, and
    the point with the smallest weighted sum (weights scaled to sum 1) wins; of ties the lowest sum of all shares, then
    the best first objective, then the lowest id. The weights have no unit and need not sum to anything:
    ``Weights(kinetic_energy=0.3, torque_norm=0.7)``, or a mapping where a name is no identifier.

    Raises InvalidInput where a weight is no finite number of at least 0, none is positive, or a name comes twice.
    """

    weights: Mapping[str, float]

    def __init__(self, mapping: Mapping[str, float] | None = None, /, **weights: float) -> None:
        if not isinstance(mapping, Mapping | None):
            raise InvalidInput(f"weights: numbers by objective wanted, such as {{'energy': 0.3}}, got {mapping!r}")
        merged = dict(mapping or {})
        twice = sorted(merged.keys() & weights.keys())
        if twice:
            raise InvalidInput(f"weights: wanted each objective once, got {twice[0]} twice")
        merged.update(weights)
        for name, weight in merged.items():
            if not _is_weight(weight):
                raise InvalidInput(f"weights: wanted a finite number >= 0 for {name}, got {reprlib.repr(weight)}")
        if not any(merged.values()):
            raise InvalidInput(f"weights: wanted at least one above zero, got {merged}")
        object.__setattr__(self, "weights", MappingProxyType({name: float(weight) for name, weight in merged.items()}))

    def __repr__(self) -> str:
        return f"Weights({', '.join(f'{name}={weight:g}' for name, weight in self.weights.items())})"

    def choose(self, front: Front) -> Choice:
        """Return the point with the smallest weighted sum; raises InvalidInput where a weight names no objective."""
        unknown = [name for name in self.weights if name not in front.names]
        if unknown:
            raise InvalidInput(f"weights: wanted names among {', '.join(front.names)}, got {unknown[0]!r}")
        weights = np.array([self.weights.get(name, 0.0) for name in front.names])
        weights /= weights.max()  # so that the sum of huge weights stays finite
        weights /= weights.sum()
        index = first_row(front, front.shares @ weights)
        return front.choice(index, _reason(front, index, weights))


def _is_weight(value: object) -> bool:
    try:
        return isinstance(value, Real) and 0.0 <= float(value) < np.inf
    except OverflowError:
        return False


def _reason(front: Front, index: int, weights: Values) -> str:
    weight_text = ", ".join(f"{name} {weight:.0%}" for name, weight in zip(front.names, weights, strict=True) if weight)
    values = "; ".join(
        f"{front.quantity(axis, front.objectives[index, axis])}, "
        + (f"{share:.0%} of the range from the best" if low < high else "the same at every point")
        for axis, (share, (low, high)) in enumerate(zip(front.shares[index], front.ranges, strict=True))
    )
    return (
        f"Of {len(front)} points point {front.ids[index]} has the least weighted sum ({weight_text}): {values}. "
        + _nearest_alternative(front, index)
    )


def _nearest_alternative(front: Front, index: int) -> str:
    if len(front) == 1:
        return "There is no alternative."
    distance = np.linalg.norm(front.shares - front.shares[index], axis=1)
    distance[index] = np.inf
    other = first_row(front, distance)
    better = front.minimised[other] - front.minimised[index]
    steps = np.abs(front.objectives[other] - front.objectives[index])
    gains = [front.quantity(axis, steps[axis]) for axis in range(len(steps)) if better[axis] < 0]
    costs = [front.quantity(axis, steps[axis]) for axis in range(len(steps)) if better[axis] > 0]
    start = f"The nearest alternative is point {front.ids[other]}"
    if not gains:
        return f"{start}, equal in every objective."
    return f"{start}: it gains {' and '.join(gains)} and costs {' and '.join(costs)}."
