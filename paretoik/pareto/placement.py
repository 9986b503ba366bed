"""Where points of a front of two objectives gain the most hypervolume, by the exchange rates of its points.

Between two neighbours the front is taken for the parabola that touches the tangents at both: at an end it is one, as
an objective is least there. Where tangents contradict each other, as across a jump, it is taken for the chord.

Source: sandwich algorithms, e.g. Rote 1992; the subset of most hypervolume, Auger, Bader, Brockhoff & Zitzler 2009.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from paretoik.front.geometry import curve_area, tangents_meet

# How points spread over a front: which are part of it, how far apart they are, and where one more goes.


POINT_TOLERANCE = 1e-7  # of the ranges: points nearer than this are one, and a gain of less is none


def front_rows(shares: Float[np.ndarray, "points n_obj"]) -> Int[np.ndarray, " rows"]:
    """Return which points, as shares of the ranges, no other dominates or repeats, in the order of the first share.

    Points are taken in the order of their sums: what dominates another has the smaller one. One with a NaN is left out.
    """
    rows = list[int]()
    for i in np.argsort(shares.sum(axis=1), kind="stable").tolist():
        if np.isfinite(shares[i]).all() and not (shares[rows] <= shares[i] + POINT_TOLERANCE).all(axis=1).any():
            rows.append(i)
    front = np.array(rows, dtype=int)
    return front[np.argsort(shares[front, 0], kind="stable")]


def spread_rows(shares: Float[np.ndarray, "points n_obj"], count: int) -> Int[np.ndarray, " rows"]:
    """Return the rows of the best of every objective, however many, then always of the farthest, up to ``count``."""
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
    """Add points where neighbours on the front are farthest apart, until it has so many or no gap yields one.

    ``add`` minimises an objective below upper bounds (inf for its own), and says whether that was a new point. Across a
    jump of the front it would give points at either edge without end: a gap that stays as wide is closed.
    ``look_ahead`` is shown what ``add`` is called with first for every gap, the widest first, as far as is known.
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
    """Return objectives with the upper bounds of the others halfway between two points.

    First across the longer side; a front with a jump may have a point for one ε and none for the other.
    """
    mains, middle = np.argsort(np.abs(ends[0] - ends[1]), kind="stable"), ends.mean(axis=0)
    return [(int(main), np.where(np.arange(len(middle)) == main, np.inf, middle)) for main in mains]


def _wide_gaps(values: np.ndarray, ends: np.ndarray, *, share: float = 0.95) -> list[tuple[float, ...]]:
    """Return the gaps between two points, as pairs, that are still at least ``share`` as wide as these are apart."""
    size = float(np.linalg.norm(ends[1] - ends[0]))
    off = np.linalg.norm(values[:, None] - ends, axis=2)
    inside = np.sum(off**2, axis=1) <= size**2 * (1 + 1e-9)
    pairs = [(i, j) for i, j in _gaps(values) if inside[i] and inside[j]]
    wide = [pair for pair in pairs if np.linalg.norm(values[pair[0]] - values[pair[1]]) >= share * size]
    return [tuple(np.concatenate([values[i], values[j]]).tolist()) for i, j in wide]


def is_duplicate(value: Float[np.ndarray, " n_obj"], others: Float[np.ndarray, "points n_obj"]) -> bool:
    """Return whether a point is one of others."""
    return bool((np.abs(others - value).max(axis=1) <= 10 * POINT_TOLERANCE).any())


def _gaps(values: np.ndarray) -> list[tuple[int, int]]:
    """Return pairs of neighbours, the farthest apart first: no other point lies in the ball between the two."""
    square = np.sum((values[:, None] - values[None]) ** 2, axis=2)
    inside = square[:, None, :] + square[None, :, :] < square[:, :, None]  # (i, j, k): k between i and j
    first, second = np.nonzero(np.triu(~inside.any(axis=2) & (square > (10 * POINT_TOLERANCE) ** 2), 1))
    order = np.argsort(-square[first, second], kind="stable")
    return list(zip(first[order].tolist(), second[order].tolist(), strict=True))


@dataclass(frozen=True, kw_only=True)
class PlacementOptions:
    """``places`` are looked at in every gap, of a front of many gaps fewer, at most about ``total``.

    Once there are as many points as wanted, another one is worth while that adds ``gain``, a share of the hypervolume
    that all gaps hold.
    """

    places: int = 31
    total: int = 400
    gain: float = 0.005


OPTIONS = PlacementOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Gap:
    """Two neighbours of a front and what is taken to lie between: ``places`` in their order, the neighbours ends.

    ``area`` is the hypervolume that the whole curve adds to its ends; ``contradicts`` where it is but the chord, as the
    tangents contradict each other; ``is_concave`` where it lies above that.
    """

    places: Float[np.ndarray, "places 2"]
    area: float
    contradicts: bool
    is_concave: bool

    @cached_property
    def subsets(self) -> BestSubsets:
        """The best places for any number of points."""
        return BestSubsets(self.places)


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """A place for one more point, in which gap, and the hypervolume that it adds beside the ends of that."""

    gap: int
    values: Float[np.ndarray, " 2"]
    gain: float


class BestSubsets:
    """The subsets of points that have the most hypervolume less ``cost``, of every size, both ends among them.

    ``values`` are mutually non-dominated, in the order of the first objective; hypervolume is up to the worst value of
    each objective. By dynamic programming, as far as sizes are asked for.
    """

    def __init__(self, values: Float[np.ndarray, "points 2"], cost: Float[np.ndarray, " points"] | float = 0.0) -> None:
        first, second = values.T
        self._gain = (first[-1] - first) * (second[:, None] - second) - cost  # of a point (column) after another (row)
        self._gain[np.tril_indices(len(values))] = -np.inf
        self._best, self._before = [self._gain[0]], list[np.ndarray]()

    def _extend(self, count: int) -> None:
        while len(self._before) < count - 2:
            sums = self._best[-1][:, None] + self._gain
            self._before.append(sums.argmax(axis=0))
            self._best.append(sums.max(axis=0))

    def rows(self, count: int) -> Int[np.ndarray, " rows"]:
        """Return the rows of so many points: two or more, no more than there are."""
        self._extend(count)
        rows = [len(self._gain) - 1]
        for before in reversed(self._before[: count - 2]):
            rows.append(int(before[rows[-1]]))
        return np.array([0, *reversed(rows)])

    def volume(self, count: int) -> float:
        """Return the hypervolume, less the cost, of so many points: two or more, no more than there are."""
        self._extend(count)
        return float(self._best[count - 2][-1])


def best_rows(
    values: Float[np.ndarray, "points 2"], count: int, cost: Float[np.ndarray, " points"] | float = 0.0
) -> Int[np.ndarray, " rows"]:
    """Return the rows of at most so many points that have the most hypervolume less ``cost``, both ends among them.

    ``values`` are mutually non-dominated, in the order of the first objective.
    """
    count = max(count, 2)
    return np.arange(len(values)) if len(values) <= count else BestSubsets(values, cost).rows(count)


def gap_between(values: Float[np.ndarray, "2 2"], weights: Float[np.ndarray, "2 2"]) -> Gap:
    """Return the gap between two neighbours; ``weights`` are those of the objectives at each, NaN where unknown."""
    left, right = values
    meeting = tangents_meet(left, right, *weights)
    control = values.mean(axis=0) if meeting is None else meeting
    share = np.linspace(0.0, 1.0, OPTIONS.places + 2)[:, None]
    places = (1 - share) ** 2 * left + 2 * share * (1 - share) * control + share**2 * right
    area, chord = curve_area(values, meeting), -0.5 * float(np.prod(right - left))
    return Gap(places=places, area=area, contradicts=meeting is None, is_concave=area < chord)


def hull_pairs(values: Float[np.ndarray, "points 2"]) -> list[tuple[int, int]]:
    """Return neighbours on the lower convex hull of points that have others between them, as pairs of rows.

    ``values`` are in the order of the first objective. Points above the hull may lie on a worse branch.
    """
    hull = list[int]()
    for i, value in enumerate(values):
        while len(hull) > 1:
            one, other = values[hull[-1]] - values[hull[-2]], value - values[hull[-2]]
            if one[0] * other[1] - one[1] * other[0] > 0:
                break
            hull.pop()
        hull.append(i)
    return [(i, j) for i, j in pairwise(hull) if j > i + 1]


def next_targets(gaps: Sequence[Gap], values: Float[np.ndarray, "points 2"], points: int) -> list[Target]:
    """Return where points go next, those first that add the most; none where there are enough, and no others add any.

    First all that are missing are shared out among the gaps: of each gap the place that adds the most. The first one
    comes next; where that leads changes the others. Then come all the places of the best subset of points and places,
    where each place has to add enough.
    """
    if not gaps:
        return []
    missing = points - len(values)
    targets = _missing_targets(gaps, missing) if missing > 0 else _replacements(gaps, values, points)
    return sorted(targets, key=lambda target: -target.gain)


def _missing_targets(gaps: Sequence[Gap], missing: int) -> list[Target]:
    """Return the best place in every gap for so many points, shared out one by one to where each adds the most."""
    totals, full = np.zeros(len(gaps), dtype=int), OPTIONS.places + 2
    gains = np.array([gap.subsets.volume(3) for gap in gaps])
    for _ in range(missing):
        k = int(np.argmax(gains))
        totals[k] += 1
        points, more = (min(2 + int(totals[k]) + extra, full) for extra in (0, 1))
        gains[k] = gaps[k].subsets.volume(more) - gaps[k].subsets.volume(points)
    return [
        _best_target(gap, i, gap.subsets.rows(min(2 + int(totals[i]), full))[1:-1])
        for i, gap in enumerate(gaps)
        if totals[i]
    ]


def _best_target(gap: Gap, index: int, rows: Int[np.ndarray, " rows"]) -> Target:
    gains = (gap.places[-1, 0] - gap.places[rows, 0]) * (gap.places[0, 1] - gap.places[rows, 1])
    best = int(np.argmax(gains))
    return Target(gap=index, values=gap.places[rows[best]], gain=float(gains[best]))


def _candidates(
    gaps: Sequence[Gap], values: Float[np.ndarray, "points 2"]
) -> tuple[Float[np.ndarray, "candidates 2"], Int[np.ndarray, " candidates"]]:
    """Return those of the points and places that no other dominates, in order, and the gap of each: −1 of a point."""
    step = -(-OPTIONS.places * len(gaps) // OPTIONS.total)
    inner = [gap.places[1 + step // 2 : -1 : step] for gap in gaps]
    owners = np.concatenate([np.full(len(values), -1), *(np.full(len(each), i) for i, each in enumerate(inner))])
    places = np.concatenate([values, *inner])
    order = np.lexsort((places[:, 1], places[:, 0]))
    lowest = np.minimum.accumulate(np.append(np.inf, places[order, 1]))[:-1]
    order = order[places[order, 1] < lowest]
    return places[order], owners[order]


def _replacements(gaps: Sequence[Gap], values: Float[np.ndarray, "points 2"], points: int) -> list[Target]:
    """Return the places among the best of points and places."""
    candidates, owners = _candidates(gaps, values)
    enough = OPTIONS.gain * sum(gap.area for gap in gaps)
    chosen = best_rows(candidates, points, np.where(owners >= 0, enough, 0.0))
    return [
        Target(
            gap=int(owners[row]),
            values=candidates[row],
            gain=float((candidates[after, 0] - candidates[row, 0]) * (candidates[before, 1] - candidates[row, 1])),
        )
        for before, row, after in zip(chosen[:-2], chosen[1:-1], chosen[2:], strict=True)
        if owners[row] >= 0
    ]
