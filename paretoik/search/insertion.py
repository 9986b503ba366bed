"""The order in which MaxiMin inserts the points of one front, and the distances at which it does.

All objectives here are normalised and minimised; ``Z`` is (points, n_obj). Ties go to the lower index.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paretoik.search.constraints import Floats, Integers


@dataclass(frozen=True, kw_only=True)
class InsertionOptions:
    """When which way of computing the order of insertion is used; all give the same bits."""

    matrix_limit: int = 1024  # points up to which all pairwise distances are computed at once (8 MB)
    fewest_split: int = 192  # points from which splitting segments overtakes the greedy loop (measured)
    levels: int = 16  # of segments split; a front without a tail needs about 1.5 log2(points)


OPTIONS = InsertionOptions()


def scaled(F: Floats, ideal: Floats, nadir: Floats) -> Floats:
    """Map objectives (points, n_obj) so that ideal is 0 and nadir 1; an axis without range becomes 0."""
    width = nadir - ideal
    usable = np.isfinite(width) & (width > np.finfo(float).tiny)
    with np.errstate(over="ignore"):
        Z = np.where(usable, (F - ideal) / np.where(usable, width, 1.0), 0.0)
    return np.clip(Z, -1e100, 1e100)  # squares must not overflow


def starting_points(Z: Floats) -> list[int]:
    """Positions of the points that the selection starts from.

    Up to two objectives: the minimiser of each. Three and more: the minimiser of the achievement function along each
    axis, max_j z_j / w_j with w = 1 on the axis and 1e-6 off it; axis minimisers would be near-duplicates there.
    """
    n_obj = Z.shape[1]
    if n_obj == 1:
        return [int(np.argmin(Z[:, 0]))]
    if n_obj == 2:  # among equals the other objective decides
        starts = [int(np.lexsort((Z[:, 1 - axis], Z[:, axis]))[0]) for axis in range(2)]
    else:
        weights = np.where(np.eye(n_obj, dtype=bool), 1.0, 1e-6)
        starts = [int(np.argmin((Z / weight).max(axis=1))) for weight in weights]
    return list(dict.fromkeys(starts))


def squared_distances(Z: Floats, others: Floats) -> Floats:
    """Squared distances (points, others), summed axis by axis so that every method here rounds alike."""
    total: Floats = (Z[:, 0, None] - others[None, :, 0]) ** 2
    for axis in range(1, Z.shape[1]):
        total += (Z[:, axis, None] - others[None, :, axis]) ** 2
    return total


def nearest_squared(Z: Floats, others: Floats) -> Floats:
    """Squared distance (points,) of each point to the nearest of ``others``, in blocks of bounded memory."""
    nearest = np.full(len(Z), np.inf)
    step = max(1, 1_000_000 // max(1, len(Z)))
    for first in range(0, len(others), step):
        np.minimum(nearest, squared_distances(Z, others[first : first + step]).min(axis=1), out=nearest)
    return nearest


def neighbour_distances(Z: Floats, groups: Integers, count: int) -> Floats:
    """Sum (points,) of each point's distances to the ``count`` nearest of its group; inf where there are fewer.

    ``groups`` (points,) are labels. Computed in blocks of bounded memory.
    """
    if len(Z) <= count:
        return np.full(len(Z), np.inf)
    sums = np.empty(len(Z))
    step = max(1, 1_000_000 // len(Z))
    for first in range(0, len(Z), step):
        rows = np.arange(first, min(first + step, len(Z)))
        squared = squared_distances(Z[rows], Z)
        squared[groups[rows, None] != groups] = np.inf
        squared[np.arange(len(rows)), rows] = np.inf  # no neighbour of itself
        nearest = np.partition(squared, count - 1, axis=1)[:, :count]
        sums[rows] = np.sqrt(nearest).sum(axis=1)
    return sums


def insertion_order(Z: Floats, count: int, nearest: Floats, starts: Sequence[int] = ()) -> tuple[Integers, Floats]:
    """Select ``count`` of the mutually non-dominated points ``Z``, always the one farthest from all selected.

    ``nearest`` (points,) is each point's squared distance to what was selected before (inf where nothing was); the
    positions in ``starts`` come first. Returns positions in order of selection and squared insertion distances.
    """
    fast = Z.shape[1] == 2 and len(Z) >= OPTIONS.fewest_split
    return (front_order if fast else greedy_order)(Z, count, nearest, starts)


def greedy_order(Z: Floats, count: int, nearest: Floats, starts: Sequence[int] = ()) -> tuple[Integers, Floats]:
    """Select one by one, for any number of objectives; arguments as for ``insertion_order``."""
    nearest = nearest.copy()
    nearest[list(starts)] = np.inf
    matrix = squared_distances(Z, Z) if len(Z) <= OPTIONS.matrix_limit else None
    order = np.empty(count, dtype=np.int64)
    distance = np.empty(count)
    for step in range(count):
        chosen = starts[step] if step < len(starts) else int(nearest.argmax())
        order[step], distance[step] = chosen, np.inf if step < len(starts) else nearest[chosen]
        row = matrix[chosen] if matrix is not None else squared_distances(Z, Z[chosen : chosen + 1])[:, 0]
        np.minimum(nearest, row, out=nearest)
        nearest[chosen] = -1.0  # below every distance: never again
    return order, distance


def front_order(Z: Floats, count: int, nearest: Floats, starts: Sequence[int] = ()) -> tuple[Integers, Floats]:
    """Select as ``greedy_order`` does, bit for bit, on a two-objective front; arguments as for ``insertion_order``.

    Along a sorted front only the selected neighbour on either side matters, so the farthest point of a segment depends
    on that segment alone, and all segments are split at once, level by level. A value never exceeds its parent's, and a
    child tied with its parent was tied already, with a higher index, when the parent was taken: so sorting by value,
    then index, is the greedy order.
    """
    size = len(Z)
    path = np.lexsort((-Z[:, 1], Z[:, 0]))
    place = np.empty(size, dtype=np.int64)
    place[path] = np.arange(size)
    x, y, near = Z[path, 0], Z[path, 1], nearest[path]
    value = np.full(size, -1.0)  # squared insertion distance along the path
    segment = np.zeros(size, dtype=np.int64)
    for start in place[list(starts)]:
        value[start] = np.inf
        segment += np.arange(size) > start
        near = np.minimum(near, (x - x[start]) ** 2 + (y - y[start]) ** 2)
    remaining = np.flatnonzero(value < 0)
    near, segment = near[remaining], segment[remaining]
    for _ in range(OPTIONS.levels):
        if not remaining.size:
            break
        first = np.flatnonzero(np.diff(segment, prepend=-1))
        lengths = np.diff(first, append=remaining.size)
        best = np.maximum.reduceat(near, first)
        tied = np.where(near == np.repeat(best, lengths), path[remaining], size)
        chosen = place[np.minimum.reduceat(tied, first)]
        value[chosen] = best
        split = np.repeat(chosen, lengths)
        near = np.minimum(near, (x[remaining] - x[split]) ** 2 + (y[remaining] - y[split]) ** 2)
        threshold = np.partition(value, size - count)[size - count]  # -1 until so many have a value
        keep = (remaining != split) & (near >= threshold)
        segment = (2 * split + (remaining > split))[keep]
        remaining, near = remaining[keep], near[keep]
    if remaining.size:  # a geometric tail peels off one point a level: the greedy loop is the faster there
        tail = np.sort(path[remaining])
        near = near[np.argsort(path[remaining])]
        order, distance = greedy_order(Z[tail], min(count, tail.size), near)
        value[place[tail[order]]] = distance
    by_index = value[place]
    order = np.lexsort((np.arange(size), -by_index))
    order = np.concatenate((np.asarray(starts, dtype=np.int64), order[len(starts) :]))[:count]
    return order, by_index[order]
