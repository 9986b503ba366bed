"""MaxiMin survival of three and more objectives, compiled: what ``search/maximin`` does.

``F`` is (objectives, points), minimised; a point with inf has failed.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled
from paretoik.search.compiled.survival import TINY


@compiled
def ranks(F, rank, room):
    """Write the non-domination rank of every point, failed ones beyond all, for any number of objectives."""
    objectives, total = F.shape
    for k in range(total):
        rank[k] = total
    current, left = 0, True
    while left:
        left, found = False, 0
        for i in range(total):
            if rank[i] < total or not F[0, i] < np.inf:
                continue
            beaten = False
            for j in range(total):
                if rank[j] < total or not F[0, j] < np.inf:
                    continue
                no_worse, better = True, False
                for m in range(objectives):
                    no_worse = no_worse and F[m, j] <= F[m, i]
                    better = better or F[m, j] < F[m, i]
                if no_worse and better:
                    beaten = True
                    break
            if not beaten:
                room[found] = i
                found += 1
        for k in range(found):
            rank[room[k]] = current
            left = True
        current += 1


@compiled
def filled(F, rank, wanted, chosen, value, Z, nearest, members, begins, table):
    """Choose ``wanted`` points rank by rank, those of each always farthest from all chosen first; return how many.

    Write their numbers and squared insertion distances; failed points are not chosen.
    """
    objectives, total = F.shape
    for m in range(objectives):
        ideal, nadir = np.inf, -np.inf
        for k in range(total):
            if rank[k] == 0:
                ideal, nadir = min(ideal, F[m, k]), max(nadir, F[m, k])
        for k in range(total):
            Z[m, k] = (F[m, k] - ideal) / (nadir - ideal) if nadir - ideal > TINY and rank[k] < total else 0.0
    for k in range(total + 2):
        begins[k] = 0
    for k in range(total):
        begins[rank[k] + 1] += 1
    for k in range(total):
        begins[k + 1] += begins[k]
    for k in range(total):
        members[begins[rank[k]]] = k
        begins[rank[k]] += 1
    taken, first, current = 0, 0, 0
    while taken < wanted and current < total and begins[current] > first:
        count = begins[current] - first
        own = members[first : first + count]
        for i in range(count):
            nearest[i] = _to_chosen(table, taken, Z, own[i])
        wanted_here = min(count, wanted - taken)
        begun = _started(Z, own, wanted_here, chosen, value, nearest) if current == 0 else 0
        for at in range(taken + begun, taken + wanted_here):
            best = 0
            for i in range(1, count):
                if nearest[i] > nearest[best]:
                    best = i
            chosen[at], value[at] = own[best], nearest[best]
            _seen(Z, own, own[best], nearest)
            nearest[best] = -1.0  # below every distance: never again
        for at in range(taken, taken + wanted_here):
            for m in range(objectives):
                table[m, at] = Z[m, chosen[at]]
        taken += wanted_here
        first += count
        current += 1
    return taken


@compiled
def _to_chosen(table, taken, Z, point):
    """Return the squared distance of a point to the nearest of those chosen."""
    least = np.inf
    for k in range(taken):
        apart = 0.0
        for m in range(table.shape[0]):
            apart += (table[m, k] - Z[m, point]) ** 2
        least = min(least, apart)
    return least


@compiled
def _started(Z, members, wanted, chosen, value, nearest):
    """Choose the first points of the first rank: least by the achievement function along each axis."""
    objectives, taken = Z.shape[0], 0
    for axis in range(objectives):
        best, least = -1, np.inf
        for i in range(members.shape[0]):
            worth = -np.inf
            for m in range(objectives):
                worth = max(worth, Z[m, members[i]] if m == axis else Z[m, members[i]] * 1e6)
            if best < 0 or worth < least:
                best, least = i, worth
        if nearest[best] >= 0.0 and taken < wanted:
            chosen[taken], value[taken] = members[best], np.inf
            _seen(Z, members, members[best], nearest)
            nearest[best] = -1.0
            taken += 1
    return taken


@compiled
def _seen(Z, members, point, nearest):
    """Note that a point was chosen: how far the members of its rank are from it."""
    for i in range(members.shape[0]):
        apart = 0.0
        for m in range(Z.shape[0]):
            apart += (Z[m, members[i]] - Z[m, point]) ** 2
        nearest[i] = min(nearest[i], apart)
