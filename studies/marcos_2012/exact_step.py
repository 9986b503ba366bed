"""The exactly best step of an extended Jacobian, compiled, for planar arms of one or two redundant degrees.

Both objectives of Marcos et al. 2012 (Eqs. 17 and 18) and their weighted sum are minimised by branch and bound over the
cells of the null space: steps that are left out are proven to be no better.
"""

from __future__ import annotations

from heapq import heappop, heappush

import numpy as np

from paretoik.closed_loop.admissible_steps import clearance_at_start
from paretoik.compilation.array_tuples import refer
from paretoik.compilation.numba_cache import compiled
from studies.marcos_2012.null_space_steps import (
    configure,
    error_at,
    is_admissible,
    linearise,
    tool_error,
    weighted_sum,
    write_region,
)
from studies.marcos_2012.obstacle_cuts import bound_polygon, clear_step, cut_cell, may_be_clear
from studies.marcos_2012.step_cells import ADMISSIBLE, BOUND, contains, halve, lower_bound, model, place_region


@compiled(what="the exact control step", seconds=20)
def best_steps(targets, moves, positions, home, weight, options, s, q):
    """Write the joint positions (time, dof) of the best steps from the first; return how many samples they reach.

    ``moves`` and ``positions`` (2, time, dof) are the bounds of joints' moves in the step to a sample, and their
    limits.
    """
    options, s = refer(options), refer(s)
    for k in range(1, targets.shape[0]):
        for j in range(q.shape[1]):
            s.start.previous[j] = q[k - 1, j]
            s.constraints.lower[j] = max(moves[0, k, j], positions[0, k, j] - q[k - 1, j])
            s.constraints.upper[j] = min(moves[1, k, j], positions[1, k, j] - q[k - 1, j])
        if not best_step(home, targets[k], weight, options, s, q[k]):
            return k
    return targets.shape[0]


@compiled
def best_step(home, target, weight, options, s, q):
    """Write the best step's joint positions to ``q``; return whether an admissible step exists."""
    if not linearise(home, target, s):
        return False
    s.clearance[0] = clearance_at_start(s.start, s.constraints, s.workspace)
    corners, place = write_region(options.farthest, s), np.zeros(2)
    rounding = options.rounding * s.lengths.sum()
    nearest = minimise(1.0, 0.0, 0.0, options.end_tolerance, corners, options, s, place)
    if not nearest < np.inf:
        return False
    near_u, near_v = place[0], place[1]
    largest = error_at(near_u, near_v, s)
    if weight < 1.0:
        smallest, farthest = 0.0, nearest_zero(corners, rounding, options, s, place)
        if not farthest < np.inf:
            place[0], place[1] = near_u, near_v
            smallest = minimise(0.0, 1.0, rounding, options.end_tolerance, corners, options, s, place)
            farthest = place[0] ** 2 + place[1] ** 2
        if weight > 0.0 and not (farthest > nearest and largest > smallest + rounding):
            place[0], place[1] = near_u, near_v
        elif weight > 0.0:
            square_weight = weight / (farthest - nearest)  # Eqs. 19 and 20
            error_weight = (1.0 - weight) / (largest - smallest)
            far = square_weight * farthest + error_weight * smallest
            if square_weight * nearest + error_weight * largest < far:
                place[0], place[1] = near_u, near_v
            enough = max(options.tolerance, error_weight * rounding)
            radius = np.sqrt(min(far, square_weight * nearest + error_weight * largest) / square_weight)
            corners = write_region(min(radius, options.farthest), s)
            minimise(square_weight, error_weight, enough, options.rounding, corners, options, s, place)
    configure(place[0], place[1], s, q)
    return True


@compiled
def minimise(square_weight, error_weight, enough, share, corners, options, s, place):
    """Return the least of square_weight ‖y‖² + error_weight ‖e‖ over admissible steps; inf without any.

    It is exact within ``enough``, or this ``share`` of itself. The step is written to ``place``; the step there before
    is tried first.
    """
    best, weights = np.inf, (square_weight, error_weight)
    best = _try(place[0], place[1], weights, best, False, s, place)
    for i in range(corners):
        best = _try(s.corners[0, i, 0], s.corners[0, i, 1], weights, best, False, s, place)
    count = place_region(corners, s)
    waiting = [(-np.inf, i) for i in range(count)]
    while len(waiting) > 0 and count < s.cells.shape[0]:
        bound, i = heappop(waiting)
        gain = max(enough, share * best) if best < np.inf else enough
        if bound >= best - gain:
            break
        u, v = halve(i, count, s)
        best = _try(u, v, weights, best, s.cells[i, ADMISSIBLE] > 0.0, s, place)
        for half in (i, count):
            best, is_open = _look(half, weights, gain, best, options, s, place)
            if is_open:
                heappush(waiting, (s.cells[half, BOUND], half))
        count += 1
    return best


@compiled
def _look(i, weights, enough, best, options, s, place):
    """Try the middle of a cell, and write its bound; return the best value, and whether to halve the cell."""
    cell = s.cells[i]
    m = model(cell, s)
    threshold = best - enough
    bound = lower_bound(weights[0], weights[1], threshold, m)
    cell[BOUND] = bound
    if bound >= threshold or not m.size > options.smallest:
        return best, False
    possible, interval = may_be_clear(cell, m, options, s)
    if not possible:
        return best, False
    best = _try(m.u, m.v, weights, best, cell[ADMISSIBLE] > 0.0, s, place)
    if not cell[ADMISSIBLE] > 0.0 and s.lengths.shape[0] > 3:
        best = _cut(cell, m, interval, weights, best, options, s, place)
    if weights[1] * m.change < np.inf:
        best, is_done = _descend(cell, m, weights, enough, best, options, s, place)
        if is_done:
            return best, False
    return best, cell[BOUND] < best - enough


@compiled
def _cut(cell, m, interval, weights, best, options, s, place):
    """Raise the bound of a cell to that over its part that may be clear; return the best value, a step there tried."""
    corners, cuts = cut_cell(cell, m, interval, options.witnesses, s)
    bound, corner = bound_polygon(weights[0], weights[1], corners, m, options.directions, s)
    cell[BOUND] = max(cell[BOUND], bound)
    if cuts == 0 or cell[BOUND] >= best:
        return best
    u, v = clear_step(corner, cuts, m, s)
    if max(abs(u), abs(v)) > options.farthest:
        return best
    return _try(u, v, weights, best, False, s, place)


@compiled
def _descend(cell, m, weights, enough, best, options, s, place):
    """If the weighted sum is convex in a cell, find its minimum there by Newton's method, and raise the bound.

    Return the best value, and whether the cell contains nothing better.
    """
    value, (fu, fv), (uu, uv, vv) = weighted_sum(weights[0], weights[1], m.u, m.v, s)
    change, interval = weights[1] * m.change, s.lengths.shape[0] == 3
    least = uu if interval else 0.5 * (uu + vv) - np.sqrt(0.25 * (uu - vv) ** 2 + uv * uv)
    if not least > change:
        return best, False
    bound = np.inf
    for i in range(3):
        bound = min(bound, value + fu * (cell[2 * i] - m.u) + fv * (cell[2 * i + 1] - m.v))
    cell[BOUND] = max(cell[BOUND], bound)
    if cell[BOUND] >= best - enough:
        return best, True
    u, v = m.u, m.v
    for _ in range(options.newton_iterations):
        if interval:
            u -= fu / uu
        else:
            determinant = uu * vv - uv * uv
            u, v = u - (vv * fu - uv * fv) / determinant, v - (uu * fv - uv * fu) / determinant
        if not contains(cell, u, v, s):
            return best, False
        _, (fu, fv), (uu, uv, vv) = weighted_sum(weights[0], weights[1], u, v, s)
    best = _try(u, v, weights, best, cell[ADMISSIBLE] > 0.0, s, place)
    return best, cell[ADMISSIBLE] > 0.0


@compiled
def _try(u, v, weights, best, admissible, s, place):
    """Return the better of a value and that of a step; write the step to ``place`` if it is better."""
    value = weights[0] * (u * u + v * v)
    if weights[1] > 0.0:
        value += weights[1] * error_at(u, v, s)
    if value < best and (admissible or is_admissible(u, v, s)):
        place[0], place[1] = u, v
        return value
    return best


@compiled
def nearest_zero(corners, rounding, options, s, place):
    """Return ‖y‖² of the nearest admissible step that reaches the target, written to ``place``; inf without any.

    With one redundant degree no search is made: such a step exists only by chance.
    """
    if s.lengths.shape[0] == 3:
        return np.inf
    best, count = np.inf, place_region(corners, s)
    waiting = [(-np.inf, i) for i in range(count)]
    while len(waiting) > 0 and count < s.cells.shape[0]:
        bound, i = heappop(waiting)
        if bound >= best:
            break
        halve(i, count, s)
        for half in (i, count):
            best, is_open = _seek(half, best, rounding, options, s, place)
            if is_open:
                heappush(waiting, (s.cells[half, BOUND], half))
        count += 1
    return best


@compiled
def _seek(i, best, rounding, options, s, place):
    """Search a cell for a step that reaches the target; return the best ‖y‖², and whether to halve the cell."""
    cell = s.cells[i]
    m = model(cell, s)
    cell[BOUND] = min(m.squares)
    if cell[BOUND] >= best or not m.size > options.smallest:
        return best, False
    if lower_bound(0.0, 1.0, 0.0, m) > rounding or not may_be_clear(cell, m, options, s)[0]:
        return best, False
    u, v = m.u, m.v
    for _ in range(options.newton_iterations):
        x, y, (xu, xv, yu, yv), _ = tool_error(u, v, s)
        determinant = xu * yv - xv * yu
        if np.hypot(x, y) <= rounding or determinant == 0.0:
            break
        u, v = u - (yv * x - xv * y) / determinant, v - (xu * y - yu * x) / determinant
    if not np.hypot(x, y) <= rounding:
        return best, True
    square = u * u + v * v
    if square < best and max(abs(u), abs(v)) <= options.farthest and is_admissible(u, v, s):
        best, place[0], place[1] = square, u, v
    return best, not (m.invertible and contains(cell, u, v, s))
