"""Cells cut by obstacles, compiled.

A polygon contains all steps of a cell that may be clear. A step is clear if its end has the standoff, and if the
distances at both ends of every shortest interval add up to more than the arm's travel in it: then halving, as in
``find_inadmissible``, proves it. Bounds of distances (``witness``) make both conditions half-planes. The objective is
bounded over the polygon as over the cell, so that near obstacles too the bound is off by the square of the cell's size.
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run_first
from paretoik.closed_loop.admissible_steps import evaluate_distances
from paretoik.closed_loop.programs import AXES, FIRST, KIND, PLANE, POINT, RADIUS, SECOND, SEGMENT
from paretoik.compilation.numba_cache import compiled
from studies.marcos_2012.null_space_steps import clip, configure
from studies.marcos_2012.step_cells import ADMISSIBLE

# Cells cut by bounds of distances.


@compiled
def excess_at(share, s):
    """Return how far the arm exceeds the required distance after a share of the first step, to ``workspace.inputs``."""
    start, c, w = s.start, s.constraints, s.workspace
    for j in range(start.previous.shape[0]):
        w.configurations[j, 0] = start.previous[j] + share * (w.inputs[j, 0] - start.previous[j])
    run_first(c.nodes, w.configurations, w.nodes, 1)
    evaluate_distances(c.obstacles, c.widths, w.nodes, 1, w.distances)
    return w.distances[0] - c.required


@compiled
def may_be_clear(cell, m, options, s):
    """Mark a cell if all its steps are clear of obstacles; return whether some may be.

    Also return the interval, in the step to its middle, that is nearest to obstacles, for the cuts; negative without
    any.
    """
    c, w = s.constraints, s.workspace
    if cell[ADMISSIBLE] > 0.0:
        return True, -1
    configure(m.u, m.v, s, w.inputs[:, 0])
    excess = excess_at(1.0, s)
    if excess + m.travel <= c.standoff:
        return False, -1
    is_clear = excess - m.travel > c.standoff
    if not c.swept:
        cell[ADMISSIBLE] = 1.0 if is_clear else 0.0
        return True, -1
    travel, spread, width = 0.0, 0.0, s.options.shortest_interval
    for j in range(s.origin.shape[0]):
        du, dv, moved = s.null_space[j, 0], s.null_space[j, 1], 0.0
        for i in range(3):
            moved = max(moved, abs(du * (cell[2 * i] - m.u) + dv * (cell[2 * i + 1] - m.v)))
        travel += c.reach[j] * abs(w.inputs[j, 0] - s.start.previous[j])
        spread += c.reach[j] * moved * width
    least, interval = nearest_interval(excess, travel, 2.0 * m.travel + spread, options.shares, s)
    if interval < 0:
        cell[ADMISSIBLE] = 1.0 if is_clear else 0.0
        return True, -1
    return least + 2.0 * (interval + 1) * width * m.travel + spread > 0.0, interval


@compiled
def nearest_interval(end, travel, enough, shares, s):
    """Return the least excess over intervals of the step, and its interval.

    The excess is the sum of the distances at the ends of a shortest interval, minus the travel in it. Without an
    interval below ``enough``, the result is ``enough`` and -1. After ``shares`` parts of the step the search ends with
    some interval, maybe not the nearest. The step is that in ``s.workspace.inputs``, ``travel`` its whole travel [m],
    and ``end`` the excess [m] of its end over the required distance.
    """
    waiting, stack, shortest, nearest = 1, s.workspace.intervals, s.options.shortest_interval, -1
    stack[0, 0], stack[1, 0], stack[2, 0], stack[3, 0] = 0.0, 1.0, s.clearance[0], end
    while waiting > 0:
        waiting -= 1
        begin, width, first, last = stack[0, waiting], stack[1, waiting], stack[2, waiting], stack[3, waiting]
        if first + last - travel * width >= enough:
            continue
        if width <= shortest:
            enough, nearest = first + last - travel * width, int(begin / shortest + 0.5)
            continue
        if shares == 0:
            return enough, max(nearest, 0)
        shares, half = shares - 1, 0.5 * width
        middle = excess_at(begin + half, s)
        later = waiting if first <= last else waiting + 1  # the nearer half comes first
        earlier = 2 * waiting + 1 - later
        stack[0, earlier], stack[1, earlier], stack[2, earlier], stack[3, earlier] = begin, half, first, middle
        stack[0, later], stack[1, later], stack[2, later], stack[3, later] = begin + half, half, middle, last
        waiting += 2
    return enough, nearest


@compiled
def cut_cell(cell, m, interval, witnesses, s):
    """Write the polygon of the steps of a cell that may be clear (corners, 5); return the numbers of corners and cuts.

    Its columns are the step from the middle of the cell, the model's error [m] and the tangent of ‖y‖² there.
    ``interval`` is the one in which the step to the middle is nearest to obstacles, negative without any; ``witnesses``
    is the largest number of bounds per link and obstacle.
    """
    polygon, w = s.polygons[0], s.workspace
    for i in range(3):
        polygon[i, 0], polygon[i, 1] = cell[2 * i] - m.u, cell[2 * i + 1] - m.v
        polygon[i, 2], polygon[i, 3], polygon[i, 4] = m.x[i], m.y[i], m.squares[i]
    for k in range(s.turns.shape[0]):
        s.turns[k] = 0.0
        for i in range(3):
            s.turns[k] = max(s.turns[k], abs(s.slopes[k, 0] * polygon[i, 0] + s.slopes[k, 1] * polygon[i, 1]))
    configure(m.u, m.v, s, w.inputs[:, 0])
    corners, cuts = _cut_at_end(m, witnesses, s)
    if interval >= 0:
        corners, cuts = _cut_in_interval(corners, cuts, interval, witnesses, s)
    return corners, cuts


@compiled
def _place(share, row, s):
    """Write the nodes of the arm after a share of the step, without the base."""
    excess_at(share, s)
    for k in range(s.lengths.shape[0] + 1):
        s.nodes[row, k, 0], s.nodes[row, k, 1] = s.workspace.nodes[3 * k + 3, 0], s.workspace.nodes[3 * k + 4, 0]


@compiled
def _excess(k, i, s):
    """Return how far link k in the workspace exceeds the required distance from an obstacle."""
    w, c, row = s.workspace, s.constraints, 3 * k + 3
    evaluate_distances(c.obstacles[i : i + 1], c.widths[k + 1 : k + 2], w.nodes[row : row + 6], 1, w.distances)
    return w.distances[0] - c.required


@compiled
def _cut_at_end(m, witnesses, s):
    """Cut a cell by the links that come near an obstacle at the end of its steps."""
    corners, cuts, c = 3, 0, s.constraints
    _place(1.0, 0, s)
    for k in range(s.lengths.shape[0]):
        for i in range(c.obstacles.shape[0]):
            if _excess(k, i, s) > c.standoff + m.travel:
                continue
            for which in range(witnesses):
                excess, gu, gv, off = witness(which, k, c.obstacles[i], 1.0, s.nodes[0], s)
                corners, cuts = _cut(corners, cuts, excess - c.required - c.standoff, gu, gv, off, s)
    return corners, cuts


@compiled
def _cut_in_interval(corners, cuts, interval, witnesses, s):
    """Cut a cell by the link and the obstacle that are nearest in an interval of the step to its middle."""
    c, w, width = s.constraints, s.workspace, s.options.shortest_interval
    first, last = interval * width, (interval + 1) * width
    _place(last, 1, s)
    _place(first, 0, s)
    least, link, obstacle = np.inf, 0, 0
    for k in range(s.lengths.shape[0]):
        for i in range(c.obstacles.shape[0]):
            excess = _excess(k, i, s)
            if excess < least:
                least, link, obstacle = excess, k, i
    travel, tu, tv = 2.0 * c.required, 0.0, 0.0  # a tangent from below
    for j in range(s.origin.shape[0]):
        moved = w.inputs[j, 0] - s.start.previous[j]
        rate = width * c.reach[j] * (1.0 if moved > 0.0 else -1.0)
        travel, tu, tv = travel + rate * moved, tu + rate * s.null_space[j, 0], tv + rate * s.null_space[j, 1]
    for which in range(witnesses):
        before, bu, bv, off = witness(which, link, c.obstacles[obstacle], first, s.nodes[0], s)
        after, au, av, more = witness(which, link, c.obstacles[obstacle], last, s.nodes[1], s)
        corners, cuts = _cut(corners, cuts, before + after - travel, bu + au - tu, bv + av - tv, off + more, s)
    return corners, cuts


@compiled
def _cut(corners, cuts, value, gu, gv, off, s):
    """Keep the part of the polygon with value + gᵀ y + off ≥ 0; store the cut if it removes something."""
    least = np.inf
    for i in range(corners):
        least = min(least, value + gu * s.polygons[0, i, 0] + gv * s.polygons[0, i, 1] + off)
    if not least < 0.0:  # also without a bound
        return corners, cuts
    s.cuts[cuts, 0], s.cuts[cuts, 1], s.cuts[cuts, 2], s.cuts[cuts, 3] = value, gu, gv, off
    return clip(s.polygons[0], corners, -gu, -gv, value + off, s.polygons[1]), cuts + 1


@compiled
def bound_polygon(square_weight, error_weight, corners, m, directions, s):
    """Return a lower bound of square_weight ‖y‖² + error_weight ‖e‖ over the polygon, and the model's best corner.

    ``directions`` directions of the error, each from the one before, give a bound each. It is inf if no corner remains.
    """
    polygon, best, bound, corner, x, y = s.polygons[0], np.inf, -np.inf, 0, 0.0, 0.0
    for i in range(corners):
        x, y = x + polygon[i, 2], y + polygon[i, 3]
        value = square_weight * polygon[i, 4] + error_weight * np.hypot(polygon[i, 2], polygon[i, 3])
        if value < best:
            best, corner = value, i
    for _ in range(directions):
        norm, least, lowest = np.hypot(x, y), np.inf, 0
        ux, uy = (error_weight * x / norm, error_weight * y / norm) if norm > 0.0 else (0.0, 0.0)
        for i in range(corners):
            value = square_weight * polygon[i, 4] + ux * polygon[i, 2] + uy * polygon[i, 3]
            if value < least:
                least, lowest = value, i
        bound = max(bound, least)
        if corners > 0:
            x, y = polygon[lowest, 2], polygon[lowest, 3]
    return bound - error_weight * m.remainder, corner


@compiled
def clear_step(corner, cuts, m, s):
    """Return a step near a corner of the polygon, moved inside by the error of the models of the cuts."""
    u, v = s.polygons[0, corner, 0], s.polygons[0, corner, 1]
    for i in range(cuts):
        value, gu, gv, off = s.cuts[i, 0], s.cuts[i, 1], s.cuts[i, 2], s.cuts[i, 3]
        missing, square = off - value - gu * u - gv * v, gu * gu + gv * gv
        if missing > 0.0 and square > 0.0:
            u, v = u + gu * missing / square, v + gv * missing / square
    return m.u + u, m.v + v


# Upper bounds of the distance of a link from an obstacle, over a cell of steps. They are linear, plus a remainder: the
# distance of a fixed point of a link from a fixed point of an obstacle is an upper bound. Next to a box that is upright
# in the plane, a joint is as far away as from the side that it faces, and a link that passes a corner as far as the
# corner is from its line. Both are signed, so that they also show steps which the box blocks. A bound is valid for all
# steps of the cell that are clear. The remainder has the order of the square of the cell's size.


@compiled
def witness(which, k, obstacle, share, nodes, s):
    """Return a bound [m] of the distance of link ``k`` at the middle of the cell, its slopes by y, and its remainder.

    ``which`` is the number of the bound, from 0 to 6; inf if it does not exist. ``nodes`` (dof + 1, 2) are those of the
    arm after a ``share`` of the step to the middle of the cell; ``s.turns`` (dof,) are the links' turns in that step.
    """
    cx, cy, cz = obstacle[FIRST], obstacle[FIRST + 1], obstacle[FIRST + 2]
    if obstacle[KIND] == POINT:
        flat = obstacle[AXES + 8]
        if which > 0:
            return _none()
        return _to_ball(_fraction(k, cx, cy, nodes), cx, cy, flat * cz, obstacle, k, share, nodes, s)
    if obstacle[KIND] == SEGMENT:
        if which > 2:
            return _none()
        dx, dy, dz = obstacle[SECOND] - cx, obstacle[SECOND + 1] - cy, obstacle[SECOND + 2] - cz
        along = float(which)
        if which == 2:  # the end of the link, and the nearest point of the segment
            square = dx * dx + dy * dy + dz * dz
            along = (nodes[k + 1, 0] - cx) * dx + (nodes[k + 1, 1] - cy) * dy - cz * dz
            along = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
        cx, cy, cz = cx + along * dx, cy + along * dy, cz + along * dz
        fraction = 1.0 if which == 2 else _fraction(k, cx, cy, nodes)
        return _to_ball(fraction, cx, cy, cz, obstacle, k, share, nodes, s)
    if obstacle[KIND] == PLANE:
        return _none() if which > 0 else _to_plane(k, obstacle, share, nodes, s)
    is_upright = abs(obstacle[AXES + 8]) == 1.0 and abs(cz) <= obstacle[SECOND + 2]
    if not is_upright:
        return _none()
    return (
        _to_side(which, k, obstacle, share, nodes, s) if which < 2 else _to_corner(which, k, obstacle, share, nodes, s)
    )


@compiled
def _fraction(k, x, y, nodes):
    """Return the place on link k nearest to a point, from 0 to 1."""
    lx, ly = nodes[k + 1, 0] - nodes[k, 0], nodes[k + 1, 1] - nodes[k, 1]
    return min(max(((x - nodes[k, 0]) * lx + (y - nodes[k, 1]) * ly) / (lx * lx + ly * ly), 0.0), 1.0)


@compiled
def _move(k, fraction, nx, ny, share, nodes, s):
    """Return the slopes by y of a point of link k along (nx, ny), its largest move, and the linear model's error."""
    gu, gv, travel, remainder = 0.0, 0.0, 0.0, 0.0
    for j in range(k + 1):
        part = fraction if j == k else 1.0
        lx, ly = part * (nodes[j + 1, 0] - nodes[j, 0]), part * (nodes[j + 1, 1] - nodes[j, 1])
        across, turn = share * (ny * lx - nx * ly), share * s.turns[j]
        gu, gv = gu + across * s.slopes[j, 0], gv + across * s.slopes[j, 1]
        travel, remainder = travel + part * s.lengths[j] * turn, remainder + 0.5 * part * s.lengths[j] * turn * turn
    return gu, gv, travel, remainder


@compiled
def _to_ball(fraction, cx, cy, cz, obstacle, k, share, nodes, s):
    """Return the bound from the distance of a point of the link to the middle of a ball."""
    x = nodes[k, 0] + fraction * (nodes[k + 1, 0] - nodes[k, 0]) - cx
    y = nodes[k, 1] + fraction * (nodes[k + 1, 1] - nodes[k, 1]) - cy
    distance = np.sqrt(x * x + y * y + cz * cz)
    if not distance > 0.0:
        return _none()
    gu, gv, travel, remainder = _move(k, fraction, x / distance, y / distance, share, nodes, s)
    if not distance > travel:
        return _none()
    return distance - obstacle[RADIUS], gu, gv, remainder + 0.5 * travel * travel / (distance - travel)


@compiled
def _to_plane(k, plane, share, nodes, s):
    """Return the bound of the end of the link from a half-space."""
    nx, ny = plane[AXES], plane[AXES + 1]
    x, y = nodes[k + 1, 0] - plane[FIRST], nodes[k + 1, 1] - plane[FIRST + 1]
    gu, gv, _, remainder = _move(k, 1.0, nx, ny, share, nodes, s)
    return x * nx + y * ny - plane[FIRST + 2] * plane[AXES + 2], gu, gv, remainder


@compiled
def _to_side(which, k, box, share, nodes, s):
    """Return the bound of the end of the link, if it faces one side of the box in all of the cell."""
    x, y = nodes[k + 1, 0] - box[FIRST], nodes[k + 1, 1] - box[FIRST + 1]
    nx, ny = box[AXES + 3 * which], box[AXES + 3 * which + 1]
    out, aside = x * nx + y * ny, abs(x * ny - y * nx)
    sign = 1.0 if out > 0.0 else -1.0
    gu, gv, travel, remainder = _move(k, 1.0, sign * nx, sign * ny, share, nodes, s)
    if not (abs(out) > travel and aside + travel <= box[SECOND + 1 - which]):
        return _none()
    return abs(out) - box[SECOND + which], gu, gv, remainder


@compiled
def _to_corner(which, k, box, share, nodes, s):
    """Return the bound of a corner of the box, if the link passes between it and the box's middle.

    In all of the cell, the link meets the line from the corner to the middle of the box on the far side of the corner.
    """
    hx, hy = box[SECOND] if which % 2 == 0 else -box[SECOND], box[SECOND + 1] if which < 4 else -box[SECOND + 1]
    mx, my = box[FIRST] - nodes[k, 0], box[FIRST + 1] - nodes[k, 1]  # the middle
    vx, vy = mx + hx * box[AXES] + hy * box[AXES + 3], my + hx * box[AXES + 1] + hy * box[AXES + 4]
    length = s.lengths[k]
    ex, ey = (nodes[k + 1, 0] - nodes[k, 0]) / length, (nodes[k + 1, 1] - nodes[k, 1]) / length
    sign = 1.0 if ex * my - ey * mx > 0.0 else -1.0
    distance, middle, along = sign * (ex * vy - ey * vx), sign * (ex * my - ey * mx), ex * vx + ey * vy
    turn = share * s.turns[k]
    gu, gv, travel, _ = _move(k, 0.0, sign * ey, -sign * ex, share, nodes, s)
    least_middle, most = middle - travel - np.hypot(mx, my) * turn, travel + np.hypot(vx, vy) * turn
    if not least_middle > 0.0:
        return _none()
    beyond = max(most - distance, 0.0)
    aside = most + np.hypot(hx, hy) * beyond / (least_middle + beyond)
    if not (along >= aside and along + aside <= length):
        return _none()
    remainder = 0.5 * np.hypot(vx + nodes[k, 0], vy + nodes[k, 1]) * turn * turn
    for j in range(k):
        remainder += 0.5 * s.lengths[j] * (turn + share * s.turns[j]) ** 2
    gu, gv = gu - sign * along * share * s.slopes[k, 0], gv - sign * along * share * s.slopes[k, 1]
    return distance, gu, gv, remainder


@compiled
def _none():
    """Return the numbers for a missing witness: no bound."""
    return np.inf, 0.0, 0.0, 0.0
