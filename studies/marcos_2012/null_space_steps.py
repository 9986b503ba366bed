"""Compiled steps of a planar arm that reach the target to first order, in coordinates of the null space.

Joint positions after a step are q = origin + N y, with N orthonormal. The origin is the step of least displacement, so
that the displacement of Marcos et al. 2012, Eq. 17, is a constant plus 2 ‖y‖² / Δt². With one redundant degree the
second coordinate is 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.closed_loop.admissible_steps import find_inadmissible
from paretoik.closed_loop.control_step import EngineOptions
from paretoik.closed_loop.programs import StepConstraints, StepStart, Workspace
from paretoik.compilation.numba_cache import compiled


class PlanarSteps(NamedTuple):
    """The steps of an arm from one configuration; ``linearise`` writes them.

    - ``lengths``: lengths of the links [m]
    - ``origin`` (dof,), ``null_space`` (dof, 2): those of q = origin + N y
    - ``angles`` (dof,), ``slopes`` (dof, 2): the same for the links' angles with the x-axis [rad]
    - ``target`` (2,): target of the tool [m]
    - ``bends`` (2,): bounds of the second and third derivatives of the error along y [m]
    - ``corners`` (2, 2 · dof + 4, 2): corners of the region of y from ``write_region``, and of the polygon before
      clipping
    - ``start``, ``constraints``, ``options``, ``workspace``: those of the search, for one step
    - ``clearance`` (1,): clearance before the step [m]
    - ``cells`` (cells, 8): parts of the region: three corners, a lower bound, and 1 if all is admissible
    - ``polygons`` (2, corners, 5), ``cuts`` (cuts, 4), ``nodes`` (2, dof + 1, 2), ``turns`` (dof,): those of
      ``obstacle_cuts``
    """

    lengths: np.ndarray
    origin: np.ndarray
    null_space: np.ndarray
    angles: np.ndarray
    slopes: np.ndarray
    target: np.ndarray
    bends: np.ndarray
    corners: np.ndarray
    start: StepStart
    constraints: StepConstraints
    options: EngineOptions
    workspace: Workspace
    clearance: np.ndarray
    cells: np.ndarray
    polygons: np.ndarray
    cuts: np.ndarray
    nodes: np.ndarray
    turns: np.ndarray


@compiled
def linearise(home, target, s):
    """Write the steps from ``s.start.previous`` to a target [m]; ``home`` is the beginning of the loop.

    Return whether there are any: there are none if the arm is singular.
    """
    previous, lengths = s.start.previous, s.lengths
    n = lengths.shape[0]
    jacobian = np.zeros((2, n))
    x, y, angle = 0.0, 0.0, 0.0
    for k in range(n):
        angle += previous[k]
        dx, dy = lengths[k] * np.cos(angle), lengths[k] * np.sin(angle)
        x, y = x + dx, y + dy
        for j in range(k + 1):
            jacobian[0, j] -= dy
            jacobian[1, j] += dx
    left, sizes, right = np.linalg.svd(jacobian)
    if not sizes[1] > s.options.singular_ratio * sizes[0]:
        return False
    s.target[:] = target
    s.origin[:] = previous
    for i in range(2):
        amount = (left[0, i] * (target[0] - x) + left[1, i] * (target[1] - y)) / sizes[i]
        for k in range(n):
            s.origin[k] += right[i, k] * amount
    for j in range(n - 2):
        center = 0.0
        for k in range(n):
            s.null_space[k, j] = right[2 + j, k]
            center -= 0.5 * right[2 + j, k] * (s.origin[k] - home[k])  # the minimum of Eq. 17
        for k in range(n):
            s.origin[k] += center * right[2 + j, k]
    for k in range(n):
        before = s.angles[k - 1] if k > 0 else 0.0
        s.angles[k] = before + s.origin[k]
        for j in range(2):
            before = s.slopes[k - 1, j] if k > 0 else 0.0
            s.slopes[k, j] = before + s.null_space[k, j]
    s.bends[:] = 0.0
    for k in range(n):
        slope = np.hypot(s.slopes[k, 0], s.slopes[k, 1])
        s.bends[0] += lengths[k] * slope**2
        s.bends[1] += lengths[k] * slope**3
    return True


@compiled
def configure(u, v, s, q):
    """Write the joint positions after the step y = (u, v)."""
    for k in range(s.origin.shape[0]):
        q[k] = s.origin[k] + s.null_space[k, 0] * u + s.null_space[k, 1] * v


@compiled
def tool_error(u, v, s):
    """Return e_x and e_y [m] of the tool after a step (Eq. 18), with first and second derivatives by u and v."""
    x, y, xu, xv, yu, yv = -s.target[0], -s.target[1], 0.0, 0.0, 0.0, 0.0
    xuu, xuv, xvv, yuu, yuv, yvv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(s.lengths.shape[0]):
        du, dv = s.slopes[k, 0], s.slopes[k, 1]
        angle = s.angles[k] + du * u + dv * v
        dx, dy = s.lengths[k] * np.cos(angle), s.lengths[k] * np.sin(angle)
        x, y = x + dx, y + dy
        xu, xv, yu, yv = xu - dy * du, xv - dy * dv, yu + dx * du, yv + dx * dv
        xuu, xuv, xvv = xuu - dx * du * du, xuv - dx * du * dv, xvv - dx * dv * dv
        yuu, yuv, yvv = yuu - dy * du * du, yuv - dy * du * dv, yvv - dy * dv * dv
    return x, y, (xu, xv, yu, yv), (xuu, xuv, xvv, yuu, yuv, yvv)


@compiled
def error_at(u, v, s):
    """Return the error of the tool after a step [m]."""
    x, y, _, _ = tool_error(u, v, s)
    return np.hypot(x, y)


@compiled
def weighted_sum(square_weight, error_weight, u, v, s):
    """Return square_weight ‖y‖² + error_weight ‖e‖ with first and second derivatives by u and v.

    With one redundant degree it counts as square_weight v² in v.
    """
    x, y, (xu, xv, yu, yv), (xuu, xuv, xvv, yuu, yuv, yvv) = tool_error(u, v, s)
    error = np.hypot(x, y)
    share = 1.0 / error if error > 0.0 else 0.0  # an error of 0 has no direction
    nx, ny = x * share, y * share
    eu, ev = nx * xu + ny * yu, nx * xv + ny * yv
    pu, pv = nx * yu - ny * xu, nx * yv - ny * xv  # orthogonal to the error
    euu, euv, evv = nx * xuu + ny * yuu, nx * xuv + ny * yuv, nx * xvv + ny * yvv
    w, z = 2.0 * square_weight, error_weight
    value = square_weight * (u * u + v * v) + z * error
    gradient = w * u + z * eu, w * v + z * ev
    across = z * share
    return value, gradient, (w + across * pu * pu + z * euu, across * pu * pv + z * euv, w + across * pv * pv + z * evv)


@compiled
def is_admissible(u, v, s):
    """Return whether a step is within the joints' bounds and clear of obstacles."""
    w = s.workspace
    w.pending[0] = 0
    configure(u, v, s, w.inputs[:, 0])
    return find_inadmissible(1, s.start, s.constraints, s.clearance[0], s.options, w) == 0


@compiled
def write_region(farthest, s):
    """Write the corners of the region of y within the joints' bounds and ± ``farthest`` [rad]; return how many."""
    corners, spare = s.corners[0], s.corners[1]
    plane = s.lengths.shape[0] > 3
    count = 4 if plane else 2
    for i in range(count):
        corners[i, 0] = farthest if i in (1, 2) else -farthest
        corners[i, 1] = (farthest if i > 1 else -farthest) if plane else 0.0
    for k in range(s.origin.shape[0]):
        moved = s.origin[k] - s.start.previous[k]
        for sign, bound in ((1.0, s.constraints.upper[k] - moved), (-1.0, moved - s.constraints.lower[k])):
            if bound < np.inf:
                count = clip(corners, count, sign * s.null_space[k, 0], sign * s.null_space[k, 1], bound, spare)
    return count


@compiled
def clip(corners, count, a, b, bound, spare):
    """Cut a convex polygon, or an interval of two corners, by a u + b v ≤ bound; return how many corners remain.

    Rows of corners begin with u and v; the other columns are linear in them.
    """
    remaining = 0
    for i in range(count):
        spare[i] = corners[i]
    for i in range(count):
        j = (i + 1) % count
        here = a * spare[i, 0] + b * spare[i, 1] - bound
        there = a * spare[j, 0] + b * spare[j, 1] - bound
        if here <= 0.0:
            corners[remaining] = spare[i]
            remaining += 1
        if (here < 0.0 < there or there < 0.0 < here) and not (count == 2 and i == 1):
            share = here / (here - there)
            for m in range(corners.shape[1]):
                corners[remaining, m] = spare[i, m] + share * (spare[j, m] - spare[i, m])
            remaining += 1
    return remaining
