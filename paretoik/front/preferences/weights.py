"""Preferences by order and by weights of the objectives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paretoik.arrays import Values
from paretoik.errors import InvalidInput
from paretoik.front.choice import (
    Choice,
    compare_better,
    explain,
    first_row,
    list_words,
    named_numbers,
    named_text,
    subject,
    with_unit,
)
from paretoik.front.geometry import PREFERENCE_OPTIONS as OPTIONS
from paretoik.front.points import Front, FrontData, check_front, check_known
from paretoik.inputs import finite_number, shown
from paretoik.tables import html_representation


@dataclass(frozen=True, init=False, eq=False)
class Lexicographic:
    """Objectives in the order of their importance, each with a tolerance around its best value.

    Points within the tolerance of the best first objective remain, then among these the points within the tolerance of
    the best second one, and so on; if several remain, the one with the lowest sum of shares is chosen. Source:
    Miettinen 1999, section 4.2; tolerances as in its section 4.2.2.

    ``Lexicographic("kinetic_energy", "torque_norm", tolerances={"kinetic_energy": 0.01})``: ``tolerances`` are in the
    objective's own units, ``tolerance_shares`` are shares of its stored range. An objective has at most one of them. If
    it has none, its tolerance is 0, and later objectives decide only among equal values.

    Raises InvalidInput if a name is given twice, no name is given, or a tolerance is negative or of another objective.
    """

    order: tuple[str, ...]
    tolerances: Mapping[str, float]
    tolerance_shares: Mapping[str, float]

    def __init__(
        self,
        *order: str,
        tolerances: Mapping[str, float] | None = None,
        tolerance_shares: Mapping[str, float] | None = None,
    ) -> None:
        if not order or not all(isinstance(name, str) for name in order):
            raise InvalidInput(
                "lexicographic: order must be names of objectives, the most important first, as in "
                f'Lexicographic("duration", "energy"), got {shown(order[0] if len(order) == 1 else order)}'
            )
        twice = [name for name in order if order.count(name) > 1]
        if twice:
            raise InvalidInput(f"lexicographic: each objective must be named once, got {twice[0]} twice")
        amounts, shares = (
            named_numbers(f"lexicographic {field}", each, {}, signed=False)
            for field, each in (("tolerances", tolerances), ("tolerance_shares", tolerance_shares))
        )
        for field, named in (("tolerances", amounts), ("tolerance_shares", shares)):
            check_known(order, f"lexicographic {field}", named)
        both = [name for name in amounts if name in shares]
        if both:
            raise InvalidInput(f"lexicographic: {both[0]} must have one tolerance, got one in units and one as a share")
        assign = object.__setattr__
        assign(self, "order", order)
        assign(self, "tolerances", amounts)
        assign(self, "tolerance_shares", shares)

    def __repr__(self) -> str:
        parts = [repr(name) for name in self.order]
        for field, values in (("tolerances", self.tolerances), ("tolerance_shares", self.tolerance_shares)):
            parts += [f"{field}={dict(values)}"] if values else []
        return f"Lexicographic({', '.join(parts)})"

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the point that the order leads to; raises InvalidInput if a name is no objective."""
        check_front(front)
        check_known(front.names, "lexicographic", self.order)
        among, words, remaining = np.ones(len(front), dtype=bool), [], {}
        for name in self.order:
            axis = front.names.index(name)
            width = float(np.ptp(front.ranges[axis]))
            tolerance = self.tolerances.get(name, self.tolerance_shares.get(name, 0.0) * width)
            best = float(front.minimised[among, axis].min())
            among &= front.minimised[:, axis] <= best + tolerance + OPTIONS.rounding * width
            count = remaining[name] = int(among.sum())
            verb = ("is" if count == 1 else "are") if tolerance else ("has" if count == 1 else "have")
            within = f" within {with_unit(front, name, f'{tolerance:.3g}')} of" if tolerance else ""
            value = -best if front.maximised[axis] else best
            words.append(with_unit(front, name, f"{count} {verb}{within} the best {name}, {value:.4g}"))
        row = first_row(front, np.zeros(len(front)), among)
        last = f"point {front.ids[row]}" + ", whose sum of shares is the lowest" * (count > 1)
        verdict = f"Among {len(front)} points, {'; among these, '.join(words)}: {last}."
        return explain(front, row, verdict, preference=self, details={"remaining": remaining})


@dataclass(frozen=True, init=False, eq=False)
class Weights:
    """Weights of the objectives, by name; an objective that is not named has weight 0.

    The choice follows Marcos et al. (2012), Eqs. 19 and 20: each objective is normalised by the front's stored range,
    and the point with the smallest weighted sum wins. Ties go to the lowest sum of all shares, then to the best first
    objective, then to the lowest id. Weights have no unit, and are scaled to sum 1:
    ``Weights(kinetic_energy=0.3, torque_norm=0.7)``, or a mapping if a name is not an identifier.

    Weights reach only points on the convex hull of the front. The reason gives the number of other points;
    ``Aspiration`` can reach these.

    Raises InvalidInput if a weight is negative or not finite, no weight is positive, or a name is given twice.
    """

    weights: Mapping[str, float]

    def __init__(self, mapping: Mapping[str, float] | None = None, /, **weights: float) -> None:
        object.__setattr__(self, "weights", check_weights("weights", mapping, weights))

    def __repr__(self) -> str:
        return f"Weights({named_text(self.weights)})"

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the point with the smallest weighted sum; raises InvalidInput if a weight names no objective."""
        check_front(front)
        weights = weights_by_axis(front, self.weights, "weights")
        sums = front.shares @ weights
        row = first_row(front, sums)
        verdict = (
            f"{subject(front, row)} has the least weighted sum, {sums[row]:.3g}, of the objectives as shares of their "
            f"ranges ({weights_in_words(front, weights)})."
        )
        if unnamed := [name for name, weight in zip(front.names, weights, strict=True) if not weight]:
            verdict += f" Without a weight, {list_words(unnamed)} decided only between equal sums."
        if unreached := front.ids[~front.supported].tolist():
            near = [str(each.id) for each in compare_better(front, row, nearest=True) if each.id in unreached]
            verdict += f" No weights reach {len(unreached)} of the points, which are above straight lines between "
            verdict += "others" + f", among them its neighbour{'s' * (len(near) > 1)} {list_words(near)}" * bool(near)
            verdict += "; an aspiration can reach them."
        named = dict(zip(front.names, weights.tolist(), strict=True))
        details = {"weights": named, "unreached": tuple(unreached)}
        return explain(front, row, verdict, preference=self, score=float(sums[row]), details=details)


def check_weights(kind: str, mapping: Mapping[str, float] | None, keywords: Mapping[str, float]) -> Mapping[str, float]:
    """Return weights by objective; raises InvalidInput unless all are at least 0 and one is positive."""
    weights = named_numbers(kind, mapping, keywords, signed=False)
    if not any(weights.values()):
        raise InvalidInput(f"{kind}: at least one must be above zero, got {shown(dict(weights))}")
    return weights


def weights_by_axis(front: FrontData, named: Mapping[str, float], kind: str) -> Values:
    """Return the weights of all objectives, scaled to sum 1; raises InvalidInput if a name is no objective."""
    check_known(front.names, kind, named)
    weights: Values = np.array([named.get(name, 0.0) for name in front.names])
    weights /= weights.max()  # so that the sum of huge weights stays finite
    return weights / weights.sum()


def weights_in_words(front: FrontData, weights: Values) -> str:
    """Return the weights that are not 0 in percent, by name."""
    return ", ".join(f"{name} {weight:.3g}%" for name, weight in zip(front.names, 100 * weights, strict=True) if weight)


@dataclass(frozen=True, init=False, eq=False)
class Robust:
    """Weights that may each be wrong by a share ``uncertainty``; the largest regret is minimised.

    The regret of a point under weights v is its v·Z less the smallest v·Z of all points. The weights v are in the box
    w(1 ± uncertainty) around the given ones w, scaled to sum 1. The regret is convex in v, so that it is largest at a
    vertex; the point with the least largest regret is chosen (min-max regret; Savage 1951; Kouvelis and Yu 1997).

    ``Robust(kinetic_energy=0.3, torque_norm=0.7, uncertainty=0.2)``. Raises InvalidInput for weights as ``Weights``
    does, and for an uncertainty that is not between 0 and 1.
    """

    weights: Mapping[str, float]
    uncertainty: float

    def __init__(
        self, mapping: Mapping[str, float] | None = None, /, *, uncertainty: float = 0.2, **weights: float
    ) -> None:
        number = finite_number("robust uncertainty", uncertainty)
        if not 0 <= number <= 1:
            raise InvalidInput(f"robust uncertainty must be a share from 0 to 1, got {shown(uncertainty)}")
        object.__setattr__(self, "weights", check_weights("robust", mapping, weights))
        object.__setattr__(self, "uncertainty", number)

    def __repr__(self) -> str:
        return f"Robust({named_text(self.weights)}, uncertainty={self.uncertainty:g})"

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the point with the least largest regret; raises InvalidInput if a weight names no objective."""
        check_front(front)
        weights = weights_by_axis(front, self.weights, "robust")
        # The largest regret of a point compared with another over the box is w·d + x w·|d|, d = Z_p − Z_q.
        regrets, rivals = np.empty(len(front)), np.empty(len(front), dtype=np.int64)
        for p, point in enumerate(front.shares):
            steps = point - front.shares
            against = steps @ weights + self.uncertainty * (np.abs(steps) @ weights)
            rivals[p] = against.argmax()
            regrets[p] = against[rivals[p]]
        row = first_row(front, regrets)
        rival, regret = int(rivals[row]), float(regrets[row])
        worst = weights * (1 + self.uncertainty * np.sign(front.shares[row] - front.shares[rival]))
        text = (
            f"{subject(front, row)} has the least largest regret, {regret:.3g}, if each of the weights "
            f"{weights_in_words(front, weights)} may be wrong by {100 * self.uncertainty:.3g}%"
        )
        if regret > 0:
            text += f": at worst they are {weights_in_words(front, worst)}, and with these the weighted sum of point "
            text += f"{front.ids[rival]} is less by that amount."
        else:
            text += ": for all of these it has the least weighted sum."
        details = {
            "weights": dict(zip(front.names, weights.tolist(), strict=True)),
            "worst_weights": dict(zip(front.names, worst.tolist(), strict=True)),
            "rival": int(front.ids[rival]),
        }
        return explain(front, row, text, preference=self, score=regret, details=details)
