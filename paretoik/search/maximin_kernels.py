"""MaxiMin survival, compiled: the algorithm of ``search/maximin`` on arrays that are allocated once.

With two objectives, parents stay sorted by the first. If they are mutually non-dominated, children that one of them
dominates are left out. The second part of the file is for three and more objectives.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation.numba_cache import compiled
from paretoik.search.sorted_points import ONE, ZERO

RANGE_TOLERANCE = 2.2250738585072014e-308  # an objective with a smaller range has no weight in distances


@compiled
def select_by_rank(count, capacity, s):
    """Select ``capacity`` of ``count`` sorted points: whole ranks, then the farthest points of the last rank.

    ``s`` is the workspace of the selection: points, objectives in ``values``, and ``rank``; the selected points go to
    ``front`` and ``objectives``. ``fitness`` falls with the rank; within the last rank it grows with the insertion
    distance.
    """
    rank, values, points, front, objectives = s.rank, s.values, s.points, s.front, s.objectives
    fitness, sizes, nearest, members = s.fitness, s.begins, s.nearest, s.spare
    for k in range(count + 1):
        sizes[k] = 0
    for k in range(count):
        sizes[rank[k]] += 1
    split, places = 0, capacity
    while split < count and places >= sizes[split]:
        places -= sizes[split]
        split += 1
    first, last = -1, -1
    for k in range(count):
        if rank[k] == 0:
            first, last = (k if first < 0 else first), k
    x_scale = _inverse_range(values[0, last] - values[0, first])
    y_scale = _inverse_range(values[1, first] - values[1, last])
    size = 0
    for k in range(count):
        members[size] = k
        size += np.int64(rank[k] == split)
    if split < count and places > 0:
        _distances_to_better_ranks(values, count, rank, split, members, size, x_scale, y_scale, nearest)
        for i in range(size):
            s.x[i], s.y[i] = values[0, members[i]], values[1, members[i]]
        _insert_members(s.x, s.y, x_scale, y_scale, size, nearest, s.distance, s.stack)
        # mark the members of a rank that are inserted first, and write their fitness
        distance = s.distance
        smallest = quickselect(distance, size, size - places, s.x, s.y)
        ties = places
        for i in range(size):
            ties -= np.int64(distance[i] > smallest)
        for i in range(size):
            if distance[i] > smallest or (distance[i] == smallest and ties > 0):
                ties -= np.int64(distance[i] == smallest)
                rank[members[i]] = -1
                share = distance[i] / (2.0 * (1.0 + distance[i])) if distance[i] < np.inf else 0.5
                fitness[members[i]] = share - split
    for i in range(places if split == count else 0):  # failed points fill the remaining places
        rank[members[i]], fitness[members[i]] = -1, -split
    position = 0
    for k in range(count):
        front[position], objectives[0, position], objectives[1, position] = points[k], values[0, k], values[1, k]
        fitness[position] = fitness[k] if rank[k] == -1 else -np.float64(rank[k])
        position += np.int64(rank[k] < split)


@compiled
def _inverse_range(width):
    return 1.0 / width if width > RANGE_TOLERANCE else 0.0


@compiled
def _insert_members(x, y, x_scale, y_scale, size, nearest, distance, stack):
    """Write the squared insertion distance of each member of a sorted rank.

    ``nearest`` are the squared distances to points of better ranks. In a segment between inserted members the farthest
    member is inserted next; the rest of the front has no influence.
    """
    stack[0, 0], stack[0, 1] = 0, size
    segments = 1
    while segments > 0:
        segments -= 1
        begin, end = stack[segments, 0], stack[segments, 1]
        best, largest = begin, nearest[begin]
        for i in range(begin + 1, end):
            if nearest[i] > largest:
                best, largest = i, nearest[i]
        distance[best] = largest
        if not largest > 0.0:  # copies of inserted points
            for i in range(begin, end):
                distance[i] = largest
            continue
        x0, y0 = x[best], y[best]
        for i in range(begin, end):
            dx, dy = (x[i] - x0) * x_scale, (y[i] - y0) * y_scale
            squared = dx * dx + dy * dy
            nearest[i] = squared if squared < nearest[i] else nearest[i]
        stack[segments, 0], stack[segments, 1] = begin, best
        segments += np.int64(best > begin)
        stack[segments, 0], stack[segments, 1] = best + 1, end
        segments += np.int64(end > best + 1)


@compiled
def _distances_to_better_ranks(values, count, rank, split, members, size, x_scale, y_scale, nearest):
    """Write the squared distance of each member of a rank to the nearest point of a better rank.

    Points are sorted by the first objective: the search on each side ends if that objective alone is farther.
    """
    for i in range(size):
        member, smallest = members[i], np.inf
        x, y = values[0, member], values[1, member]
        if i > 0 and x == values[0, members[i - 1]] and y == values[1, members[i - 1]]:  # a copy
            nearest[i] = nearest[i - 1]
            continue
        for direction in (-1, 1):
            k = member + direction
            while 0 <= k < count:
                squared = ((values[0, k] - x) * x_scale) ** 2
                if squared >= smallest:
                    break
                if rank[k] < split:
                    smallest = min(smallest, squared + ((values[1, k] - y) * y_scale) ** 2)
                k += direction
        nearest[i] = smallest


@compiled
def insertion_distances(objectives, count, x, y, distance, queue):
    """Write MaxiMin's squared insertion distance of each point of a sorted front; its ends have inf.

    In a segment between two inserted points, the next one is farthest from the nearer of the two. The distance to
    either is monotonic along the front, so that bisection finds it. Segments wait in a queue and are independent, so
    that a processor can work on several.
    """
    first, second = objectives[0], objectives[1]
    x_scale, y_scale = _inverse_range(first[count - 1] - first[0]), _inverse_range(second[0] - second[count - 1])
    ideal_x, ideal_y = first[0], second[count - 1]
    for k in range(count):
        x[k] = (first[k] - ideal_x) * x_scale
        y[k] = (second[k] - ideal_y) * y_scale
    distance[0] = distance[count - 1] = np.inf
    queue[0, 0], queue[0, 1] = 0, count - 1
    taken, segments = ZERO, np.uint64(count > 2)
    while taken < segments:
        begin, end = np.uint64(queue[taken, 0]), np.uint64(queue[taken, 1])
        taken += ONE
        x0, y0, x1, y1 = x[begin], y[begin], x[end], y[end]
        # the first point that is not nearer to the beginning than to the end
        low, length = begin + ONE, end - begin - ONE
        while length > ONE:
            half = length >> ONE
            u, v = x[low + half - ONE], y[low + half - ONE]
            is_nearer = np.uint64((u - x0) ** 2 + (v - y0) ** 2 < (x1 - u) ** 2 + (y1 - v) ** 2)
            low += half >> ((ONE - is_nearer) << np.uint64(5))  # half or 0: a product would become a branch
            length -= half
        best, other = _distance_to_ends(x, y, low, begin, end), _distance_to_ends(x, y, low - ONE, begin, end)
        chosen = low - np.uint64((other >= best) & (low - ONE > begin))
        distance[chosen] = max(best, other)  # the distance of an end is 0
        queue[segments, 0], queue[segments, 1] = np.int64(begin), np.int64(chosen)
        segments += np.uint64(chosen - begin > ONE)
        queue[segments, 0], queue[segments, 1] = np.int64(chosen), np.int64(end)
        segments += np.uint64(end - chosen > ONE)


@compiled
def _distance_to_ends(x, y, k, begin, end):
    """Return the squared distance of a point to the nearer end of a segment."""
    to_begin = (x[k] - x[begin]) ** 2 + (y[k] - y[begin]) ** 2
    to_end = (x[end] - x[k]) ** 2 + (y[end] - y[k]) ** 2
    return min(to_begin, to_end)


@compiled
def quickselect(values, count, index, spare, other):
    """Return the value at ``index`` of the sorted ``values`` (Hoare's selection without branches)."""
    for k in range(count):
        spare[k] = values[k]
    while True:
        pivot = spare[count >> 1]
        below, above = 0, 0
        for k in range(count):
            value = spare[k]
            spare[below] = value
            below += np.int64(value < pivot)
            other[above] = value
            above += np.int64(value > pivot)
        if index < below:
            count = below
        elif index < count - above:
            return pivot
        else:
            index -= count - above
            count = above
            spare, other = other, spare


@compiled
def keep_farthest(front, objectives, distance, count, capacity, spare, other):
    """Keep the ``capacity`` points of a sorted front with the largest insertion distances, in their order."""
    if count == capacity:
        return
    smallest = quickselect(distance, count, count - capacity, spare, other)
    ties = capacity  # places for points tied with the last
    for k in range(count):
        ties -= np.int64(distance[k] > smallest)
    position = 0
    for k in range(count):
        tied = (distance[k] == smallest) & (ties > 0)
        keep = (distance[k] > smallest) | tied
        ties -= np.int64(tied)
        front[position], distance[position] = front[k], distance[k]
        objectives[0, position], objectives[1, position] = objectives[0, k], objectives[1, k]
        position += np.int64(keep)


# MaxiMin survival of three and more objectives, compiled. ``F`` is (objectives, points), minimised; a point with inf
# has failed.


@compiled
def rank_points(F, rank, spare):
    """Write the non-domination rank of every point; failed points come last. For any number of objectives."""
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
    """Return whether an unranked point dominates point i."""
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
    """Choose ``capacity`` points rank by rank, always the farthest from all chosen; return their number.

    Their indices and squared insertion distances are written; failed points are not chosen.
    """
    objectives, total = F.shape
    # objectives scaled by the ideal and nadir of the first rank
    for m in range(objectives):
        ideal, nadir = np.inf, -np.inf
        for k in range(total):
            if rank[k] == 0:
                ideal, nadir = min(ideal, F[m, k]), max(nadir, F[m, k])
        for k in range(total):
            scaled = nadir - ideal > RANGE_TOLERANCE and rank[k] < total
            Z[m, k] = (F[m, k] - ideal) / (nadir - ideal) if scaled else 0.0
    # the points sorted by rank; ``begins[r]`` is then the end of rank r
    for k in range(total + 2):
        begins[k] = 0
    for k in range(total):
        begins[rank[k] + 1] += 1
    for k in range(total):
        begins[k + 1] += begins[k]
    for k in range(total):
        members[begins[rank[k]]] = k
        begins[rank[k]] += 1
    count, first, current = 0, 0, 0
    while count < capacity and current < total and begins[current] > first:
        size = begins[current] - first
        group = members[first : first + size]
        for i in range(size):
            # the squared distance of a point to the nearest chosen one
            smallest = np.inf
            for k in range(count):
                squared = 0.0
                for m in range(chosen_Z.shape[0]):
                    squared += (chosen_Z[m, k] - Z[m, group[i]]) ** 2
                smallest = min(smallest, squared)
            nearest[i] = smallest
        places = min(size, capacity - count)
        started = _choose_extremes(Z, group, places, chosen, distance, nearest) if current == 0 else 0
        for k in range(count + started, count + places):
            best = 0
            for i in range(1, size):
                if nearest[i] > nearest[best]:
                    best = i
            chosen[k], distance[k] = group[best], nearest[best]
            _update_nearest(Z, group, group[best], nearest)
            nearest[best] = -1.0  # below every distance: never chosen again
        for k in range(count, count + places):
            for m in range(objectives):
                chosen_Z[m, k] = Z[m, chosen[k]]
        count += places
        first += size
        current += 1
    return count


@compiled
def _choose_extremes(Z, members, capacity, chosen, distance, nearest):
    """Choose the minimiser of each axis' achievement function, with weight 1e6 on other objectives."""
    objectives, count = Z.shape[0], 0
    for axis in range(objectives):
        best, smallest = -1, np.inf
        for i in range(members.shape[0]):
            achievement = -np.inf
            for m in range(objectives):
                value = Z[m, members[i]]
                achievement = max(achievement, value if m == axis else value * 1e6)
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
    """Update the distances of a rank's members to the nearest chosen point for a new one."""
    for i in range(members.shape[0]):
        squared = 0.0
        for m in range(Z.shape[0]):
            squared += (Z[m, members[i]] - Z[m, point]) ** 2
        nearest[i] = min(nearest[i], squared)
