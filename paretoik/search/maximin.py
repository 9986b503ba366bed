"""MaxiMin survival: fill by rank, and within a rank always take the point farthest from all selected ones.

Distances are Euclidean in objectives normalised by the ideal and nadir of the feasible first rank (selection: Marcos et
al. 2012). The distance at which a point is selected is its insertion distance; the starting points have inf. It depends
on the order: on an evenly spaced front the half that is selected first has twice the distance of the other half.
Tournaments therefore compare the spacing: the sum of a survivor's distances to its n_obj nearest neighbours of the same
rank. MaxiMin gives an even spread at low cost; it does not maximise hypervolume. Above five objectives almost every
point is non-dominated and distances mean little: use NSGA-III, or limit the region with ``ranges``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from moocore import pareto_rank
from numpy.typing import ArrayLike
from pymoo.core.population import Population
from pymoo.core.survival import Survival

from paretoik.arrays import Ids, Mask, Values
from paretoik.errors import InvalidInput
from paretoik.inputs import finite_number, real_array, shown
from paretoik.search.objectives import EQUALITY_TOLERANCE, TOLERANCE, Floats, Integers, check_tolerance, violations
from paretoik.tables import html_representation

# MaxiMin's insertion order of the points of one front, and the insertion distances. Objectives are normalised and
# minimised; ``Z`` is (points, n_obj). Ties go to the lower index.


@dataclass(frozen=True, kw_only=True)
class InsertionOptions:
    """Sizes that decide how the insertion order is computed; all results are identical."""

    matrix_limit: int = 1024  # number of points up to which all pairwise distances are computed at once (8 MB)
    fewest_split: int = 192  # number of points from which splitting is faster than the greedy loop (measured)
    levels: int = 16  # levels of splitting; a front without a tail needs about 1.5 log2(points)


OPTIONS = InsertionOptions()


def scaled(F: Floats, ideal: Floats, nadir: Floats) -> Floats:
    """Return objectives (points, n_obj) scaled so that ideal is 0 and nadir 1; axes without range are 0."""
    width = nadir - ideal
    usable = np.isfinite(width) & (width > np.finfo(float).tiny)
    with np.errstate(over="ignore"):
        Z = np.where(usable, (F - ideal) / np.where(usable, width, 1.0), 0.0)
    return np.clip(Z, -1e100, 1e100)  # squares must not overflow


def starting_points(Z: Floats) -> list[int]:
    """Return the positions of the points that the selection starts from.

    Up to two objectives: the minimiser of each. Three and more: the minimiser of the achievement function along each
    axis, max_j z_j / w_j with w = 1 on the axis and 1e-6 off it; minimisers of objectives would be near-duplicates.
    """
    n_obj = Z.shape[1]
    if n_obj == 1:
        return [int(np.argmin(Z[:, 0]))]
    if n_obj == 2:  # the other objective decides between equals
        starts = [int(np.lexsort((Z[:, 1 - axis], Z[:, axis]))[0]) for axis in range(2)]
    else:
        weights = np.where(np.eye(n_obj, dtype=bool), 1.0, 1e-6)
        starts = [int(np.argmin((Z / weight).max(axis=1))) for weight in weights]
    return list(dict.fromkeys(starts))


def squared_distances(Z: Floats, others: Floats) -> Floats:
    """Return squared distances (points, others), summed axis by axis so that all methods round alike."""
    total: Floats = (Z[:, 0, None] - others[None, :, 0]) ** 2
    for axis in range(1, Z.shape[1]):
        total += (Z[:, axis, None] - others[None, :, axis]) ** 2
    return total


def nearest_squared(Z: Floats, others: Floats) -> Floats:
    """Return squared distances (points,) to the nearest of ``others``, in blocks of bounded memory."""
    nearest = np.full(len(Z), np.inf)
    step = max(1, 1_000_000 // max(1, len(Z)))
    for first in range(0, len(others), step):
        np.minimum(nearest, squared_distances(Z, others[first : first + step]).min(axis=1), out=nearest)
    return nearest


def neighbour_distances(Z: Floats, groups: Integers, count: int) -> Floats:
    """Return each point's sum of distances to the ``count`` nearest of its group; inf if there are fewer.

    ``groups`` (points,) are labels. The sums are computed in blocks of bounded memory.
    """
    if len(Z) <= count:
        return np.full(len(Z), np.inf)
    sums = np.empty(len(Z))
    step = max(1, 1_000_000 // len(Z))
    for first in range(0, len(Z), step):
        rows = np.arange(first, min(first + step, len(Z)))
        squared = squared_distances(Z[rows], Z)
        squared[groups[rows, None] != groups] = np.inf
        squared[np.arange(len(rows)), rows] = np.inf  # a point is not its own neighbour
        nearest = np.partition(squared, count - 1, axis=1)[:, :count]
        sums[rows] = np.sqrt(nearest).sum(axis=1)
    return sums


def greedy_order(Z: Floats, count: int, nearest: Floats, starts: Sequence[int] = ()) -> tuple[Integers, Floats]:
    """Select ``count`` of the mutually non-dominated points ``Z``, always the one farthest from all selected.

    ``nearest`` (points,) are squared distances to points selected before (inf if there are none); positions in
    ``starts`` come first. Returns positions in order of selection and squared insertion distances.
    """
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
        nearest[chosen] = -1.0  # below every distance: never selected again
    return order, distance


def front_order(Z: Floats, count: int, nearest: Floats, starts: Sequence[int] = ()) -> tuple[Integers, Floats]:
    """Return the result of ``greedy_order``, bit for bit, for two objectives; same arguments.

    On a sorted front a point's distance depends only on the selected neighbours on both sides. Therefore the farthest
    point of a segment depends only on this segment, and all segments are split at once, level by level. A point's value
    never exceeds that of its parent, the point that split its segment. If both are equal, the child has the higher
    index. Therefore the greedy order is that by value, then by index.
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
        threshold = np.partition(value, size - count)[size - count]  # -1 until ``count`` points have a value
        keep = (remaining != split) & (near >= threshold)
        segment = (2 * split + (remaining > split))[keep]
        remaining, near = remaining[keep], near[keep]
    if remaining.size:  # a geometric tail loses one point per level: the greedy loop is faster
        tail = np.sort(path[remaining])
        near = near[np.argsort(path[remaining])]
        order, distance = greedy_order(Z[tail], min(count, tail.size), near)
        value[place[tail[order]]] = distance
    by_index = value[place]
    order = np.lexsort((np.arange(size), -by_index))
    order = np.concatenate((np.asarray(starts, dtype=np.int64), order[len(starts) :]))[:count]
    return order, by_index[order]


# MaxiMin survival of a population.


@dataclass(frozen=True, eq=False)
class Survivors:
    """The survivors, best first; feasible ones come before the others.

    distance: insertion distances
    normalised: normalised objectives of the feasible survivors
    is_beyond: mask of feasible survivors beyond ``ranges``
    """

    index: Ids
    rank: Ids
    distance: Values
    normalised: Float[np.ndarray, "feasible n_obj"]
    is_beyond: Bool[np.ndarray, " feasible"]

    @cached_property
    def spacing(self) -> Values:
        """Sum of distances (survivors,) to the n_obj nearest survivors of the same rank, computed at first use.

        It is inf if there are fewer neighbours or the point is the best of its rank in an objective, and 0 if the point
        is beyond ``ranges`` or infeasible.
        """
        Z, ranks = self.normalised, self.rank[: len(self.normalised)]
        spacing = np.zeros(len(self.index))
        spacing[: len(Z)] = neighbour_distances(Z, ranks, Z.shape[1])
        for rank in np.unique(ranks):
            members = np.flatnonzero(ranks == rank)
            spacing[members[Z[members].argmin(axis=0)]] = np.inf
        spacing[: len(Z)][self.is_beyond] = 0.0
        return spacing


def survivors(
    F: Floats,
    violation: Floats,
    count: int,
    *,
    ranges: Floats | None = None,
    infeasible_share: float = 0.0,
    species: Integers | None = None,
) -> Survivors:
    """Select ``count`` of the points with objectives ``F`` (points, n_obj) and ``violation`` (points,).

    Feasible points (violation 0) come first, by rank and then MaxiMin; the others follow, least violation first,
    violation inf last.

    ranges: (2, n_obj) lower and upper side of a box that replaces ideal and nadir; points beyond its upper side are
        inserted after those below
    infeasible_share: largest share of places for the least-violating infeasible points that no feasible one dominates
    species: labels (points,); up to half of the places are shared evenly by the best of each feasible species
    """
    count = min(count, len(F))
    feasible = np.flatnonzero(violation <= 0.0)
    others = np.flatnonzero(violation > 0.0)
    others = others[np.argsort(violation[others], kind="stable")]
    ranks = pareto_rank(F[feasible]) if feasible.size else np.empty(0, dtype=np.int64)
    reserved = others[:0]
    if infeasible_share > 0.0 and feasible.size:
        candidates = others[np.isfinite(violation[others])]
        front = F[feasible[ranks == 0]]
        nondominated = ~dominates(front[None], F[candidates][:, None]).any(axis=1)
        reserved = candidates[nondominated][: int(infeasible_share * count)]
    places = min(feasible.size, count - reserved.size)
    # feasible points' objectives scaled by their first rank or ``ranges``, and a mask of points beyond ``ranges``
    values = F[feasible]
    Z, is_beyond = values, np.zeros(len(values), dtype=bool)
    if len(values):
        first = values[ranks == 0]
        ideal, nadir = (first.min(axis=0), first.max(axis=0)) if ranges is None else (ranges[0], ranges[1])
        is_beyond = np.zeros(len(values), dtype=bool) if ranges is None else np.less(nadir, values).any(axis=1)
        Z = scaled(values, ideal, nadir)
    chosen, distance = _by_maximin(Z, ranks, is_beyond, places)
    if species is not None and places:
        chosen, distance = _with_species(chosen, distance, ranks, species[feasible])
    infeasible = np.concatenate((reserved, others[~np.isin(others, reserved)]))[: count - places]
    worst = int(ranks.max(initial=-1)) + 1
    return Survivors(
        index=np.concatenate((feasible[chosen], infeasible)),
        rank=np.concatenate((ranks[chosen], worst + np.arange(infeasible.size))),
        distance=np.concatenate((distance, np.zeros(infeasible.size))),
        normalised=Z[chosen],
        is_beyond=is_beyond[chosen],
    )


def _by_maximin(Z: Floats, ranks: Integers, is_beyond: Mask, count: int) -> tuple[Integers, Floats]:
    """Return positions and insertion distances of ``count`` feasible points in order of selection."""
    if count == 0:
        return np.empty(0, dtype=np.int64), np.empty(0)
    nearest = np.full(len(Z), np.inf)
    positions: list[Integers] = []
    distances: list[Floats] = []
    groups = 2 * ranks + is_beyond
    for group in np.unique(groups):
        members = np.flatnonzero(groups == group)
        places = min(count, members.size)
        starts = [] if positions else starting_points(Z[members])[:places]
        fast = Z.shape[1] == 2 and members.size >= OPTIONS.fewest_split
        order, squared = (front_order if fast else greedy_order)(Z[members], places, nearest[members], starts)
        positions.append(members[order])
        distances.append(np.sqrt(squared))
        count -= places
        if count == 0:
            break
        later = np.flatnonzero(groups > group)
        nearest[later] = np.minimum(nearest[later], nearest_squared(Z[later], Z[positions[-1]]))
    return np.concatenate(positions), np.concatenate(distances)


def _with_species(chosen: Integers, distance: Floats, ranks: Integers, species: Integers) -> tuple[Integers, Floats]:
    """Return the choice, changed so that rare species have places.

    All species share half of the places equally. The best points of rare species replace those points of abundant
    species that were chosen last.
    """
    quota = chosen.size // 2
    best_first = np.lexsort((np.arange(len(ranks)), ranks))
    labels = list(dict.fromkeys(species[best_first].tolist()))
    floor = max(1, quota // len(labels))
    counts = {label: int((species[chosen] == label).sum()) for label in labels}
    absent = best_first[~np.isin(best_first, chosen)]
    added: list[int] = []
    for label in labels[: quota // floor]:
        added += absent[species[absent] == label].tolist()[: max(0, floor - counts[label])]
    stays = np.ones(chosen.size, dtype=bool)
    excess = len(added)
    for position in range(chosen.size - 1, -1, -1):
        label = int(species[chosen[position]])
        if excess and counts[label] > floor:
            counts[label] -= 1
            stays[position] = False
            excess -= 1
    added = added[: len(added) - excess]
    order = np.concatenate((chosen[stays], np.asarray(added, dtype=np.int64)))
    return order, np.concatenate((distance[stays], np.zeros(len(added))))


class MaxiMin(Survival):  # type: ignore[misc]  # pymoo has no types
    """MaxiMin as a pymoo survival, for any pymoo problem and genetic algorithm: ``NSGA2(survival=MaxiMin())``.

    If the problem has ``species(X) -> (points,)``, the best of each feasible species survive. Individuals get "rank",
    "crowding" (their spacing), "insertion_distance" and CV, which is inf if an objective is not finite or a constraint
    is NaN.

    - ``ranges``: box of interest (lower, upper), each side one number per objective; points beyond its upper side, such
      as a long steep tail, are chosen last
    - ``infeasible_share``: largest share of infeasible survivors, those with the least violation
    - ``tolerance``: largest G of a feasible point, one number or one per constraint
    - ``equality_tolerance``: largest |H| of a feasible point, one number or one per constraint

    Raises InvalidInput for an invalid setting.
    """

    def __init__(
        self,
        *,
        ranges: ArrayLike | None = None,
        infeasible_share: float = 0.0,
        tolerance: ArrayLike = TOLERANCE,
        equality_tolerance: ArrayLike = EQUALITY_TOLERANCE,
    ) -> None:
        super().__init__(filter_infeasible=False)
        check_infeasible_share(infeasible_share)
        check_tolerance("tolerance", tolerance)
        check_tolerance("equality_tolerance", equality_tolerance)
        box = None if ranges is None else real_array("ranges", ranges)
        if box is not None and (
            box.ndim != 2 or len(box) != 2 or not np.isfinite(box).all() or (box[0] > box[1]).any()
        ):
            raise InvalidInput(f"ranges must be finite (lower, upper) with lower <= upper, got {shown(box.tolist())}")
        self.ranges = box
        self.infeasible_share = infeasible_share
        self.tolerance = tolerance
        self.equality_tolerance = equality_tolerance

    def __repr__(self) -> str:
        return "MaxiMin()" if self.ranges is None else f"MaxiMin(ranges={self.ranges.tolist()})"

    _repr_html_ = html_representation

    def _do(self, problem: Any, pop: Any, *args: Any, n_survive: int, **kwargs: Any) -> Any:
        if self.ranges is not None and self.ranges.shape[1] != problem.n_obj:
            raise InvalidInput(f"ranges must have {problem.n_obj} columns (objectives), got {self.ranges.shape[1]}")
        F = column(pop, "F")
        G = column(pop, "G") if problem.n_ieq_constr else None
        H = column(pop, "H") if problem.n_eq_constr else None
        violation = violations(F, G, H, tolerance=self.tolerance, equality_tolerance=self.equality_tolerance)
        species = problem.species(column(pop, "X")) if hasattr(problem, "species") else None
        selected = survivors(
            F, violation, n_survive, ranges=self.ranges, infeasible_share=self.infeasible_share, species=species
        )
        for individual, value in zip(pop, violation, strict=True):
            individual.CV = np.array([value])
        population = pop[selected.index]
        values = (selected.rank.tolist(), selected.spacing.tolist(), selected.distance.tolist())
        for individual, rank, spacing, distance in zip(population, *values, strict=True):
            individual.data |= {"rank": rank, "crowding": spacing, "insertion_distance": distance}
        return Population(population)


def check_infeasible_share(share: object) -> None:
    """Raise InvalidInput unless ``share`` is at least 0 and below 1."""
    if not 0.0 <= finite_number("infeasible_share", share) < 1.0:
        raise InvalidInput(f"infeasible_share must be at least 0 and below 1, got {shown(share)}")


def dominates(F: Floats, other: Floats) -> np.ndarray:
    """Return a mask of the points ``F`` (..., n_obj) that dominate ``other``."""
    mask: np.ndarray = np.less_equal(F, other).all(axis=-1) & np.less(F, other).any(axis=-1)
    return mask


def column(pop: Any, name: str) -> Floats:
    """Return an attribute (X, F, G, H or CV) of pymoo's individuals as an array, faster than ``pop.get``."""
    return np.array([getattr(individual, name) for individual in pop], dtype=float)
