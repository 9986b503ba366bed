"""Place points of a two-objective front for the most hypervolume.

Between two neighbours the front is modelled by the parabola with their tangents, which follow from exchange rates. Near
an end the front is a parabola, because an objective has its minimum there. If the tangents contradict each other, as
across a jump, the chord is used.

Source: sandwich algorithms, e.g. Rote 1992; the subset of most hypervolume, Auger, Bader, Brockhoff & Zitzler 2009.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from paretoik.front.geometry import curve_area, lower_hull, tangents_meet

# Spread of points over a front: non-dominated points, gaps, and the next point.


POINT_TOLERANCE = 1e-7  # smallest distance of different points, and smallest gain, as a share of the ranges


def front_rows(shares: Float[np.ndarray, "points n_obj"]) -> Int[np.ndarray, " rows"]:
    """Return the rows of distinct non-dominated points, sorted by the first objective.

    ``shares`` are objectives as shares of their ranges. Points with a NaN are left out.
    """
    rows = list[int]()
    for i in np.argsort(shares.sum(axis=1), kind="stable").tolist():  # a point that dominates has a smaller sum
        if np.isfinite(shares[i]).all() and not (shares[rows] <= shares[i] + POINT_TOLERANCE).all(axis=1).any():
            rows.append(i)
    front = np.array(rows, dtype=int)
    return front[np.argsort(shares[front, 0], kind="stable")]


def spread_rows(shares: Float[np.ndarray, "points n_obj"], count: int) -> Int[np.ndarray, " rows"]:
    """Return the rows of up to ``count`` points that are well spread.

    The best point in each objective is chosen first, then one after another the point farthest from those chosen.
    """
    rows = list(dict.fromkeys(shares.argmin(axis=0).tolist()))
    while len(rows) < min(count, len(shares)):
        gaps = np.linalg.norm(shares[:, None] - shares[None, rows], axis=2).min(axis=1)
        rows.append(int(gaps.argmax()))
    return np.array(sorted(rows), dtype=int)


def fill_gaps(
    front: Callable[[], Float[np.ndarray, "points n_obj"]],
    add: Callable[[int, Float[np.ndarray, " n_obj"]], bool],
    points: int,
    look_ahead: Callable[[list[tuple[int, Float[np.ndarray, " n_obj"]]]], object] | None = None,
) -> None:
    """Add points in the widest gaps, until there are ``points`` or no gap is left.

    A gap that stays as wide is closed: at a jump, points could be added at either edge forever.

    add: function that minimises an objective below upper bounds (inf for its own), and returns whether the point is new
    look_ahead: function called with the likely arguments of ``add`` for every gap, the widest first
    """
    closed: set[tuple[float, ...]] = set()
    while True:
        values = front()
        if len(values) >= points:
            return
        wide = [pair for pair in _gaps(values) if (*values[pair[0]], *values[pair[1]]) not in closed]
        if not wide:
            return
        if look_ahead is not None:
            look_ahead([_levels(values[list(pair)])[0] for pair in wide])
        ends = values[list(wide[0])]
        for main, upper in _levels(ends):
            if add(main, upper) and not _wide_gaps(front(), ends):
                break
        else:
            closed.update({tuple(ends.ravel().tolist()), *_wide_gaps(front(), ends)})


def _levels(ends: Float[np.ndarray, "2 n_obj"]) -> list[tuple[int, Float[np.ndarray, " n_obj"]]]:
    """Return objectives to minimise between two points, with upper bounds.

    The other objectives' bounds are midpoints. The objective whose bound halves the longer side of the gap comes first.
    At a jump there may be a point for one objective and none for the other.
    """
    mains, middle = np.argsort(np.abs(ends[0] - ends[1]), kind="stable"), ends.mean(axis=0)
    return [(int(main), np.where(np.arange(len(middle)) == main, np.inf, middle)) for main in mains]


def _wide_gaps(values: np.ndarray, ends: np.ndarray) -> list[tuple[float, ...]]:
    """Return the gaps between two points that are at least 95 % as wide as the two are apart."""
    size = float(np.linalg.norm(ends[1] - ends[0]))
    off = np.linalg.norm(values[:, None] - ends, axis=2)
    inside = np.sum(off**2, axis=1) <= size**2 * (1 + 1e-9)
    pairs = [(i, j) for i, j in _gaps(values) if inside[i] and inside[j]]
    wide = [pair for pair in pairs if np.linalg.norm(values[pair[0]] - values[pair[1]]) >= 0.95 * size]
    return [tuple(np.concatenate([values[i], values[j]]).tolist()) for i, j in wide]


def is_duplicate(value: Float[np.ndarray, " n_obj"], others: Float[np.ndarray, "points n_obj"]) -> bool:
    """Return whether a point equals one of the others within the tolerance."""
    return bool((np.abs(others - value).max(axis=1) <= 10 * POINT_TOLERANCE).any())


def _gaps(values: np.ndarray) -> list[tuple[int, int]]:
    """Return pairs of neighbours, the widest first: no point is in the ball between two (Gabriel graph)."""
    square = np.sum((values[:, None] - values[None]) ** 2, axis=2)
    inside = square[:, None, :] + square[None, :, :] < square[:, :, None]  # (i, j, k): whether k is between i and j
    first, second = np.nonzero(np.triu(~inside.any(axis=2) & (square > (10 * POINT_TOLERANCE) ** 2), 1))
    order = np.argsort(-square[first, second], kind="stable")
    return list(zip(first[order].tolist(), second[order].tolist(), strict=True))


# Placement of points for the most hypervolume.


@dataclass(frozen=True, kw_only=True)
class PlacementOptions:
    """Settings of the placement."""

    places: int = 31  # number of places tested in a gap
    total: int = 400  # approximate largest number of places in all gaps; if there are many gaps, each has fewer
    # least gain of a replacement when there are enough points, as a share of the hypervolume in all gaps
    gain: float = 0.005
    # relative difference of gains that count as equal: a chord has many best subsets; rounding must not choose one
    tie: float = 1e-8


OPTIONS = PlacementOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Gap:
    """Two neighbours of a front and the model curve between them."""

    places: Float[np.ndarray, "places 2"]  # places on the curve in order; the first and the last are the neighbours
    area: float  # hypervolume that the whole curve adds to its ends
    contradicts: bool  # whether the tangents contradict each other; then the curve is the chord
    is_concave: bool  # whether the curve is above the chord

    @cached_property
    def subsets(self) -> BestSubsets:
        """The best places for any number of points."""
        return BestSubsets(self.places)


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """A place for one more point, and the hypervolume that it adds."""

    gap: int
    values: Float[np.ndarray, " 2"]
    gain: float


class BestSubsets:
    """The subset of each size with the most hypervolume less the ``cost`` of its points.

    Both ends are always included. ``values`` are mutually non-dominated and sorted by the first objective; the
    reference point has the worst value of each objective. Sizes are computed by dynamic programming when needed.
    """

    def __init__(self, values: Float[np.ndarray, "points 2"], cost: Float[np.ndarray, " points"] | float = 0.0) -> None:
        first, second = values.T
        self._gain = (first[-1] - first) * (second[:, None] - second) - cost  # gain of point (column) after point (row)
        self._gain[np.tril_indices(len(values))] = -np.inf
        self._tie = OPTIONS.tie * (first[-1] - first[0]) * (second[0] - second[-1])
        self._best, self._before = [self._gain[0]], list[np.ndarray]()

    def _extend(self, count: int) -> None:
        while len(self._before) < count - 2:
            sums = self._best[-1][:, None] + self._gain
            self._best.append(sums.max(axis=0))
            self._before.append((sums >= self._best[-1] - self._tie).argmax(axis=0))

    def rows(self, count: int) -> Int[np.ndarray, " rows"]:
        """Return the rows of the best subset of ``count`` ≥ 2 points."""
        self._extend(count)
        rows = [len(self._gain) - 1]
        for before in reversed(self._before[: count - 2]):
            rows.append(int(before[rows[-1]]))
        return np.array([0, *reversed(rows)])

    def volume(self, count: int) -> float:
        """Return the hypervolume less cost of the best subset of ``count`` ≥ 2 points."""
        self._extend(count)
        return float(self._best[count - 2][-1])


def best_rows(
    values: Float[np.ndarray, "points 2"], count: int, cost: Float[np.ndarray, " points"] | float = 0.0
) -> Int[np.ndarray, " rows"]:
    """Return the rows of up to ``count`` points with the most hypervolume less their ``cost``."""
    count = max(count, 2)
    return np.arange(len(values)) if len(values) <= count else BestSubsets(values, cost).rows(count)


def gap_between(values: Float[np.ndarray, "2 2"], weights: Float[np.ndarray, "2 2"]) -> Gap:
    """Return the gap between two neighbours; ``weights`` of their objectives are NaN if unknown."""
    left, right = values
    meeting = tangents_meet(left, right, *weights)
    control = values.mean(axis=0) if meeting is None else meeting
    share = np.linspace(0.0, 1.0, OPTIONS.places + 2)[:, None]
    places = (1 - share) ** 2 * left + 2 * share * (1 - share) * control + share**2 * right
    area, chord = curve_area(values, meeting), -0.5 * float(np.prod(right - left))
    return Gap(places=places, area=area, contradicts=meeting is None, is_concave=area < chord)


def hull_pairs(values: Float[np.ndarray, "points 2"]) -> list[tuple[int, int]]:
    """Return the rows of neighbours on the lower convex hull between which there are other points.

    Points above the hull may be on a worse branch. ``values`` are sorted by the first objective.
    """
    return [(i, j) for i, j in pairwise(lower_hull(values)) if j > i + 1]


def next_targets(gaps: Sequence[Gap], values: Float[np.ndarray, "points 2"], points: int) -> list[Target]:
    """Return the next targets, the largest gain first; none if none adds enough.

    While points are missing, they are distributed among the gaps, and each gap's target is its best place. The caller
    uses only the first target, because its result changes the others. When there are enough points, the targets are the
    places in the best subset of points and places; each must add enough.
    """
    if not gaps:
        return []
    missing = points - len(values)
    if missing > 0:
        # the best place in every gap that gets points; each missing point goes to the largest gain
        totals, full = np.zeros(len(gaps), dtype=int), OPTIONS.places + 2
        gains = np.array([gap.subsets.volume(3) for gap in gaps])
        for _ in range(missing):
            k = _first_largest(gains)
            totals[k] += 1
            now, more = (min(2 + int(totals[k]) + extra, full) for extra in (0, 1))
            gains[k] = gaps[k].subsets.volume(more) - gaps[k].subsets.volume(now)
        targets = list[Target]()
        for i in np.flatnonzero(totals).tolist():
            curve = gaps[i].places
            rows = gaps[i].subsets.rows(min(2 + int(totals[i]), full))[1:-1]
            gain = (curve[-1, 0] - curve[rows, 0]) * (curve[0, 1] - curve[rows, 1])
            best = _first_largest(gain)
            targets.append(Target(gap=i, values=curve[rows[best]], gain=float(gain[best])))
    else:
        # the best subset of non-dominated points and places, in order, and the gap of each (−1 for a point)
        step = -(-OPTIONS.places * len(gaps) // OPTIONS.total)
        inner = [gap.places[1 + step // 2 : -1 : step] for gap in gaps]
        owners = np.concatenate([np.full(len(values), -1), *(np.full(len(each), i) for i, each in enumerate(inner))])
        places = np.concatenate([values, *inner])
        order = np.lexsort((places[:, 1], places[:, 0]))
        lowest = np.minimum.accumulate(np.append(np.inf, places[order, 1]))[:-1]
        order = order[places[order, 1] < lowest]
        candidates, owners = places[order], owners[order]
        enough = OPTIONS.gain * sum(gap.area for gap in gaps)
        chosen = best_rows(candidates, points, np.where(owners >= 0, enough, 0.0))
        targets = [
            Target(
                gap=int(owners[row]),
                values=candidates[row],
                gain=float((candidates[after, 0] - candidates[row, 0]) * (candidates[before, 1] - candidates[row, 1])),
            )
            for before, row, after in zip(chosen[:-2], chosen[1:-1], chosen[2:], strict=True)
            if owners[row] >= 0
        ]
    if targets:
        targets.insert(0, targets.pop(_first_largest(np.array([target.gain for target in targets]))))
    return targets[:1] + sorted(targets[1:], key=lambda target: -target.gain)


def _first_largest(gains: Float[np.ndarray, " gains"]) -> int:
    """Return the index of the first gain that equals the largest within rounding."""
    return int(np.argmax(gains >= gains.max() - OPTIONS.tie * abs(gains.max())))
