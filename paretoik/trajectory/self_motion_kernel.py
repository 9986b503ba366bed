"""Numerical steps on motions: stencils, self-motion, retraction; compiled.

Stencils are finite differences; retraction moves motions onto the path. The variables u of an instant, its position and
rates, are sums over the samples ``neighbours`` (instants, width) with ``coefficients`` (orders, instants, width). The
unknowns of a sample are steps along its ``tangent`` (time, dof, unknowns), the null space of the tasks' Jacobian. They
begin at ``first_unknown`` (time,); −1 is a fixed sample.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.linear_algebra import eliminate


class RetractionOptions(NamedTuple):
    """Settings of Newton's method back onto the path."""

    tolerance: float = 1e-12  # largest error of the path equations, in arm lengths and rad: rounding error
    steps: int = 8  # largest number of steps: Newton's method squares errors; more steps mean another sheet


OPTIONS = RetractionOptions()


@compiled
def apply_stencil(q, neighbours, coefficients, u):
    """Write the variables (orders · dof, instants) of q (time, dof)."""
    orders, samples, width = coefficients.shape
    n = q.shape[1]
    for o in range(orders):
        for j in range(n):
            for i in range(samples):
                total = 0.0
                for k in range(width):
                    total += coefficients[o, i, k] * q[neighbours[i, k], j]
                u[o * n + j, i] = total


@compiled
def add_transposed_stencil(gradient_u, scale, neighbours, coefficients, gradient_q):
    """Add the gradient by q (time, dof) from one by u.

    The gradient by u is (variables, instants), and is multiplied by ``scale`` (instants,).
    """
    orders, samples, width = coefficients.shape
    n = gradient_q.shape[1]
    for o in range(orders):
        for j in range(n):
            for i in range(samples):
                g = gradient_u[o * n + j, i] * scale[i]
                if g != 0.0:
                    for k in range(width):
                        gradient_q[neighbours[i, k], j] += coefficients[o, i, k] * g


@compiled
def project_gradient(gradient_q, tangent, first_unknown, reduced):
    """Write the gradient by the unknowns from one by q."""
    samples, n, r = tangent.shape
    for i in range(len(reduced)):
        reduced[i] = 0.0
    for s in range(samples):
        if first_unknown[s] >= 0:
            for a in range(r):
                for j in range(n):
                    reduced[first_unknown[s] + a] += tangent[s, j, a] * gradient_q[s, j]


@compiled
def expand_motion_step(step, tangent, first_unknown, dq):
    """Write q's change (time, dof) along a step; return its largest entry."""
    samples, n, r = tangent.shape
    longest = 0.0
    for s in range(samples):
        for j in range(n):
            dq[s, j] = 0.0
            if first_unknown[s] >= 0:
                for a in range(r):
                    dq[s, j] += tangent[s, j, a] * step[first_unknown[s] + a]
            longest = max(longest, abs(dq[s, j]))
    return longest


@compiled
def local_basis(i, neighbours, coefficients, tangent, chain, local):
    """Write the derivatives of instant i's u by its neighbours' unknowns.

    They are (variables, width · unknowns). ``chain`` (states, states, instants) has the derivatives of u by the
    spline's u; it is empty if both are equal. If there is space, the spline's u follows u.
    """
    orders, _, width = coefficients.shape
    n, r = tangent.shape[1], tangent.shape[2]
    for o in range(orders):
        for k in range(width):
            for j in range(n):
                for a in range(r):
                    local[o * n + j, k * r + a] = coefficients[o, i, k] * tangent[neighbours[i, k], j, a]
    states = orders * n
    if chain.shape[2]:
        spline = local[:states].copy()
        for a in range(states):
            local[a] = 0.0
            for m in range(states):
                if chain[a, m, i] != 0.0:
                    for b in range(local.shape[1]):
                        local[a, b] += chain[a, m, i] * spline[m, b]
        if len(local) > states:
            local[states:] = spline


@compiled
def add_hessian(i, phi, stencil, tangent, chain, local, half, matrix):
    """Add the Hessian ``phi`` by u of instant i to ``matrix``.

    ``matrix`` is the Hessian of the unknowns, (A, B, C), banded with a border. ``stencil`` has ``neighbours``,
    ``coefficients`` and ``first_unknown``.
    """
    (neighbours, coefficients, first_unknown), (A, B, C) = stencil, matrix
    width, r, size = coefficients.shape[2], tangent.shape[2], A.shape[0]
    local_basis(i, neighbours, coefficients, tangent, chain, local)
    for a in range(local.shape[0]):
        for b in range(local.shape[1]):
            half[a, b] = 0.0
        for m in range(local.shape[0]):
            if phi[a, m] != 0.0:
                for b in range(local.shape[1]):
                    half[a, b] += phi[a, m] * local[m, b]
    for k in range(width):
        if first_unknown[neighbours[i, k]] < 0:
            continue
        for h in range(width):
            if first_unknown[neighbours[i, h]] < 0:
                continue
            for a in range(r):
                for b in range(r):
                    row, column = first_unknown[neighbours[i, k]] + a, first_unknown[neighbours[i, h]] + b
                    if row < column:
                        continue
                    total = 0.0
                    for m in range(local.shape[0]):
                        total += local[m, k * r + a] * half[m, h * r + b]
                    if row < size:
                        A[row, row - column] += total
                    elif column < size:
                        B[row - size, column] += total
                    else:
                        C[row - size, column - size] += total
                        if row != column:
                            C[column - size, row - size] += total


@compiled
def add_path_hessian(seconds, tangent, first_unknown, A, C):
    """Add second derivatives by q of samples to the unknowns' Hessian.

    They are (dof², time).
    """
    samples, n, r = tangent.shape
    for s in range(samples):
        begin, size = first_unknown[s], A.shape[0]
        for a in range(r if begin >= 0 else 0):
            for b in range(r):
                total = 0.0
                for i in range(n):
                    for j in range(n):
                        total += tangent[s, i, a] * seconds[i * n + j, s] * tangent[s, j, b]
                if begin >= size:
                    C[begin - size + a, begin - size + b] += total
                elif b <= a:
                    A[begin + a, a - b] += total


@compiled
def tangent_frames(tracked, tangent, normal, triangle):
    """Write orthonormal bases of the Jacobians' null and row space.

    The Jacobians are those of the tasks at all samples. R of Jᵀ = Y R is written too. ``tracked`` has path equations
    and Jacobian entries (rows + rows · dof, time). Householder reflections are used. Returns False at a singularity.
    """
    samples, n, rows = normal.shape
    work, basis, v = np.empty((n, rows)), np.empty((n, n)), np.empty(n)
    for s in range(samples):
        for j in range(n):
            for i in range(rows):
                work[j, i] = tracked[rows + i * n + j, s]
            for i in range(n):
                basis[i, j] = 1.0 if i == j else 0.0
        for i in range(rows):
            size = 0.0
            for j in range(i, n):
                size += work[j, i] ** 2
            size = np.sqrt(size)
            if not size > 1e-9:
                return False
            for j in range(i, n):
                v[j] = work[j, i]
            v[i] += size if work[i, i] >= 0 else -size
            square = 0.0
            for j in range(i, n):
                square += v[j] ** 2
            for c in range(i, rows):
                _reflect(work[:, c], v, i, square)
            for c in range(n):
                _reflect(basis[c], v, i, square)
        for j in range(n):
            for i in range(rows):
                normal[s, j, i] = basis[j, i]
            for i in range(rows, n):
                tangent[s, j, i - rows] = basis[j, i]
        for i in range(rows):
            for c in range(i, rows):
                triangle[s, i, c] = work[i, c]
    return True


@compiled
def tie_last_sample(tangent, normal):
    """Write the tangent of the last sample, if it depends on another.

    It is the posture on the path nearest to the sample before.
    """
    _, n, r = tangent.shape
    for a in range(r):
        for j in range(n):
            tangent[-1, j, a] = tangent[-2, j, a]
        for i in range(normal.shape[2]):
            along = 0.0
            for j in range(n):
                along += normal[-1, j, i] * tangent[-2, j, a]
            for j in range(n):
                tangent[-1, j, a] -= along * normal[-1, j, i]


@compiled
def _reflect(x, v, begin, square):
    dot = 0.0
    for j in range(begin, len(x)):
        dot += x[j] * v[j]
    for j in range(begin, len(x)):
        x[j] -= 2 * dot / square * v[j]


@compiled
def retract_motion(track, inputs, q, normal, triangle, tracked):
    """Move q (time, dof) back onto the path; return whether it succeeded.

    Newton's method moves each sample along ``normal``; it must converge for all samples. If a sample crosses a fold to
    another sheet of the self-motion manifold, it has not converged.
    """
    samples, n, rows = normal.shape
    matrix, right = np.empty((rows, rows)), np.empty(rows)
    for attempt in range(OPTIONS.steps):
        for j in range(n):
            for s in range(samples):
                inputs[j, s] = q[s, j]
        run(track, inputs, tracked)
        worst = 0.0
        for i in range(rows):
            for s in range(samples):
                worst = max(worst, abs(tracked[i, s]))
        if worst <= OPTIONS.tolerance:
            return True
        if not worst < 1.0 or attempt == OPTIONS.steps - 1:
            return worst <= 100 * OPTIONS.tolerance  # long arms have larger rounding errors than the tolerance
        for s in range(samples):
            for i in range(rows):
                right[i] = tracked[i, s]
                for c in range(rows):
                    total = 0.0
                    for j in range(n):
                        total += tracked[rows + i * n + j, s] * normal[s, j, c]
                    matrix[i, c] = total
            if not eliminate(matrix, right, triangle[s]):
                return False
            for j in range(n):
                for c in range(rows):
                    q[s, j] -= normal[s, j, c] * right[c]
    return False


@compiled
def path_multipliers(gradient_q, normal, triangle, multipliers):
    """Write the path's multipliers ν (rows, time).

    They satisfy Jᵀ ν = −(gradient in the row space of J).
    """
    samples, n, rows = normal.shape
    for s in range(samples):
        for i in range(rows - 1, -1, -1):
            y = 0.0
            for j in range(n):
                y -= normal[s, j, i] * gradient_q[s, j]
            for a in range(i + 1, rows):
                y -= triangle[s, i, a] * multipliers[a, s]
            multipliers[i, s] = y / triangle[s, i, i]
