"""Points with two objectives sorted by (first, second), compiled: merging, non-dominated front, ranks.

Point numbers: first the parents by place, then the children. ``F`` is (objectives, points), minimised; a point with inf
has failed and comes last.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation.numba_cache import compiled

INSERTION_SIZE = 8  # number of points sorted by insertion
ZERO, ONE = np.uint64(0), np.uint64(1)


@compiled
def locate(F, parents, children, places, dominated):
    """Write the number of sorted parents before each child, and whether the last one weakly dominates it."""
    u, v, x, y = F[0], F[1], F[0, parents : parents + children], F[1, parents : parents + children]
    count, level = np.uint64(parents), ZERO  # unsigned: an index needs no sign check
    while count >> (level + ONE) > ZERO:
        level += ONE
    middle, beyond = u[(ONE << level) - ONE], count - (ONE << level)
    for k in range(children):
        places[k] = beyond if middle < x[k] else ZERO
    while level > ZERO:  # bisections of all children at once; a product with a condition would become a branch
        level -= ONE
        for k in range(children):
            places[k] += np.uint64(u[places[k] + (ONE << level) - ONE] < x[k]) << level
    for k in range(children):
        place = places[k] + np.uint64(u[places[k]] < x[k])
        if x[k] < np.inf:
            place += np.uint64((place < count) & (u[place] == x[k]) & (v[place] <= y[k]))
            while place < count and u[place] == x[k] and v[place] <= y[k]:
                place += ONE
        else:
            place = count
        last = place - np.uint64(place > ZERO)
        places[k] = place
        dominated[k] = np.uint64((place > ZERO) & ((v[last] < y[k]) | ((v[last] == y[k]) & (u[last] <= x[k]))))


@compiled
def merge_children(F, parents, children, single_rank, s):
    """Write parents and children sorted by (first, second objective); return their number.

    ``s`` is the workspace of the selection: ``points`` are the points' numbers, the first two rows of ``values`` their
    objectives. Children, placed by ``locate``, are sorted in buckets between the parents. If all parents have a
    ``single_rank``, children that a parent weakly dominates are left out. Random decisions use arithmetic instead of
    branches.
    """
    bucket, child, points, ends = s.spare, s.chosen, s.points, s.begins
    u, v, x, y = F[0], F[1], s.values[0], s.values[1]
    for k in range(parents + 1):
        ends[k] = 0
    added = ZERO
    for k in range(children):
        place, point = s.places[k], parents + k
        bucket[added], child[added] = np.int64(place), point
        is_new = (not single_rank) | ((u[point] < np.inf) & (s.dominated[k] == ZERO))
        added += np.uint64(is_new)
        ends[place] += np.int64(is_new)
    before = 0
    for k in range(parents):  # a parent follows its bucket, which is empty at first
        begin = k + before
        before += ends[k]
        ends[k] = begin
        i = np.uint64(k + before)
        points[i], x[i], y[i] = k, u[k], v[k]
    ends[parents] = parents + before
    for k in range(added):
        place, point = np.uint64(bucket[k]), np.uint64(child[k])
        i = np.uint64(ends[place])
        points[i], x[i], y[i] = child[k], u[point], v[point]
        ends[place] += 1
    for k in range(added):  # the first child of a bucket sorts it: buckets without children take no time
        place = bucket[k]
        begin, end = (ends[place - 1] + 1 if place > 0 else 0), ends[place]
        if points[begin] == child[k] and end - begin > 1:
            if end - begin > INSERTION_SIZE:
                merge_sort(points, s.values, begin, end, s.rank)
            else:
                _insertion_sort(points, s.values, begin, end)
    return parents + np.int64(added)


@compiled
def _follows(x, y, other_x, other_y):
    """Return whether (x, y) comes after the other; takes numbers: arrays would be reference-counted."""
    return x > other_x or (x == other_x and y > other_y)


@compiled
def _insertion_sort(points, values, begin, end):
    x, y = values[0], values[1]
    for k in range(begin + 1, end):
        j = k
        while j > begin and _follows(x[j - 1], y[j - 1], x[j], y[j]):
            x[j - 1], x[j], y[j - 1], y[j] = x[j], x[j - 1], y[j], y[j - 1]
            points[j - 1], points[j] = points[j], points[j - 1]
            j -= 1


@compiled
def merge_sort(points, values, begin, end, spare):
    """Sort the entries from ``begin`` to ``end``; two more rows of ``values`` are for copies."""
    for first in range(begin, end, INSERTION_SIZE):
        _insertion_sort(points, values, first, min(first + INSERTION_SIZE, end))
    x, y, width = values[0], values[1], INSERTION_SIZE
    while width < end - begin:
        for first in range(begin, end, 2 * width):
            i, middle, last = first, min(first + width, end), min(first + 2 * width, end)
            j = middle
            for k in range(first, last):
                second = j < last and (i == middle or _follows(x[i], y[i], x[j], y[j]))
                source = j if second else i
                values[2, k], values[3, k], spare[k] = x[source], y[source], points[source]
                j += np.int64(second)
                i += np.int64(not second)
        for k in range(begin, end):
            x[k], y[k], points[k] = values[2, k], values[3, k], spare[k]
        width *= 2


@compiled
def first_front(points, count, values, front, objectives):
    """Write the non-dominated points of ``count`` sorted ones; return their number."""
    x, y, first, second = values[0], values[1], objectives[0], objectives[1]
    length, nondominated, lowest, last_x, last_y = ZERO, ONE, np.inf, np.inf, np.inf
    for k in range(count):
        is_copy = np.uint64((x[k] == last_x) & (y[k] == last_y))  # copies follow each other
        nondominated = np.uint64(y[k] < lowest) | (is_copy & nondominated)
        front[length], first[length], second[length] = points[k], x[k], y[k]
        length += nondominated
        lowest, last_x, last_y = min(lowest, y[k]), x[k], y[k]
    return np.int64(length)


@compiled
def rank_sorted(values, count, rank, tails):
    """Write the non-domination rank of each of ``count`` sorted points; failed points come last.

    ``tails`` (2, fronts) has the last point of every front; a point belongs to the first front whose last point does
    not dominate it.
    """
    fronts = 0
    for k in range(count):
        x, y = values[0, k], values[1, k]
        if not x < np.inf:
            rank[k] = count
            continue
        low, length = 0, fronts
        while length > 0:
            half = length >> 1
            u, v = tails[0, low + half], tails[1, low + half]
            dominated = np.int64((v < y) | ((v == y) & (u < x)))
            low += dominated * (half + 1)
            length = dominated * (length - half - 1) + (1 - dominated) * half
        rank[k] = low
        tails[0, low], tails[1, low] = x, y
        fronts = max(fronts, low + 1)
