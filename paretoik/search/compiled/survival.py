"""MaxiMin survival of two objectives, compiled: what ``search/maximin`` does, on arrays that live through a search.

Points are numbered: first the parents by place, then the children. ``F`` is (objectives, points), minimised; a point
with inf has failed and comes last. Parents are kept sorted by the first objective; as long as they are mutually
non-dominated, only children that none of them dominates are looked at again. More objectives: ``many_objectives``.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled

SMALL = 8  # points that are sorted by insertion
NONE, ONE = np.uint64(0), np.uint64(1)
TINY = 2.2250738585072014e-308  # an objective that spreads by less than this does not count


@compiled
def met(F, parents, x, y):
    """Return how many of the sorted parents come before a point, and whether the last of them is as good or better."""
    first, length = np.uint64(0), np.uint64(parents)  # unsigned: from no end of an array is counted back
    while length > ONE:
        half = length >> ONE
        u, v = F[0, first + half - ONE], F[1, first + half - ONE]
        first += half * np.uint64((u < x) | ((u == x) & (v <= y)))
        length -= half
    u, v = F[0, first], F[1, first]
    first += np.uint64((u < x) | ((u == x) & (v <= y)))
    before = first - np.uint64(first > NONE)
    u, v = F[0, before], F[1, before]
    return first, (first > NONE) & ((v < y) | ((v == y) & (u <= x)))


@compiled
def placed(F, parents, children, level, bucket, begins, child, points, xy):
    """Write parents, which are sorted, and so many children in order of (first, second objective); return how many.

    ``points`` are their numbers, ``xy`` (2, points) their objectives. Children go to buckets between the parents and
    are sorted there. Where all parents are of one ``level``, children that one dominates, or that are worth the same,
    are left out. What chance decides is written without branches.
    """
    for k in range(parents + 2):
        begins[k] = 0
    found = 0
    for k in range(parents, parents + children):
        first, beaten = met(F, parents, F[0, k], F[1, k])
        bucket[found], child[found] = np.int64(first), k
        found += np.int64((not level) | ((F[0, k] < np.inf) & (not beaten)))
    for k in range(found):
        begins[bucket[k] + 1] += 1
    for k in range(parents + 1):
        begins[k + 1] += begins[k]
    for k in range(parents):
        place = k + begins[k + 1]
        points[place], xy[0, place], xy[1, place] = k, F[0, k], F[1, k]
    for k in range(found):
        place = bucket[k] + begins[bucket[k]]
        begins[bucket[k]] += 1
        points[place], xy[0, place], xy[1, place] = child[k], F[0, child[k]], F[1, child[k]]
    for k in range(parents + 1):
        end = k + begins[k]  # of the bucket before parent k
        begin = k + begins[k - 1] if k > 0 else 0
        if end - begin > SMALL:
            _merged(points, xy, begin, end, child)
        else:
            _inserted(points, xy, begin, end)
    return parents + found


@compiled
def _later(xy, i, j):
    """Return whether one place holds what comes after what another holds."""
    return xy[0, i] > xy[0, j] or (xy[0, i] == xy[0, j] and xy[1, i] > xy[1, j])


@compiled
def _inserted(points, xy, begin, end):
    """Sort a stretch by insertion."""
    for k in range(begin + 1, end):
        j = k
        while j > begin and _later(xy, j - 1, j):
            for m in range(2):
                xy[m, j - 1], xy[m, j] = xy[m, j], xy[m, j - 1]
            points[j - 1], points[j] = points[j], points[j - 1]
            j -= 1


@compiled
def _merged(points, xy, begin, end, room):
    """Sort a stretch by merging; ``xy`` has two rows more, for copies."""
    for first in range(begin, end, SMALL):
        _inserted(points, xy, first, min(first + SMALL, end))
    width = SMALL
    while width < end - begin:
        for first in range(begin, end, 2 * width):
            i, middle, last = first, min(first + width, end), min(first + 2 * width, end)
            j = middle
            for k in range(first, last):
                second = j < last and (i == middle or _later(xy, i, j))
                at = j if second else i
                xy[2, k], xy[3, k], room[k] = xy[0, at], xy[1, at], points[at]
                j += np.int64(second)
                i += np.int64(not second)
        for k in range(begin, end):
            xy[0, k], xy[1, k], points[k] = xy[2, k], xy[3, k], room[k]
        width *= 2


@compiled
def first_rank(points, count, xy, front, along):
    """Write the points that none dominates, of so many in order, to ``front`` and ``along``; return how many."""
    found, least, last = 0, np.inf, np.inf
    for k in range(count):
        x, y = xy[0, k], xy[1, k]
        kept = (y < least) | ((y == least) & (x == last))
        front[found], along[0, found], along[1, found] = points[k], x, y
        found += np.int64(kept)
        least, last = min(least, y), (x if kept else last)
    return found


@compiled
def ranks_in_order(xy, count, rank, tails):
    """Write the non-domination rank of each of so many points in order, failed ones beyond all.

    ``tails`` (2, fronts) has the last point of every front: the first that does not dominate the next one is its front.
    """
    fronts = 0
    for k in range(count):
        x, y = xy[0, k], xy[1, k]
        if not x < np.inf:
            rank[k] = count
            continue
        low, length = 0, fronts
        while length > 0:
            half = length >> 1
            u, v = tails[0, low + half], tails[1, low + half]
            beaten = np.int64((v < y) | ((v == y) & (u < x)))
            low += beaten * (half + 1)
            length = beaten * (length - half - 1) + (1 - beaten) * half
        rank[k] = low
        tails[0, low], tails[1, low] = x, y
        fronts = max(fronts, low + 1)


@compiled
def by_rank(count, wanted, s):
    """Keep ``wanted`` of so many points in order: whole ranks, of the last those farthest from all that are kept.

    ``s`` is the room of the selection: points, objectives in ``keys``, ``rank``; what is kept goes to ``front`` and
    ``along``. Its ``value`` is the worth in a tournament, less for higher ranks; in the last it grows with the distance
    of insertion.
    """
    rank, xy, points, front, along = s.rank, s.keys, s.points, s.front, s.along
    worth, sizes, nearest, members = s.value, s.begins, s.nearest, s.spare
    for k in range(count + 1):
        sizes[k] = 0
    for k in range(count):
        sizes[rank[k]] += 1
    split, left = 0, wanted
    while split < count and left >= sizes[split]:
        left -= sizes[split]
        split += 1
    first, last = -1, -1
    for k in range(count):
        if rank[k] == 0:
            first, last = (k if first < 0 else first), k
    width, height = xy[0, last] - xy[0, first], xy[1, first] - xy[1, last]
    across, down = (1.0 / width if width > TINY else 0.0), (1.0 / height if height > TINY else 0.0)
    found = 0
    for k in range(count):
        members[found] = k
        found += np.int64(rank[k] == split)
    if split < count and left > 0:
        _to_kept(xy, count, rank, split, members, found, across, down, nearest)
        for i in range(found):
            s.x[i], s.y[i] = xy[0, members[i]], xy[1, members[i]]
        _split(s.x, s.y, across, down, found, nearest, s.distance, s.waiting)
        _taken(members, found, left, s.distance, rank, worth, split, s.x, s.y)
    for i in range(left if split == count else 0):  # failed points fill up
        rank[members[i]], worth[members[i]] = -1, -split
    kept = 0
    for k in range(count):
        front[kept], along[0, kept], along[1, kept] = points[k], xy[0, k], xy[1, k]
        worth[kept] = worth[k] if rank[k] == -1 else -np.float64(rank[k])
        kept += np.int64(rank[k] < split)


@compiled
def _split(x, y, across, down, found, nearest, value, waiting):
    """Write the squared distance at which each member of a rank, in order, is inserted; ``nearest`` is that to others.

    Of a stretch between inserted members the farthest is the next one, whatever happens elsewhere on the front.
    """
    waiting[0, 0], waiting[0, 1] = 0, found
    left = 1
    while left > 0:
        left -= 1
        begin, end = waiting[left, 0], waiting[left, 1]
        best, most = begin, nearest[begin]
        for i in range(begin + 1, end):
            if nearest[i] > most:
                best, most = i, nearest[i]
        value[best] = most
        if not most > 0.0:  # copies of what is inserted
            for i in range(begin, end):
                value[i] = most
            continue
        x0, y0 = x[best], y[best]
        for i in range(begin, end):
            aside, below = (x[i] - x0) * across, (y[i] - y0) * down
            apart = aside * aside + below * below
            nearest[i] = apart if apart < nearest[i] else nearest[i]
        waiting[left, 0], waiting[left, 1] = begin, best
        left += np.int64(best > begin)
        waiting[left, 0], waiting[left, 1] = best + 1, end
        left += np.int64(end > best + 1)


@compiled
def _taken(members, found, wanted, value, rank, worth, split, room, other):
    """Mark the members that were inserted first, and say what they are worth."""
    least = least_kept(value, found, found - wanted, room, other)
    spare = wanted
    for i in range(found):
        spare -= np.int64(value[i] > least)
    for i in range(found):
        if value[i] > least or (value[i] == least and spare > 0):
            spare -= np.int64(value[i] == least)
            rank[members[i]] = -1
            worth[members[i]] = value[i] / (2.0 * (1.0 + value[i])) - split if value[i] < np.inf else 0.5 - split


@compiled
def _to_kept(xy, count, rank, split, members, found, across, down, nearest):
    """Write the squared distance of each member of a rank to the nearest point of better rank.

    Points are in order of the first objective: it is looked to either side as far as that alone is nearer.
    """
    for i in range(found):
        member, least = members[i], np.inf
        x, y = xy[0, member], xy[1, member]
        if i > 0 and x == xy[0, members[i - 1]] and y == xy[1, members[i - 1]]:  # a copy
            nearest[i] = nearest[i - 1]
            continue
        for way in (-1, 1):
            k = member + way
            while 0 <= k < count:
                aside = ((xy[0, k] - x) * across) ** 2
                if aside >= least:
                    break
                if rank[k] < split:
                    least = min(least, aside + ((xy[1, k] - y) * down) ** 2)
                k += way
        nearest[i] = least


@compiled
def insertion_distances(along, count, x, y, value, waiting):
    """Write the squared distance at which MaxiMin inserts each point of a sorted front; its ends have inf.

    Between two inserted points the next is the one whose nearer end is farthest; distances to either end grow along
    the front, so that it is found by halving.
    """
    width, height = along[0, count - 1] - along[0, 0], along[1, 0] - along[1, count - 1]
    across, down = (1.0 / width if width > TINY else 0.0), (1.0 / height if height > TINY else 0.0)
    for k in range(count):
        x[k], y[k] = (along[0, k] - along[0, 0]) * across, (along[1, k] - along[1, count - 1]) * down
    value[0] = value[count - 1] = np.inf
    waiting[0, 0], waiting[0, 1] = 0, count - 1
    left = np.int64(count > 2)
    while left > 0:
        left -= 1
        begin, end = waiting[left, 0], waiting[left, 1]
        x0, y0, x1, y1 = x[begin], y[begin], x[end], y[end]
        low, length = begin + 1, end - begin - 1  # the first that is no nearer to the beginning than to the end
        while length > 1:
            half = length >> 1
            u, v = x[low + half - 1], y[low + half - 1]
            low += half * np.int64((u - x0) ** 2 + (v - y0) ** 2 < (x1 - u) ** 2 + (y1 - v) ** 2)
            length -= half
        best, other = _nearer(x, y, low, begin, end), _nearer(x, y, low - 1, begin, end)
        chosen = low - np.int64((other >= best) & (low - 1 > begin))
        value[chosen] = max(best, other)  # an end is at no distance
        waiting[left, 0], waiting[left, 1] = begin, chosen
        left += np.int64(chosen - begin > 1)
        waiting[left, 0], waiting[left, 1] = chosen, end
        left += np.int64(end - chosen > 1)


@compiled
def _nearer(x, y, k, begin, end):
    before = (x[k] - x[begin]) ** 2 + (y[k] - y[begin]) ** 2
    after = (x[end] - x[k]) ** 2 + (y[end] - y[k]) ** 2
    return min(before, after)


@compiled
def least_kept(value, count, dropped, room, other):
    """Return the value of rank ``dropped`` from below: what lies under it is dropped (Hoare's selection).

    Values go to either side of a pivot without branches.
    """
    for k in range(count):
        room[k] = value[k]
    while True:
        pivot = room[count >> 1]
        below, above = 0, 0
        for k in range(count):
            one = room[k]
            room[below] = one
            below += np.int64(one < pivot)
            other[above] = one
            above += np.int64(one > pivot)
        if dropped < below:
            count = below
        elif dropped < count - above:
            return pivot
        else:
            dropped -= count - above
            count = above
            room, other = other, room


@compiled
def thinned(front, along, value, count, wanted, room, other):
    """Keep the ``wanted`` points of a sorted front that were inserted first, in their order."""
    if count == wanted:
        return
    least = least_kept(value, count, count - wanted, room, other)
    spare = wanted  # places for those that are tied with the last
    for k in range(count):
        spare -= np.int64(value[k] > least)
    kept = 0
    for k in range(count):
        tied = (value[k] == least) & (spare > 0)
        keep = (value[k] > least) | tied
        spare -= np.int64(tied)
        front[kept], value[kept] = front[k], value[k]
        along[0, kept], along[1, kept] = along[0, k], along[1, k]
        kept += np.int64(keep)
