"""The knee of a front as a preference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from paretoik.arrays import Values
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.front.front import Choice, Front
from paretoik.front.preference_options import OPTIONS
from paretoik.front.reason import percent, subject
from paretoik.front.subset import check_front
from paretoik.front.ties import first_row
from paretoik.tables import html_representation


@check_call
@dataclass(frozen=True, kw_only=True)
class Knee:
    """The knee: the point from which any step costs the most beside what it gains.

    Of two objectives the point farthest below the straight line between the ends of the front, whatever the ranges (Das
    1999, "On characterizing the 'knee' of the Pareto curve based on normal-boundary intersection").
    Of more the point with the largest least trade-off: exchanging p for q costs Σ max(0, Z_q − Z_p) in shares and gains
    Σ max(0, Z_p − Z_q); the least ratio of the two over all q is the least trade-off of p (Rachmawati and Srinivasan
    2009, IEEE Trans. Evolutionary Computation 13(4), μ(x_i, S)). Where points are dense the nearest exchange gains
    about what it costs, so that ratios are near 1 or below: the knee has the largest, whatever its size. A point that
    is the best in every objective, rounding aside, is the knee.

    ``choose`` raises InvalidInput where there is no knee: of one objective, and of two where no point lies below the
    line (a straight or hollow front).
    """

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the knee; raises InvalidInput where there is none."""
        check_front(front)
        if len(front.names) == 1:
            raise InvalidInput("knee: wanted two objectives or more, got one, whose best point is the answer")
        best = (front.shares <= front.shares.min(axis=0) + OPTIONS.rounding).all(axis=1)
        if best.any():
            row = first_row(front, np.zeros(len(front)), best)
            words = (
                "is as good as any: all are equal"
                if best.all()
                else "is the knee: it is the best in every objective, rounding aside"
            )
            return front.choice(row, f"{subject(front, row)} {words}.", preference=self)
        return self._below_line(front) if len(front.names) == 2 else self._least_trade_off(front)

    def _below_line(self, front: Front) -> Choice:
        depths = _depths(front)
        row = first_row(front, -depths)
        if depths[row] <= OPTIONS.rounding:
            raise InvalidInput(
                f"knee: wanted a point below the straight line between the ends, got none among {len(front)}: "
                "no knee; Compromise or Aspiration choose on such a front"
            )
        ends = [first_row(front, front.shares[:, axis]) for axis in range(2)]
        return front.choice(
            row,
            f"{subject(front, row)} is the knee: it lies farthest below the straight line between the ends, points "
            f"{front.ids[ends[0]]} and {front.ids[ends[1]]}: {percent(depths[row])} of the way from the line to the "
            "best of both.",
            preference=self,
            score=-float(depths[row]),
            details={"depth": float(depths[row]), "ends": tuple(int(front.ids[end]) for end in ends)},
        )

    def _least_trade_off(self, front: Front) -> Choice:
        ratios = _least_trade_offs(front)
        row = first_row(front, -ratios)
        other = int(front.ids[first_row(front, _trade_offs(front, row))])
        return front.choice(
            row,
            f"{subject(front, row)} is the knee, with the largest least trade-off: going from it to any other costs at "
            f"least {ratios[row]:.3g} times what it gains, in shares of the ranges; going to point "
            f"{other} costs that little.",
            preference=self,
            score=-float(ratios[row]),
            details={"least_trade_off": float(ratios[row]), "nearest_exchange": other},
        )


def _depths(front: Front) -> Values:
    """Return how far points lie below the line between the ends, 1 at the corner that is best in both objectives."""
    shares = front.shares
    first, second = (shares[first_row(front, shares[:, axis])] for axis in range(2))
    width, height = second[0] - first[0], first[1] - second[1]  # both positive, as no point is the best in both
    depths: Values = 1.0 - (shares[:, 0] - first[0]) / width - (shares[:, 1] - second[1]) / height
    return depths


def _least_trade_offs(front: Front) -> Values:
    """Return the least trade-off of every point, over all exchanges."""
    return np.array([_trade_offs(front, row).min() for row in range(len(front))])


def _trade_offs(front: Front, row: int) -> Values:
    """Return what each exchange of a row's point costs over what it gains; inf if it gains nothing."""
    shares = np.ascontiguousarray(front.shares.T)
    steps = shares - shares[:, row, None]
    steps[np.abs(steps) <= OPTIONS.rounding] = 0.0
    costs, gains = np.maximum(steps, 0.0).sum(axis=0), -np.minimum(steps, 0.0).sum(axis=0)
    ratios = np.full(len(front), np.inf)
    np.divide(costs, gains, out=ratios, where=gains > 0)
    return ratios
