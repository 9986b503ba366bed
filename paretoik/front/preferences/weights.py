"""A preference by weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paretoik.arrays import Values
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.front.explanation import compare_neighbours
from paretoik.front.front import Choice, Front
from paretoik.front.preferences.named_numbers import named_numbers, named_text
from paretoik.front.reason import list_words, subject
from paretoik.front.subset import check_front, check_known
from paretoik.front.ties import first_row
from paretoik.inputs import shown
from paretoik.tables import html_representation


@check_call
@dataclass(frozen=True, init=False, eq=False)
class Weights:
    """Weights of the objectives, by name; an objective that is not named has weight 0.

    Chooses as in Marcos et al. (2012), Eqs. 19 and 20: each objective is normalised by the front's stored range, and
    the point with the smallest weighted sum (weights scaled to sum 1) wins; of ties the lowest sum of all shares, then
    the best first objective, then the lowest id. The weights have no unit and need not sum to anything:
    ``Weights(kinetic_energy=0.3, torque_norm=0.7)``, or a mapping where a name is no identifier.

    Weights reach points on the convex hull of the front alone, and the reason says how many others there are, which
    ``Aspiration`` can reach.

    Raises InvalidInput where a weight is no finite number of at least 0, none is positive, or a name comes twice.
    """

    weights: Mapping[str, float]

    def __init__(self, mapping: Mapping[str, float] | None = None, /, **weights: float) -> None:
        object.__setattr__(self, "weights", check_weights("weights", mapping, weights))

    def __repr__(self) -> str:
        return f"Weights({named_text(self.weights)})"

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the point with the smallest weighted sum; raises InvalidInput where a weight names no objective."""
        check_front(front)
        weights = weights_by_axis(front, self.weights, "weights")
        sums = front.shares @ weights
        row = first_row(front, sums)
        unreached = front.ids[~front.supported].tolist()
        verdict = (
            f"{subject(front, row)} has the least weighted sum, {sums[row]:.3g}, of what objectives give up of their "
            f"ranges ({weights_in_words(front, weights)})."
        )
        return front.choice(
            row,
            " ".join(filter(None, [verdict, _unnamed(front, weights), _unreached(front, row, unreached)])),
            preference=self,
            score=float(sums[row]),
            details={"weights": dict(zip(front.names, weights.tolist(), strict=True)), "unreached": tuple(unreached)},
        )


def check_weights(kind: str, mapping: Mapping[str, float] | None, keywords: Mapping[str, float]) -> Mapping[str, float]:
    """Return weights by objective; raises InvalidInput unless all are at least 0 and one is positive."""
    weights = named_numbers(
        kind, mapping, keywords, accept=lambda weight: 0.0 <= weight < np.inf, requirement="a finite number >= 0"
    )
    if not any(weights.values()):
        raise InvalidInput(f"{kind}: wanted at least one above zero, got {shown(dict(weights))}")
    return weights


def weights_by_axis(front: Front, named: Mapping[str, float], kind: str) -> Values:
    """Return the weights of a front's objectives, their sum 1; raises InvalidInput where one names no objective."""
    check_known(front, kind, named)
    weights: Values = np.array([named.get(name, 0.0) for name in front.names])
    weights /= weights.max()  # so that the sum of huge weights stays finite
    return weights / weights.sum()


def weights_in_words(front: Front, weights: Values) -> str:
    """Return the weights that are not 0 in percent, by name."""
    return ", ".join(f"{name} {weight:.3g}%" for name, weight in zip(front.names, 100 * weights, strict=True) if weight)


def _unnamed(front: Front, weights: Values) -> str:
    unnamed = [name for name, weight in zip(front.names, weights, strict=True) if not weight]
    return f"Without a weight, {list_words(unnamed)} decided only between equal sums." if unnamed else ""


def _unreached(front: Front, row: int, unreached: list[int]) -> str:
    if not unreached:
        return ""
    near = [each.id for each in compare_neighbours(front, row) if each.id in unreached]
    text = f"No weights at all reach {len(unreached)} of the points, which lie above straight lines between others"
    if near:
        text += f", among them its neighbour{'s' * (len(near) > 1)} {list_words(list(map(str, near)))}"
    return f"{text}; an aspiration can reach them."
