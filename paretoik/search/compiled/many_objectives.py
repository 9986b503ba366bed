"""MaxiMin survival of three and more objectives, compiled: what ``search/maximin`` does.

``F`` is (objectives, points), minimised; a point with inf has failed.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled
from paretoik.search.compiled.two_objectives import RANGE_TOLERANCE

AXIS_WEIGHT = 1e6  # of the other objectives in the achievement function along an axis


@compiled
def rank_points(F, rank, spare):
    """Write the non-domination rank of every point, failed ones beyond all, for any number of objectives."""
    total = F.shape[1]
    for k in range(total):
        rank[k] = total
    current, size = 0, 1
    while size > 0:
        size = 0
        for i in range(total):
            if rank[i] == total and F[0, i] < np.inf and not _is_dominated(F, rank, i):
                spare[size] = i
                size += 1
        for k in range(size):
            rank[spare[k]] = current
        current += 1


@compiled
def _is_dominated(F, rank, i):
    """Return whether a point without rank dominates point i."""
    objectives, total = F.shape
    for j in range(total):
        if rank[j] < total or not F[0, j] < np.inf:
            continue
        no_worse, better = True, False
        for m in range(objectives):
            no_worse = no_worse and F[m, j] <= F[m, i]
            better = better or F[m, j] < F[m, i]
        if no_worse and better:
            return True
    return False


@compiled
def select_by_distance(F, rank, capacity, chosen, distance, Z, nearest, members, begins, chosen_Z):
    """Choose ``capacity`` points rank by rank, of each always the one farthest from all chosen; return how many.

    Write their numbers and squared insertion distances; failed points are not chosen.
    """
    objectives, total = F.shape
    _normalise(F, rank, Z)
    _group_by_rank(rank, members, begins)
    count, first, current = 0, 0, 0
    while count < capacity and current < total and begins[current] > first:
        size = begins[current] - first
        group = members[first : first + size]
        for i in range(size):
            nearest[i] = _distance_to_chosen(chosen_Z, count, Z, group[i])
        places = min(size, capacity - count)
        started = _choose_extremes(Z, group, places, chosen, distance, nearest) if current == 0 else 0
        for k in range(count + started, count + places):
            best = 0
            for i in range(1, size):
                if nearest[i] > nearest[best]:
                    best = i
            chosen[k], distance[k] = group[best], nearest[best]
            _update_nearest(Z, group, group[best], nearest)
            nearest[best] = -1.0  # below every distance: never again
        for k in range(count, count + places):
            for m in range(objectives):
                chosen_Z[m, k] = Z[m, chosen[k]]
        count += places
        first += size
        current += 1
    return count


@compiled
def _normalise(F, rank, Z):
    """Write objectives scaled by the ideal and nadir of the first rank."""
    objectives, total = F.shape
    for m in range(objectives):
        ideal, nadir = np.inf, -np.inf
        for k in range(total):
            if rank[k] == 0:
                ideal, nadir = min(ideal, F[m, k]), max(nadir, F[m, k])
        for k in range(total):
            scaled = nadir - ideal > RANGE_TOLERANCE and rank[k] < total
            Z[m, k] = (F[m, k] - ideal) / (nadir - ideal) if scaled else 0.0


@compiled
def _group_by_rank(rank, members, begins):
    """Write the points in order of their rank; ``begins[r]`` is then the end of rank r."""
    total = rank.shape[0]
    for k in range(total + 2):
        begins[k] = 0
    for k in range(total):
        begins[rank[k] + 1] += 1
    for k in range(total):
        begins[k + 1] += begins[k]
    for k in range(total):
        members[begins[rank[k]]] = k
        begins[rank[k]] += 1


@compiled
def _distance_to_chosen(chosen_Z, count, Z, point):
    """Return the squared distance of a point to the nearest chosen one."""
    smallest = np.inf
    for k in range(count):
        squared = 0.0
        for m in range(chosen_Z.shape[0]):
            squared += (chosen_Z[m, k] - Z[m, point]) ** 2
        smallest = min(smallest, squared)
    return smallest


@compiled
def _choose_extremes(Z, members, capacity, chosen, distance, nearest):
    """Choose the first points of the first rank: the minimisers of the achievement function along each axis."""
    objectives, count = Z.shape[0], 0
    for axis in range(objectives):
        best, smallest = -1, np.inf
        for i in range(members.shape[0]):
            achievement = -np.inf
            for m in range(objectives):
                value = Z[m, members[i]]
                achievement = max(achievement, value if m == axis else value * AXIS_WEIGHT)
            if best < 0 or achievement < smallest:
                best, smallest = i, achievement
        if nearest[best] >= 0.0 and count < capacity:
            chosen[count], distance[count] = members[best], np.inf
            _update_nearest(Z, members, members[best], nearest)
            nearest[best] = -1.0
            count += 1
    return count


@compiled
def _update_nearest(Z, members, point, nearest):
    """Update the distances of the members of a rank to the nearest chosen point, after this one was chosen."""
    for i in range(members.shape[0]):
        squared = 0.0
        for m in range(Z.shape[0]):
            squared += (Z[m, members[i]] - Z[m, point]) ** 2
        nearest[i] = min(nearest[i], squared)
