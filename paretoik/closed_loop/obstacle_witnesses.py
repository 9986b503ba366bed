"""Compiled upper bounds of the distance of a link from an obstacle, over a cell of steps.

They are linear, plus a remainder. The distance of a fixed point of a link from a fixed point of an obstacle is an upper
bound. Next to a box that is upright in the plane, a joint is as far away as from the side that it faces, and a link
that passes a corner as far as the corner is from its line. Both are signed, so that they also show steps which the box
blocks. A bound is valid for all steps of the cell that are clear. The remainder has the order of the square of the
cell's size.
"""

from __future__ import annotations

import numpy as np

from paretoik.closed_loop.programs import AXES, FIRST, KIND, POINT, RADIUS, SECOND, SEGMENT
from paretoik.compilation.numba_cache import compiled


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
