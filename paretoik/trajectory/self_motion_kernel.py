"""Numerical steps on motions: stencils, self-motion, retraction onto the path; compiled.

The variables u of an instant, its position and rates, are sums over samples (``Stencil``). The unknowns of a sample are
steps along its ``tangent`` (time, dof, unknowns), the null space of the tasks' Jacobian.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.linear_algebra import clear, eliminate


class RetractionOptions(NamedTuple):
    """Settings of Newton's method back onto the path."""

    tolerance: float = 1e-12  # largest error of the path equations, in arm lengths and rad: rounding error
    steps: int = 8  # largest number of steps: Newton's method squares errors; more steps mean another sheet


OPTIONS = RetractionOptions()


@compiled
def apply_stencil(stencil, q, u):
    """Write the variables (orders · dof, instants) of q (time, dof)."""
    neighbours, coefficients = stencil.neighbours, stencil.coefficients
    (orders, samples, width), n = coefficients.shape, q.shape[1]
    for o in range(orders):
        for j in range(n):
            for i in range(samples):
                total = 0.0
                for k in range(width):
                    total += coefficients[o, i, k] * q[neighbours[i, k], j]
                u[o * n + j, i] = total


@compiled
def add_transposed_stencil(stencil, gradient_u, scale, gradient_q):
    """Add the gradient by q from one by u, times ``scale`` (instants,)."""
    neighbours, coefficients = stencil.neighbours, stencil.coefficients
    (orders, samples, width), n = coefficients.shape, gradient_q.shape[1]
    for o in range(orders):
        for j in range(n):
            for i in range(samples):
                g = gradient_u[o * n + j, i] * scale[i]
                if g != 0.0:
                    for k in range(width):
                        gradient_q[neighbours[i, k], j] += coefficients[o, i, k] * g


@compiled
def project_gradient(stencil, gradient_q, tangent, reduced):
    """Write the gradient by the unknowns from one by q."""
    (samples, n, r), first_unknown = tangent.shape, stencil.first_unknown
    reduced[:] = 0.0
    for s in range(samples):
        if first_unknown[s] >= 0:
            for a in range(r):
                for j in range(n):
                    reduced[first_unknown[s] + a] += tangent[s, j, a] * gradient_q[s, j]


@compiled
def expand_motion_step(stencil, step, tangent, dq):
    """Write q's change (time, dof) along a step; return its largest entry."""
    (samples, n, r), first_unknown = tangent.shape, stencil.first_unknown
    longest = 0.0
    clear(dq[:samples])
    for s in range(samples):
        for j in range(n):
            if first_unknown[s] >= 0:
                for a in range(r):
                    dq[s, j] += tangent[s, j, a] * step[first_unknown[s] + a]
            longest = max(longest, abs(dq[s, j]))
    return longest


@compiled
def local_basis(stencil, i, tangent, chain, local):
    """Write the derivatives of instant i's u by its neighbours' unknowns.

    They are (variables, width · unknowns). ``chain`` (states, states, instants) has the derivatives of u by the
    spline's u, or is empty if both are equal. If there is space, the spline's u follows u.
    """
    neighbours, coefficients = stencil.neighbours, stencil.coefficients
    (orders, _, width), (_, n, r) = coefficients.shape, tangent.shape
    for o in range(orders):
        for k in range(width):
            for j in range(n):
                for a in range(r):
                    local[o * n + j, k * r + a] = coefficients[o, i, k] * tangent[neighbours[i, k], j, a]
    states = orders * n
    if chain.shape[2]:
        spline = local[:states].copy()
        clear(local[:states])
        for a in range(states):
            for m in range(states):
                if chain[a, m, i] != 0.0:
                    for b in range(local.shape[1]):
                        local[a, b] += chain[a, m, i] * spline[m, b]
        if len(local) > states:
            local[states:] = spline


@compiled
def add_hessian(stencil, i, phi, tangent, chain, local, half, matrix):
    """Add instant i's Hessian by u to the unknowns' (A, B, C)."""
    (A, B, C), first_unknown, neighbours = matrix, stencil.first_unknown, stencil.neighbours
    width, r, size = neighbours.shape[1], tangent.shape[2], A.shape[0]
    local_basis(stencil, i, tangent, chain, local)
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
def add_path_hessian(stencil, seconds, tangent, A, C):
    """Add samples' second derivatives by q (dof², time) to the unknowns' Hessian."""
    samples, n, r = tangent.shape
    for s in range(samples):
        begin, size = stencil.first_unknown[s], A.shape[0]
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
    """Write bases of all Jacobians' null space and row space Y.

    R of Jᵀ = Y R is written too, by Householder reflections. ``tracked`` has path equations and Jacobian entries
    (rows + rows · dof, time). Returns False at a singularity.
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
            v[i:] = work[i:, i]
            v[i] += size if work[i, i] >= 0 else -size
            square = 0.0
            for j in range(i, n):
                square += v[j] ** 2
            for c in range(i, rows):
                _reflect(work[:, c], v, i, square)
            for c in range(n):
                _reflect(basis[c], v, i, square)
        normal[s], tangent[s] = basis[:, :rows], basis[:, rows:]
        for i in range(rows):
            triangle[s, i, i:] = work[i, i:]
    return True


@compiled
def tie_last_sample(tangent, normal):
    """Write the tangent of a last sample nearest to the one before."""
    _, n, r = tangent.shape
    for a in range(r):
        tangent[-1, :, a] = tangent[-2, :, a]
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
        inputs[:n] = q[:samples].T
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
    """Write ν (rows, time): Jᵀ ν = −(gradient in J's row space)."""
    samples, n, rows = normal.shape
    for s in range(samples):
        for i in range(rows - 1, -1, -1):
            y = 0.0
            for j in range(n):
                y -= normal[s, j, i] * gradient_q[s, j]
            for a in range(i + 1, rows):
                y -= triangle[s, i, a] * multipliers[a, s]
            multipliers[i, s] = y / triangle[s, i, i]
