"""Preferences: a point by its id, the knee and the compromise; the whole project uses these definitions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from paretoik.arrays import Ids, Objectives, Values
from paretoik.errors import InvalidInput
from paretoik.front.choice import Choice, explain, first_row, percent, subject
from paretoik.front.geometry import PREFERENCE_OPTIONS as OPTIONS
from paretoik.front.points import Front, FrontData, check_front, check_has_points, row_of
from paretoik.tables import html_representation


@dataclass(frozen=True)
class Point:
    """The point with an id, as in ``front.select(12)``."""

    point: int

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the point; raises InvalidInput if the front does not have it."""
        row = row_of(front, self.point, name="select: point")
        return explain(front, row, f"Point {front.ids[row]} of {len(front)} was picked by its id.", preference=self)


@dataclass(frozen=True, kw_only=True)
class Knee:
    """The knee: the point from which any step costs the most compared with its gain.

    With two objectives it is the point farthest below the straight line between the ends of the front; the ranges have
    no effect (Das 1999, "On characterizing the 'knee' of the Pareto curve based on normal-boundary intersection").
    With more it is the point with the largest least trade-off: exchanging p for q costs Σ max(0, Z_q − Z_p) in shares
    and gains Σ max(0, Z_p − Z_q); the least ratio cost / gain over all q is the least trade-off of p (Rachmawati and
    Srinivasan 2009, IEEE Trans. Evolutionary Computation 13(4), μ(x_i, S)). On a dense front the nearest exchange gains
    about as much as it costs, so that all ratios are near 1 or below; the knee has the largest. A point that is the
    best in every objective, within rounding, is the knee.

    ``choose`` raises InvalidInput if there is no knee: there is one objective, or there are two and no point is below
    the line (a straight or concave front).
    """

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the knee; raises InvalidInput if the front has no knee."""
        check_front(front)
        if len(front.names) == 1:
            raise InvalidInput("knee: there must be two objectives or more, got one, whose best point is the answer")
        best = (front.shares <= front.shares.min(axis=0) + OPTIONS.rounding).all(axis=1)
        if best.any():
            row = first_row(front, np.zeros(len(front)), best)
            words = (
                "is as good as any: all are equal"
                if best.all()
                else "is the knee: it is the best in every objective, within rounding"
            )
            return explain(front, row, f"{subject(front, row)} {words}.", preference=self)
        if len(front.names) > 2:
            ratios = np.array([_trade_offs(front, row).min() for row in range(len(front))])
            row = first_row(front, -ratios)
            other = int(front.ids[first_row(front, _trade_offs(front, row))])
            verdict = (
                f"{subject(front, row)} is the knee, with the largest least trade-off: going from it to any other "
                f"costs at least {ratios[row]:.3g} times what it gains, in shares of the ranges; going to point "
                f"{other} costs that little."
            )
            details: dict[str, Any] = {"least_trade_off": float(ratios[row]), "nearest_exchange": other}
            return explain(front, row, verdict, preference=self, score=-float(ratios[row]), details=details)
        # Depths below the line between the ends, 1 at the corner that is best in both objectives.
        shares = front.shares
        ends = [first_row(front, shares[:, axis]) for axis in range(2)]
        first, second = shares[ends[0]], shares[ends[1]]
        width, height = second[0] - first[0], first[1] - second[1]  # both positive, as no point is the best in both
        depths: Values = 1.0 - (shares[:, 0] - first[0]) / width - (shares[:, 1] - second[1]) / height
        row = first_row(front, -depths)
        if depths[row] <= OPTIONS.rounding:
            raise InvalidInput(
                f"knee: a point must be below the straight line between the ends, got none among {len(front)}: "
                "no knee; use Compromise or Aspiration"
            )
        verdict = (
            f"{subject(front, row)} is the knee: it lies farthest below the straight line between the ends, points "
            f"{front.ids[ends[0]]} and {front.ids[ends[1]]}: {percent(depths[row])} of the way from the line to the "
            "best of both."
        )
        details = {"depth": float(depths[row]), "ends": tuple(int(front.ids[end]) for end in ends)}
        return explain(front, row, verdict, preference=self, score=-float(depths[row]), details=details)


def _trade_offs(front: FrontData, row: int) -> Values:
    """Return cost / gain of an exchange of a row's point for each point; inf if nothing is gained.

    Cost and gain are sums of shares of the ranges.
    """
    shares = np.ascontiguousarray(front.shares.T)
    steps = shares - shares[:, row, None]
    steps[np.abs(steps) <= OPTIONS.rounding] = 0.0
    costs, gains = np.maximum(steps, 0.0).sum(axis=0), -np.minimum(steps, 0.0).sum(axis=0)
    ratios = np.full(len(front), np.inf)
    np.divide(costs, gains, out=ratios, where=gains > 0)
    return ratios


COMPROMISE_IN_WORDS = "the point whose hardest-hit objective gives up the least, as a share of its range on the front"


@dataclass(frozen=True, kw_only=True)
class Compromise:
    """The compromise: the point whose hardest-hit objective gives up the least, as a share of its range.

    It has the least max Z + 1e-4 ΣZ, Z = (f − ideal)/(nadir − ideal) on the stored ranges: compromise programming with
    the Chebyshev distance (Yu 1973; Zeleny 1973). Unlike the point of equal weights it is no end of a concave front, on
    which weights reach only the ends, and counting an objective twice does not move it (except for the augmentation).
    With one objective it is the best point.
    """

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the compromise of a front that has at least one point."""
        check_front(front)
        scores = score_shares(front.shares)
        row = first_row(front, scores)
        worst = int(front.shares[row].argmax())
        given_up = f", {COMPROMISE_IN_WORDS}: {percent(front.shares[row, worst])}, of {front.names[worst]}"
        verdict = f"{subject(front, row)} is the compromise{given_up if len(front) > 1 else ''}."
        return explain(front, row, verdict, preference=self, score=float(scores[row]))


def score_shares(shares: Objectives) -> Values:
    """Return the scores that the compromise minimises; ``shares`` (points, n_obj) are of the ranges."""
    columns = np.ascontiguousarray(shares.T)  # NumPy takes ten times as long to reduce rows of a few numbers
    scores: Values = columns.max(axis=0) + OPTIONS.augmentation * columns.sum(axis=0)
    return scores


def compromise(front: FrontData) -> Choice:
    """Return the compromise of a front (``Compromise``), without keeping the choice.

    Raises Infeasible if the front is empty.
    """
    check_has_points(front, "compromise")
    return Compromise().choose(front)


# Points that pictures and recordings mark: the best of every objective, and the compromise.


def marked_rows(F: Objectives, ids: Ids) -> list[tuple[int, int | None]]:
    """Return (row, axis) of the best point in each objective, minimised, and (row, None) of the compromise.

    The compromise uses the points' own ranges; with one objective it is the only entry, the best point.
    """
    shares = np.array(F.T, order="C")  # a copy, changed in place: a search does this in every generation
    shares -= shares.min(axis=1, keepdims=True)
    width = shares.max(axis=1, keepdims=True)
    shares /= np.where(width > 0, width, 1.0)
    scores = score_shares(shares.T)
    best = enumerate(best_rows(F, ids)) if F.shape[1] > 1 else ()
    return [*((row, axis) for axis, row in best), (_lowest(scores, ids), None)]


def best_rows(F: Objectives, ids: Ids) -> list[int]:
    """Return the row of the best point in each objective, minimised; of equal points the one with the lowest id."""
    return [_lowest(values, ids) for values in F.T]


def _lowest(values: Values, ids: Ids) -> int:
    rows = np.flatnonzero(values == values.min())
    return int(rows[ids[rows].argmin()])
