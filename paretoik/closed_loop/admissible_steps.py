"""Which steps are free, compiled: within their bounds, and clear of obstacles at their end or all the way."""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run_first
from paretoik.closed_loop.obstacles import gaps
from paretoik.closed_loop.workspace import FINEST, LOOKED, SLACK
from paretoik.compilation import compiled


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
def shorten(count, place, guard, room):
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
        elif far >= clear - guard.standoff:
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
