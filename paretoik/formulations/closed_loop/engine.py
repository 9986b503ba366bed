"""A control step's search, compiled: what ``ControlStep.algorithm`` does.

NSGA-II with MaxiMin on the genes of the extended Jacobian, a stream of chance for every seed and step. Objectives and
clearance are programs, so that arms and objectives of all kinds run through the same code.
"""

from __future__ import annotations

import numpy as np

from paretoik.calculus.compiling import compiled
from paretoik.calculus.running import run_first
from paretoik.formulations.closed_loop.room import FINEST, LOOKED, SLACK, TRIES
from paretoik.formulations.closed_loop.surroundings import gaps
from paretoik.search.compiled.chance import begin
from paretoik.search.compiled.many_objectives import filled, ranks
from paretoik.search.compiled.offspring import anew, offspring
from paretoik.search.compiled.survival import (
    by_rank,
    first_rank,
    insertion_distances,
    met,
    placed,
    ranks_in_order,
    thinned,
)


@compiled
def searched(seed, step, generations, operators, place, objectives, guard, room, warm):
    """Search one step from a place; return how many of the last population in ``room`` have not failed.

    The arguments are those of ``room.py``: Operators, Place, Worth, Guard and Room. A ``warm`` search begins with the
    population that is there.
    """
    F, order, children, state = room.F, room.order, room.children, room.state
    row, count = place.null.shape[0] + 1, order.shape[0]
    begin(state, seed, step)
    clear = clearance_before(place, guard, room)
    for child in range(count):
        if warm:
            for k in range(children.shape[0]):
                children[k, child] = room.genes[order[child], k]
        else:
            anew(state, operators.low, operators.high, children, child)
    evaluate(place, operators, objectives, guard, clear, count, room, True, False)
    F[:, :count] = np.inf
    for k in range(count):
        order[k] = k
    level = survive(room, count, False)
    for _ in range(generations):
        new = offspring(
            state,
            room.genes,
            order,
            room.worth,
            F,
            row,
            operators.crossing,
            operators.mutating,
            operators.low,
            operators.high,
            children,
        )
        evaluate(place, operators, objectives, guard, clear, new, room, not guard.swept, level)
        level = survive(room, new, level)
    alive = 0
    for k in range(count):
        alive += F[0, k] < np.inf
    return alive


@compiled
def clearance_before(place, guard, room):
    """Return by how much the configuration before keeps more than the required distance; inf without obstacles."""
    if guard.obstacles.shape[0] == 0:
        return np.inf
    for j in range(place.previous.shape[0]):
        room.table[j, 0] = place.previous[j]
    _posed(guard, 1, room)
    _spare(guard.obstacles, guard, 1, room)
    return room.gaps[0]


@compiled
def _posed(guard, count, room):
    """Write the arm's polylines in the configurations in ``room.table``."""
    run_first(guard.nodes, room.table, room.nodes, count)


@compiled
def _spare(obstacles, guard, count, room):
    """Write by how much the polylines in ``room.nodes`` keep more than the required distance from obstacles."""
    gaps(obstacles, room.nodes, count, room.gaps)
    for k in range(count):
        room.gaps[k] -= guard.required


@compiled
def configurations(genes, first, last, place, work, q):
    """Write the joint positions (dof, lanes) that genes (genes, lanes) stand for: Eqs. 7, 12 and 13.

    A step Δq that makes Δx is the shortest one plus null · y, of which the rows J* Δq = Δx* leave J* null y = Δx* − J*
    particular.
    """
    previous, particular, null = place.previous, place.particular, place.null
    n, r = null.shape
    for i in range(r):
        right, begun = work[r * r + i], i * (n + 1)
        _weighed(genes, begun, particular, n, first, last, right)
        last_gene = genes[begun + n]
        for lane in range(first, last):
            right[lane] = last_gene[lane] - right[lane]
        for j in range(r):
            _weighed(genes, begun, null[:, j], n, first, last, work[i * r + j])
    _solve(work, r, first, last)
    for k in range(n):
        start, to = previous[k] + particular[k], q[k]
        for j in range(r):
            y, factor = work[r * r + j], null[k, j]
            if j == 0:
                for lane in range(first, last):
                    to[lane] = start + factor * y[lane]
            else:
                for lane in range(first, last):
                    to[lane] += factor * y[lane]


@compiled
def _weighed(genes, begun, factors, count, first, last, found):
    """Write the weighted sum of ``count`` rows of genes; what is read before a loop lets it run on many lanes."""
    k = 0
    if count >= 3:
        a, b, c = factors[0], factors[1], factors[2]
        one, two, three = genes[begun], genes[begun + 1], genes[begun + 2]
        for lane in range(first, last):
            found[lane] = a * one[lane] + b * two[lane] + c * three[lane]
        k = 3
    else:
        for lane in range(first, last):
            found[lane] = 0.0
    while k < count:
        a, one = factors[k], genes[begun + k]
        for lane in range(first, last):
            found[lane] += a * one[lane]
        k += 1


@compiled
def _solve(work, r, first, last):
    """Solve r equations a lane, table and right sides in rows of ``work``; the solutions replace the right sides."""
    if r == 1:
        for lane in range(first, last):
            work[1, lane] /= work[0, lane]
        return
    if r == 2:
        w0, w1, w2, w3, w4, w5 = work[0], work[1], work[2], work[3], work[4], work[5]
        for lane in range(first, last):
            a, b, c, d = w0[lane], w1[lane], w2[lane], w3[lane]
            e, f, size = w4[lane], w5[lane], a * d - b * c
            w4[lane], w5[lane] = (e * d - b * f) / size, (a * f - e * c) / size
        return
    for lane in range(first, last):
        for column in range(r):
            pivot = column
            for i in range(column + 1, r):
                if abs(work[i * r + column, lane]) > abs(work[pivot * r + column, lane]):
                    pivot = i
            for j in range(r):
                one, other = column * r + j, pivot * r + j
                work[one, lane], work[other, lane] = work[other, lane], work[one, lane]
            one, other = r * r + column, r * r + pivot
            work[one, lane], work[other, lane] = work[other, lane], work[one, lane]
            for i in range(column + 1, r):
                factor = work[i * r + column, lane] / work[column * r + column, lane]
                for j in range(column, r):
                    work[i * r + j, lane] -= factor * work[column * r + j, lane]
                work[r * r + i, lane] -= factor * work[r * r + column, lane]
        for i in range(r - 1, -1, -1):
            for j in range(i + 1, r):
                work[r * r + i, lane] -= work[i * r + j, lane] * work[r * r + j, lane]
            work[r * r + i, lane] /= work[i * r + i, lane]


@compiled
def evaluate(place, operators, objectives, guard, clear, count, room, replacing, level):
    """Write the objectives of ``count`` children; those whose step is not free are replaced by new ones, or fail.

    To see whether all of a step is clear takes long: where all parents are of one ``level``, children that one
    dominates are not looked at.
    """
    F, given, found = room.F, room.given, room.values
    parents, n = room.order.shape[0], place.previous.shape[0]
    configurations(room.children, 0, count, place, room.work, given)
    for lane in range(count):
        room.asked[lane] = lane
    _shorten(count, place, guard, room)
    if replacing and (clear < np.inf or guard.bounded):
        _free(place, operators, guard, clear, count, room)
    for j in range(n):
        for order in range(1, objectives.orders):
            before = place.previous[j] if order == 1 else place.rates[order - 2, j]
            rate, now, dt = given[order * n + j], given[(order - 1) * n + j], place.dt
            for lane in range(count):
                rate[lane] = (now[lane] - before) / dt
    run_first(objectives.program, given, found, count)
    for m in range(F.shape[0]):
        for lane in range(count):
            F[m, parents + lane] = found[m, lane]
    for m in range(F.shape[0]):
        for lane in range(count):
            if not abs(found[m, lane]) < np.inf:
                for each in range(F.shape[0]):
                    F[each, parents + lane] = np.inf
    if replacing:
        return
    asked = 0
    for lane in range(count):
        x, y = F[0, parents + lane], F[1, parents + lane]
        if x < np.inf and not (level and met(F, parents, x, y)[1]):
            room.asked[asked] = lane
            asked += 1
    for k in range(blocked(asked, place, guard, clear, room)):
        for m in range(F.shape[0]):
            F[m, parents + room.asked[k]] = np.inf


@compiled
def _free(place, operators, guard, clear, left, room):
    """Replace the chromosomes of steps that are not free, as often as it takes."""
    asked = room.asked
    for _ in range(TRIES):
        left = blocked(left, place, guard, clear, room)
        if left == 0:
            return
        for k in range(left):
            anew(room.state, operators.low, operators.high, room.children, asked[k])
            configurations(room.children, asked[k], asked[k] + 1, place, room.work, room.given)
        _shorten(left, place, guard, room)
    for k in range(left):
        room.given[0, asked[k]] = np.nan


@compiled
def _shorten(count, place, guard, room):
    """Take of the self-motion of the lanes asked no more than keeps joints within their bounds; genes follow."""
    q, genes, n = room.given, room.children, place.previous.shape[0]
    for i in range(count if guard.bounded else 0):
        lane, kept = room.asked[i], 1.0
        for k in range(n):
            least = place.particular[k]
            more = q[k, lane] - place.previous[k] - least
            if least + more < guard.lower[k] or least + more > guard.upper[k]:
                kept = min(kept, max(((guard.upper[k] if more > 0.0 else guard.lower[k]) - least) / more, 0.0))
        if kept < 1.0:
            for k in range(n):
                at = place.previous[k] + place.particular[k]
                q[k, lane] = at + kept * (q[k, lane] - at)
            for begun in range(0, genes.shape[0], n + 1):
                genes[begun + n, lane] = 0.0
                for k in range(n):
                    genes[begun + n, lane] += genes[begun + k, lane] * (q[k, lane] - place.previous[k])


@compiled
def blocked(count, place, guard, clear, room):
    """Move the lanes whose step is not free to the front of those asked; return how many.

    No point of the arm moves by more than Σ reach · |Δq|: what is farther from all obstacles than that need not be
    looked at, and between two places that are together as far from them the arm is clear.
    """
    asked, given, table, places = room.asked, room.given, room.table, room.places
    stopped, near, n = 0, 0, place.previous.shape[0]
    for k in range(count):
        lane = asked[k]
        far, within = 0.0, True
        for j in range(n):
            step = given[j, lane] - place.previous[j]
            far += guard.reach[j] * abs(step)
            within &= (step >= guard.lower[j] - SLACK) & (step <= guard.upper[j] + SLACK)  # not what is no number
        if not within:
            asked[stopped] = lane
            stopped += 1
        elif far >= clear:
            for j in range(n):
                table[j, near] = given[j, lane]
            places[near], room.spans[near] = lane, far
            near += 1
    if near == 0:
        return stopped
    _posed(guard, near, room)
    _spare(guard.enclosing, guard, near, room)
    close = 0
    for k in range(near):
        far = room.spans[k] - clear if guard.swept else 0.0
        if not room.gaps[k] > max(guard.standoff, far):
            places[close], room.spans[close] = places[k], room.spans[k]
            for i in range(room.nodes.shape[0]):
                room.nodes[i, close] = room.nodes[i, k]
            close += 1
    _spare(guard.obstacles, guard, close, room)
    doubtful = 0
    for k in range(close):
        if not room.gaps[k] > guard.standoff:
            asked[stopped] = places[k]
            stopped += 1
        elif guard.swept and clear + room.gaps[k] <= room.spans[k]:
            places[doubtful], room.spans[doubtful], room.parts[4, doubtful] = places[k], room.spans[k], room.gaps[k]
            doubtful += 1
    if doubtful > 0:
        _look_between(doubtful, place, clear, guard, room)
    for k in range(doubtful):
        if room.spans[k] < 0.0:
            asked[stopped] = places[k]
            stopped += 1
    return stopped


@compiled
def _look_between(count, place, clear, guard, room):
    """Mark the lanes in ``places`` whose steps are not seen to be clear all the way: their span turns negative.

    Parts of steps (which one, begin, width, distance at begin and end) wait on a stack; what its ends do not tell of is
    halved.
    """
    parts, table, q = room.parts, room.table, room.given
    left = count
    for k in range(count):
        parts[0, k], parts[1, k], parts[2, k], parts[3, k] = k, 0.0, 1.0, clear
    while left > 0:
        taken = min(left, LOOKED)
        left -= taken
        for i in range(taken):
            lane, share = room.places[np.int64(parts[0, left + i])], parts[1, left + i] + 0.5 * parts[2, left + i]
            for j in range(place.previous.shape[0]):
                table[j, i] = place.previous[j] + share * (q[j, lane] - place.previous[j])
        _posed(guard, taken, room)
        _spare(guard.obstacles, guard, taken, room)
        popped = parts[:, left : left + taken].copy()
        for i in range(taken):
            which, width, middle = np.int64(popped[0, i]), 0.5 * popped[2, i], room.gaps[i]
            span = room.spans[which]
            if span < 0.0:
                continue
            told, rest = popped[3, i] + middle > span * width, middle + popped[4, i] > span * width
            if not middle > 0.0 or (not (told and rest) and width <= FINEST):
                room.spans[which] = -1.0
                continue
            if not told:
                parts[0, left], parts[1, left], parts[2, left] = which, popped[1, i], width
                parts[3, left], parts[4, left] = popped[3, i], middle
                left += 1
            if not rest:
                parts[0, left], parts[1, left], parts[2, left] = which, popped[1, i] + width, width
                parts[3, left], parts[4, left] = middle, popped[4, i]
                left += 1


@compiled
def survive(room, new, level):
    """Choose the next population; ``level`` says that all parents were of one rank, and so says what is returned.

    Of two objectives the survivors are in order of the first.
    """
    F, order, worth, s = room.F, room.order, room.worth, room.selection
    objectives, count = F.shape[0], order.shape[0]
    if objectives > 2:
        ranks(F, s.rank, s.spare)
        _ranked(F, count, s)
        for k in range(count):  # by rank, then distance: so they were chosen
            tied = k > 0 and s.rank[s.front[k]] == s.rank[s.front[k - 1]] and s.value[k] == s.value[k - 1]
            worth[k] = worth[k - 1] if tied else -float(k)
    else:
        length, total = 0, 0
        if level:
            total = placed(F, count, new, True, s.spare, s.begins, s.taken, s.points, s.keys)
            length = first_rank(s.points, total, s.keys, s.front, s.along)
        if length < count:
            total = placed(F, count, count, False, s.spare, s.begins, s.taken, s.points, s.keys)
            length = first_rank(s.points, total, s.keys, s.front, s.along)
        level = length >= count
        if level:
            insertion_distances(s.along, length, s.x, s.y, s.value, s.waiting)
            thinned(s.front, s.along, s.value, length, count, s.x, s.y)
        else:
            ranks_in_order(s.keys, total, s.rank, s.scaled)
            by_rank(total, count, s)
        for k in range(count):
            worth[k] = s.value[k]
    for m in range(objectives):
        for k in range(count):
            F[m, k] = s.along[m, k]
    _moved_in(room.genes, order, room.children, s.front, s.taken, s.spare)
    return level


@compiled
def _ranked(F, count, s):
    """Choose by rank, and failed points where the others are too few."""
    found = filled(F, s.rank, count, s.front, s.value, s.scaled, s.nearest, s.spare, s.begins, s.along)
    for k in range(F.shape[1]):
        if found < count and s.rank[k] == F.shape[1]:
            s.front[found], s.value[found] = k, 0.0
            found += 1
    for m in range(F.shape[0]):
        for k in range(count):
            s.along[m, k] = F[m, s.front[k]]


@compiled
def _moved_in(genes, order, children, front, taken, gone):
    """Let the chosen points be the parents, in this order; genes move only where a child takes a parent's place."""
    count = order.shape[0]
    for k in range(count + 1):
        gone[k] = 1
    for k in range(count):
        gone[min(front[k], count)] = 0
    place = 0
    for k in range(count):
        if front[k] < count:
            taken[k] = order[front[k]]
            continue
        while gone[place] == 0:
            place += 1
        taken[k] = order[place]
        place += 1
        for j in range(genes.shape[1]):
            genes[taken[k], j] = children[j, front[k] - count]
    for k in range(count):
        order[k] = taken[k]
