"""All steps of a planar arm that reach the target to first order, compiled: p + N y, N orthonormal, orthogonal to p.

The displacement of Marcos et al. 2012, Eq. 17, is then a constant plus 2 ‖y − c‖² / Δt²: steps are given by the radius
ρ about the center c and, with two redundant degrees, the angle θ around it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.closed_loop.obstacle_distances import evaluate_distances
from paretoik.compilation import compiled, inlined

ERROR, RADIUS, SUM = range(3)  # the quantity that is minimised


class PlanarSteps(NamedTuple):
    """The steps of an arm with these link ``lengths`` [m] from one configuration, and the obstacles.

    ``base`` (dof,) are the joint positions after the shortest step, ``null_space`` (dof, r), ``center`` (r,) is c.
    ``obstacles``, ``bounding``, ``required`` and ``reach`` are those of ``StepConstraints``. In ``reference``, the
    configuration whose distances were evaluated last, the arm was clear of obstacles by at least ``margin`` (1,) [m].
    ``nodes`` (3 · nodes, cells), ``cells`` and ``distances`` (cells,) are for many configurations at once.
    """

    lengths: np.ndarray
    base: np.ndarray
    null_space: np.ndarray
    center: np.ndarray
    target: np.ndarray
    obstacles: np.ndarray
    bounding: np.ndarray
    required: float
    reach: np.ndarray
    reference: np.ndarray
    margin: np.ndarray
    nodes: np.ndarray
    cells: np.ndarray
    distances: np.ndarray


@compiled
def linearise(previous, home, target, s):
    """Write the shortest step from a configuration to a target, its null space and center."""
    lengths, n = s.lengths, s.lengths.shape[0]
    jacobian, tip = np.zeros((2, n)), np.zeros((n + 1, 2))
    angle = 0.0
    for k in range(n):
        angle += previous[k]
        tip[k + 1, 0] = tip[k, 0] + lengths[k] * np.cos(angle)
        tip[k + 1, 1] = tip[k, 1] + lengths[k] * np.sin(angle)
    for k in range(n):
        jacobian[0, k], jacobian[1, k] = -(tip[n, 1] - tip[k, 1]), tip[n, 0] - tip[k, 0]
    left, sizes, right = np.linalg.svd(jacobian)
    error_x, error_y = target[0] - tip[n, 0], target[1] - tip[n, 1]
    for k in range(n):
        s.base[k] = previous[k]
    for i in range(2):
        amount = (left[0, i] * error_x + left[1, i] * error_y) / sizes[i]
        s.target[i] = target[i]
        for k in range(n):
            s.base[k] += right[i, k] * amount
    for j in range(n - 2):
        s.center[j] = 0.0
        for k in range(n):
            s.null_space[k, j] = right[2 + j, k]
            s.center[j] -= 0.5 * s.null_space[k, j] * (s.base[k] - home[k])
    s.margin[0] = 0.0


@inlined
def configure(rho, theta, base, null_space, center, q):
    """Write the joint positions after a step."""
    if null_space.shape[1] == 1:  # one direction or the other
        first, second = (rho if theta < 1.0 else -rho), 0.0
    else:
        first, second = rho * np.cos(theta), rho * np.sin(theta)
    for k in range(base.shape[0]):
        q[k] = base[k]
    for j in range(null_space.shape[1]):
        y = center[j] + (first if j == 0 else second)
        for k in range(base.shape[0]):
            q[k] += null_space[k, j] * y


@inlined
def tool_error(q, s, column):
    """Write the arm's nodes to a column of ``s.nodes``; return the distance of the tip from the target (Eq. 18)."""
    x, y, angle = 0.0, 0.0, 0.0
    for k in range(s.lengths.shape[0]):
        angle += q[k]
        x += s.lengths[k] * np.cos(angle)
        y += s.lengths[k] * np.sin(angle)
        s.nodes[3 * k + 3, column], s.nodes[3 * k + 4, column] = x, y
    return np.hypot(x - s.target[0], y - s.target[1])


@inlined
def step_error(rho, theta, s, q):
    """Write the joint positions after a step; return the error of the tool there, inf where the arm is not clear."""
    configure(rho, theta, s.base, s.null_space, s.center, q)
    error = tool_error(q, s, 0)
    if s.obstacles.shape[0] == 0:
        return error
    travel = 0.0
    for k in range(q.shape[0]):
        travel += s.reach[k] * abs(q[k] - s.reference[k])
    margin = s.margin[0]
    if not travel < margin:  # the reference does not tell
        margin = _evaluate_margin(q, s)
    return error if margin > 0.0 else np.inf


@compiled
def _evaluate_margin(q, s):
    """Return by how much the arm is clear of obstacles at least, not positive where it is not; q is the reference."""
    for k in range(q.shape[0]):
        s.reference[k] = q[k]
    evaluate_distances(s.bounding, s.nodes, 1, s.distances)
    if not s.distances[0] > s.required:
        evaluate_distances(s.obstacles, s.nodes, 1, s.distances)
    s.margin[0] = s.distances[0] - s.required
    return s.margin[0]


@compiled
def evaluate_grid(radii, angles, s, q, errors):
    """Write the error of the tool after the steps of a grid, inf where the arm is not clear."""
    rows, columns = errors.shape
    for i in range(rows):
        for j in range(columns):
            configure(radii[i], angles[j], s.base, s.null_space, s.center, q)
            errors[i, j] = tool_error(q, s, i * columns + j)
    evaluate_distances(s.bounding, s.nodes, rows * columns, s.distances)
    near = 0
    for cell in range(rows * columns):
        if not s.distances[cell] > s.required:
            for m in range(s.nodes.shape[0]):
                s.nodes[m, near] = s.nodes[m, cell]
            s.cells[near] = cell
            near += 1
    evaluate_distances(s.obstacles, s.nodes, near, s.distances)
    for i in range(near):
        if not s.distances[i] > s.required:
            errors[s.cells[i] // columns, s.cells[i] % columns] = np.inf


@compiled
def merit(rho, error, quantity, ranges):
    """Return what is minimised of a step: its error, its radius, or the weighted sum of both objectives."""
    if quantity == ERROR or not error < np.inf:
        return error
    if quantity == RADIUS:
        return rho
    weight, largest_radius, smallest_error, width = ranges
    return weight * (rho / largest_radius) ** 2 + (1.0 - weight) * (error - smallest_error) / width  # Eqs. 19 and 20
