"""Cells of the null space, compiled: triangles or intervals.

They have lower bounds of the weighted sum of their steps. In a cell the error of the tool is its linear model about the
middle, plus a bounded remainder: a link that turns by δ leaves its tangent by at most ½ l δ². A weighted sum of ‖y‖²
and ‖e‖ is bounded below by the minimum of a convex function, the norm of the model and the tangent of ‖y‖². By duality
that is the largest, over directions in the plane, of the least over the corners. Both bounds are off by the square of
the cell's size.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.numba_cache import compiled
from studies.marcos_2012.null_space_steps import tool_error

BOUND, ADMISSIBLE = 6, 7  # columns of a cell after its three corners: its lower bound, whether all is admissible


class CellModel(NamedTuple):
    """The linear model of the tool's error in a cell, about its middle ``u``, ``v``.

    - ``error``: error at the middle [m]
    - ``x``, ``y`` (3,): error of the model at the corners [m]
    - ``squares`` (3,): tangent of ‖y‖² at the corners
    - ``remainder``: largest difference of the error in the cell from the model's [m]
    - ``size``: largest distance of a corner from the middle [rad]
    - ``travel``: largest move of a point of the arm from the middle to another step of the cell [m]
    - ``invertible``: whether the model is invertible in all of the cell: at most one step there reaches the target
    - ``change``: largest change of the second derivatives of ‖e‖ in the cell; inf if unknown
    """

    u: float
    v: float
    error: float
    x: tuple[float, float, float]
    y: tuple[float, float, float]
    squares: tuple[float, float, float]
    remainder: float
    size: float
    travel: float
    invertible: bool
    change: float


@compiled
def model(cell, s):
    """Return the model of a cell."""
    u, v = (cell[0] + cell[2] + cell[4]) / 3.0, (cell[1] + cell[3] + cell[5]) / 3.0
    if s.lengths.shape[0] == 3:
        u, v = 0.5 * (cell[0] + cell[2]), 0.0
    x, y, (xu, xv, yu, yv), _ = tool_error(u, v, s)
    u0, v0, u1, v1, u2, v2 = cell[0] - u, cell[1] - v, cell[2] - u, cell[3] - v, cell[4] - u, cell[5] - v
    remainder, travel = 0.0, 0.0
    for k in range(s.lengths.shape[0]):
        du, dv = s.slopes[k, 0], s.slopes[k, 1]
        turn = max(abs(du * u0 + dv * v0), abs(du * u1 + dv * v1), abs(du * u2 + dv * v2))
        remainder += 0.5 * s.lengths[k] * turn * turn
        travel += s.lengths[k] * turn
    square, error = u * u + v * v, np.hypot(x, y)
    size = np.sqrt(max(u0 * u0 + v0 * v0, u1 * u1 + v1 * v1, u2 * u2 + v2 * v2))
    slope, bend = np.sqrt(xu * xu + xv * xv + yu * yu + yv * yv), s.bends[0] * size
    steepest = slope + bend
    least = error - size * (slope + 0.5 * bend)
    third = 3.0 * steepest * s.bends[0] / least + 1.2 * steepest**3 / least**2 + s.bends[1]
    return CellModel(
        u,
        v,
        error,
        (x + xu * u0 + xv * v0, x + xu * u1 + xv * v1, x + xu * u2 + xv * v2),
        (y + yu * u0 + yv * v0, y + yu * u1 + yv * v1, y + yu * u2 + yv * v2),
        (square + 2.0 * (u * u0 + v * v0), square + 2.0 * (u * u1 + v * v1), square + 2.0 * (u * u2 + v * v2)),
        remainder,
        size,
        travel,
        abs(xu * yv - xv * yu) > bend * slope,
        third * size if least > 0.0 else np.inf,
    )


@compiled
def lower_bound(square_weight, error_weight, enough, m):
    """Return a lower bound of square_weight ‖y‖² + error_weight ‖e‖ over a cell.

    A bound of at least ``enough`` need not be the best that the model gives.
    """
    a = (square_weight * m.squares[0], square_weight * m.squares[1], square_weight * m.squares[2])
    x = (error_weight * m.x[0], error_weight * m.x[1], error_weight * m.x[2])
    y = (error_weight * m.y[0], error_weight * m.y[1], error_weight * m.y[2])
    error = error_weight * m.remainder
    best = max(min(a) - error, 0.0)
    middle_x, middle_y = x[0] + x[1] + x[2], y[0] + y[1] + y[2]
    best = max(best, _along(middle_x, middle_y, a, x, y) - error)
    for i in range(3):
        if best >= enough:
            return max(best, min(a))
        best = max(best, _along(x[i], y[i], a, x, y) - error)
    for i in range(3):
        j = (i + 1) % 3
        best = max(best, _between(i, j, a, x, y) - error)
    px, py, qx, qy = x[0] - x[1], y[0] - y[1], x[0] - x[2], y[0] - y[2]
    determinant = px * qy - py * qx
    if determinant != 0.0:
        b, c = a[1] - a[0], a[2] - a[0]
        ux, uy = (b * qy - c * py) / determinant, (c * px - b * qx) / determinant
        if ux * ux + uy * uy <= 1.0:
            best = max(best, _least(ux, uy, a, x, y) - error)
    return max(best, min(a))


@compiled
def _least(ux, uy, a, x, y):
    """Return the least of a + uᵀ e over the corners."""
    return min(a[0] + ux * x[0] + uy * y[0], a[1] + ux * x[1] + uy * y[1], a[2] + ux * x[2] + uy * y[2])


@compiled
def _along(dx, dy, a, x, y):
    """Return the same least for the unit vector along (dx, dy); for 0, the least of a."""
    norm = np.hypot(dx, dy)
    return _least(dx / norm, dy / norm, a, x, y) if norm > 0.0 else min(a)


@compiled
def _between(i, j, a, x, y):
    """Return the same least for the unit vector that makes two corners equal, if it exists."""
    px, py = x[i] - x[j], y[i] - y[j]
    norm = np.hypot(px, py)
    if not norm > 0.0:
        return -np.inf
    px, py = px / norm, py / norm
    along = (a[j] - a[i]) / norm
    if not abs(along) <= 1.0:
        return -np.inf
    across = np.sqrt(1.0 - along * along)
    if px * y[i] - py * x[i] < 0.0:
        across = -across
    return _least(along * px - across * py, along * py + across * px, a, x, y)


@compiled
def place_region(count, s):
    """Write the cells between the origin, or another step, and the ``count`` corners of the region; return how many."""
    corners, u, v = s.corners[0], 0.0, 0.0
    if not _has_origin(count, corners):
        for i in range(count):
            u, v = u + corners[i, 0] / count, v + corners[i, 1] / count
    for i in range(count):
        j = (i + 1) % count if count > 2 else i
        cell = s.cells[i]
        cell[0], cell[1], cell[2], cell[3] = u, v, corners[i, 0], corners[i, 1]
        cell[4], cell[5], cell[BOUND] = corners[j, 0], corners[j, 1], -np.inf
        cell[ADMISSIBLE] = 1.0 if s.constraints.obstacles.shape[0] == 0 else 0.0
    return count


@compiled
def _has_origin(count, corners):
    """Return whether the origin is in a convex polygon, or an interval, within rounding."""
    if count <= 2:
        return corners[0, 0] <= 0.0 <= corners[count - 1, 0]
    for i in range(count):
        j = (i + 1) % count
        if corners[i, 0] * corners[j, 1] - corners[i, 1] * corners[j, 0] < 0.0:
            return False
    return True


@compiled
def halve(i, j, s):
    """Replace cell i by its halves across the longest edge, the other is cell j; return the middle of that edge."""
    first, second = s.cells[i], s.cells[j]
    a, longest = 0, -1.0
    for k in range(3):
        b = (k + 1) % 3
        length = (first[2 * k] - first[2 * b]) ** 2 + (first[2 * k + 1] - first[2 * b + 1]) ** 2
        if length > longest:
            a, longest = k, length
    b = (a + 1) % 3
    u, v = 0.5 * (first[2 * a] + first[2 * b]), 0.5 * (first[2 * a + 1] + first[2 * b + 1])
    for m in range(first.shape[0]):
        second[m] = first[m]
    first[2 * a], first[2 * a + 1], second[2 * b], second[2 * b + 1] = u, v, u, v
    if s.lengths.shape[0] == 3:
        first[4], first[5], second[4], second[5] = first[2], first[3], second[2], second[3]
    return u, v


@compiled
def contains(cell, u, v, s):
    """Return whether a cell contains a point."""
    if s.lengths.shape[0] == 3:
        return min(cell[0], cell[2]) <= u <= max(cell[0], cell[2])
    left, right = 0, 0
    for i in range(3):
        j = (i + 1) % 3
        du, dv = cell[2 * j] - cell[2 * i], cell[2 * j + 1] - cell[2 * i + 1]
        turn = du * (v - cell[2 * i + 1]) - dv * (u - cell[2 * i])
        left, right = left + int(turn > 0.0), right + int(turn < 0.0)
    return left == 0 or right == 0
