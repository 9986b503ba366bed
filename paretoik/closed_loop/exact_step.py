"""The best step of an extended Jacobian, exactly: compiled, for planar arms of one or two redundant degrees.

Both objectives of Marcos et al. 2012 (Eqs. 17 and 18) are evaluated on a grid over all steps; its best cells are
minimised further. ``null_space_steps`` has the coordinates.
"""

from __future__ import annotations

import numpy as np

from paretoik.closed_loop.null_space_steps import ERROR, RADIUS, SUM, evaluate_grid, linearise, merit, step_error
from paretoik.closed_loop.step_minimisers import minimise_along, nelder_mead, newton
from paretoik.compilation import compiled


@compiled(what="the exact control step", seconds=10)
def best_steps(targets, weight, options, s, q):
    """Write the joint positions (time, dof) of the best steps from the first; return how many samples they reach."""
    for k in range(1, targets.shape[0]):
        if not best_step(q[k - 1], q[0], targets[k], weight, options, s, q[k]):
            return k
    return targets.shape[0]


@compiled
def best_step(previous, home, target, weight, options, s, q):
    """Write the best step's joint positions to ``q``; return whether there is one that is clear of obstacles.

    ``options`` are the ``ExactStepOptions``, ``s`` the ``PlanarSteps`` of the arm, to write to.
    """
    linearise(previous, home, target, s)
    if weight >= 1.0 and step_error(0.0, 0.0, s, q) < np.inf:
        return True
    radii, angles = _grid(options, s.lengths.shape[0])
    errors, merits = np.zeros((radii.shape[0], angles.shape[0])), np.zeros((radii.shape[0], angles.shape[0]))
    evaluate_grid(radii, angles, s, q, errors)
    none = (0.0, 1.0, 0.0, 1.0)
    nearest, rho, theta = 0.0, 0.0, 0.0
    if not errors[0, 0] < np.inf:
        nearest, rho, theta = _minimise(RADIUS, none, options, s, q, errors, merits, radii, angles)
    if not nearest < np.inf:
        return False
    largest_error = step_error(rho, theta, s, q)
    if weight < 1.0:
        smallest_error, far, far_theta = 0.0, np.inf, 0.0
        if s.lengths.shape[0] == 4:
            far, far_theta = _reach_target(options, s, q, errors, merits, radii, angles)
        if not far < np.inf:
            smallest_error, far, far_theta = _minimise(ERROR, none, options, s, q, errors, merits, radii, angles)
        if weight <= 0.0:
            rho, theta = far, far_theta
        elif far > rho and largest_error > smallest_error:
            ranges = (weight, np.sqrt(far**2 - rho**2), smallest_error, largest_error - smallest_error)
            _, rho, theta = _minimise(SUM, ranges, options, s, q, errors, merits, radii, angles)
    step_error(rho, theta, s, q)
    return True


@compiled
def _grid(options, dof):
    """Return the radii of a grid, evenly in their logarithm up to ``fine_radius``, then evenly, and its angles."""
    fine, coarse = (options.fine_radii, options.coarse_radii)
    columns = 2
    if dof == 4:
        fine, coarse, columns = options.fine_radii_4r, options.coarse_radii_4r, options.angles
    radii, angles = np.zeros(1 + fine + coarse), np.zeros(columns)
    for i in range(fine):
        radii[i + 1] = options.nearest_radius * (options.fine_radius / options.nearest_radius) ** (i / (fine - 1))
    for i in range(coarse):
        radii[i + 1 + fine] = options.fine_radius + (options.farthest_radius - options.fine_radius) * (i + 1) / coarse
    for j in range(columns):
        angles[j] = 2.0 * np.pi * j / columns
    return radii, angles


@compiled
def _minimise(quantity, ranges, options, s, q, errors, merits, radii, angles):
    """Return (merit, ρ, θ) of the minimum: the best cells of the grid, minimised further."""
    rows, columns = radii.shape[0], angles.shape[0]
    for i in range(rows):
        for j in range(columns):
            merits[i, j] = merit(radii[i], errors[i, j], quantity, ranges)
    best, rho, theta = merits[0, 0], 0.0, 0.0
    simplex = np.zeros((3, 3))
    for _ in range(options.cells if columns == 2 else options.cells_4r):
        row, column = _lowest_cell(merits)
        if row < 0:
            break
        at_cell, low, high = merits[row, column], radii[max(row - 1, 0)], radii[min(row + 1, rows - 1)]
        angle = angles[column]
        merits[row, column] = np.inf
        if columns == 2:
            value, place = minimise_along(low, high, angle, quantity, ranges, options, s, q)
        else:
            size = 0.5 * (high - low)
            value, place, angle = nelder_mead(radii[row], angle, size, quantity, ranges, options, s, q, simplex)
        if at_cell < min(best, value):
            best, rho, theta = at_cell, radii[row], angles[column]
        elif value < best:
            best, rho, theta = value, place, angle
    return best, rho, theta


@compiled
def _lowest_cell(merits):
    """Return (row, column) of the lowest cell that is no higher than its neighbours; −1 for none."""
    row, column, lowest = -1, -1, np.inf
    for i in range(merits.shape[0]):
        for j in range(merits.shape[1]):
            if merits[i, j] < lowest and _is_local_minimum(merits, i, j):
                row, column, lowest = i, j, merits[i, j]
    return row, column


@compiled
def _is_local_minimum(merits, i, j):
    """Return whether no neighbour of a cell is lower; angles are periodic."""
    rows, columns = merits.shape
    for k in (-1, 1):
        if 0 <= i + k < rows and merits[i + k, j] < merits[i, j]:
            return False
        if columns > 2 and merits[i, (j + k) % columns] < merits[i, j]:
            return False
    return True


@compiled
def _reach_target(options, s, q, errors, merits, radii, angles):
    """Return (ρ, θ) of the nearest clear step of two redundant degrees that hits the target; ρ is inf without one.

    Newton's method starts from every local minimum of the grid.
    """
    nearest, nearest_theta = np.inf, 0.0
    for i in range(radii.shape[0]):
        for j in range(angles.shape[0]):
            merits[i, j] = errors[i, j]
    for i in range(1, radii.shape[0]):
        for j in range(angles.shape[0]):
            if not errors[i, j] < np.inf or not _is_local_minimum(merits, i, j):
                continue
            error, rho, theta = newton(radii[i], angles[j], options, s)
            is_nearer = error < options.error_tolerance and rho < min(nearest, options.farthest_radius)
            if is_nearer and step_error(rho, theta, s, q) < np.inf:
                nearest, nearest_theta = rho, theta
    return nearest, nearest_theta
