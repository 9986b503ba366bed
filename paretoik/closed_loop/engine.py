"""A control step's search, compiled: what ``ControlStep.algorithm`` does.

NSGA-II with MaxiMin on the genes of the extended Jacobian, a stream of chance for every seed and step. Objectives and
clearance are programs, so that arms and objectives of all kinds run through the same code.
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run_first
from paretoik.closed_loop.admissible_steps import blocked, clearance_before, shorten
from paretoik.closed_loop.configurations import configurations
from paretoik.closed_loop.workspace import TRIES
from paretoik.compilation import compiled
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


@compiled(what="the search of a control step", seconds=15)
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
    shorten(count, place, guard, room)
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
        shorten(left, place, guard, room)
    for k in range(left):
        room.given[0, asked[k]] = np.nan


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
