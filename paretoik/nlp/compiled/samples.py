"""From positions at the samples of a motion to what functions of a sample see, and back for derivatives, compiled.

``place`` (time,) says where the steps of a sample begin among the unknowns, −1 where it cannot move; ``window`` (time,
width) which samples make up the variables u of a sample, by ``weights`` (orders, time, width).
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation import compiled

ON_PATH = 1e-12  # of the path equations
NEWTON = 8  # steps back to the path at most


@compiled
def spread(q, window, weights, u):
    """Write the variables (orders · dof, time) of the samples of q (time, dof)."""
    orders, samples, width = weights.shape
    n = q.shape[1]
    for o in range(orders):
        for j in range(n):
            for i in range(samples):
                total = 0.0
                for k in range(width):
                    total += weights[o, i, k] * q[window[i, k], j]
                u[o * n + j, i] = total


@compiled
def gather(of_u, scale, window, weights, of_q):
    """Add to of_q (time, dof) what a gradient by u (variables, time), times ``scale`` (time,), means for positions."""
    orders, samples, width = weights.shape
    n = of_q.shape[1]
    for o in range(orders):
        for j in range(n):
            for i in range(samples):
                g = of_u[o * n + j, i] * scale[i]
                if g != 0.0:
                    for k in range(width):
                        of_q[window[i, k], j] += weights[o, i, k] * g


@compiled
def reduce(of_q, normal, place, reduced):
    """Write the gradient by the unknowns of one by positions."""
    samples, n, r = normal.shape
    for i in range(len(reduced)):
        reduced[i] = 0.0
    for s in range(samples):
        if place[s] >= 0:
            for a in range(r):
                for j in range(n):
                    reduced[place[s] + a] += normal[s, j, a] * of_q[s, j]


@compiled
def moved(step, normal, place, dq):
    """Write the displacement (time, dof) of a step; return its largest entry."""
    samples, n, r = normal.shape
    longest = 0.0
    for s in range(samples):
        for j in range(n):
            dq[s, j] = 0.0
            if place[s] >= 0:
                for a in range(r):
                    dq[s, j] += normal[s, j, a] * step[place[s] + a]
            longest = max(longest, abs(dq[s, j]))
    return longest


@compiled
def add_curvature(i, phi, window, weights, normal, place, local, half, A, B, C):
    """Add the second derivatives phi by u of sample i to the matrix of the unknowns, banded with a border."""
    orders, _, width = weights.shape
    n, r = normal.shape[1], normal.shape[2]
    size = A.shape[0]
    for o in range(orders):
        for k in range(width):
            for j in range(n):
                for a in range(r):
                    local[o * n + j, k * r + a] = weights[o, i, k] * normal[window[i, k], j, a]
    for a in range(local.shape[0]):
        for b in range(local.shape[1]):
            half[a, b] = 0.0
        for m in range(local.shape[0]):
            if phi[a, m] != 0.0:
                for b in range(local.shape[1]):
                    half[a, b] += phi[a, m] * local[m, b]
    for k in range(width):
        if place[window[i, k]] < 0:
            continue
        for h in range(width):
            if place[window[i, h]] < 0:
                continue
            for a in range(r):
                for b in range(r):
                    row, column = place[window[i, k]] + a, place[window[i, h]] + b
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
def frames(tracked, normal, steep, triangle):
    """Write orthonormal bases of null space and row space of the tasks' Jacobians, and R of Jᵀ = Y R.

    ``tracked`` holds path equations and Jacobian entries (rows + rows · dof, time). By Householder reflections. Returns
    False at a singularity.
    """
    samples, n, rows = steep.shape
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
                steep[s, j, i] = basis[j, i]
            for i in range(rows, n):
                normal[s, j, i - rows] = basis[j, i]
        for i in range(rows):
            for c in range(i, rows):
                triangle[s, i, c] = work[i, c]
    return True


@compiled
def follow(normal, steep):
    """Write how the last sample moves where it is the nearest on the path to the one before."""
    _, n, r = normal.shape
    for a in range(r):
        for j in range(n):
            normal[-1, j, a] = normal[-2, j, a]
        for i in range(steep.shape[2]):
            along = 0.0
            for j in range(n):
                along += steep[-1, j, i] * normal[-2, j, a]
            for j in range(n):
                normal[-1, j, a] -= along * steep[-1, j, i]


@compiled
def _reflect(x, v, begin, square):
    dot = 0.0
    for j in range(begin, len(x)):
        dot += x[j] * v[j]
    for j in range(begin, len(x)):
        x[j] -= 2 * dot / square * v[j]


@compiled
def retracted(track, given, q, steep, triangle, tracked):
    """Lead q (time, dof) back onto the path along ``steep``, by Newton; return whether all of it arrived.

    What would come to another sheet of the self-motion manifold has not arrived.
    """
    samples, n, rows = steep.shape
    matrix, right = np.empty((rows, rows)), np.empty(rows)
    for attempt in range(NEWTON):
        for j in range(n):
            for s in range(samples):
                given[j, s] = q[s, j]
        run(track, given, tracked)
        worst = 0.0
        for i in range(rows):
            for s in range(samples):
                worst = max(worst, abs(tracked[i, s]))
        if worst <= ON_PATH:
            return True
        if not worst < 1.0 or attempt == NEWTON - 1:
            return worst <= 100 * ON_PATH  # rounding on a long arm
        for s in range(samples):
            for i in range(rows):
                right[i] = tracked[i, s]
                for c in range(rows):
                    total = 0.0
                    for j in range(n):
                        total += tracked[rows + i * n + j, s] * steep[s, j, c]
                    matrix[i, c] = total
            if not _eliminated(matrix, right, triangle[s]):
                return False
            for j in range(n):
                for c in range(rows):
                    q[s, j] -= steep[s, j, c] * right[c]
    return False


@compiled
def _eliminated(matrix, right, triangle):
    """Overwrite right with matrix⁻¹ right; False beyond a fold of the path equations.

    Where the step started the matrix was the transpose of ``triangle``; until a fold, its pivots keep their signs.
    """
    size = len(triangle)
    for i in range(size):
        pivot = matrix[i, i]
        if not pivot * triangle[i, i] > 1e-9 * abs(triangle[i, i]):
            return False
        for k in range(i + 1, size):
            factor = matrix[k, i] / pivot
            for c in range(i + 1, size):
                matrix[k, c] -= factor * matrix[i, c]
            right[k] -= factor * right[i]
    for i in range(size - 1, -1, -1):
        for c in range(i + 1, size):
            right[i] -= matrix[i, c] * right[c]
        right[i] /= matrix[i, i]
    return True


@compiled
def path_multipliers(of_q, steep, triangle, multipliers):
    """Write ν (rows, time) with Jᵀ ν = −(gradient in the row space), the multipliers of the path."""
    samples, n, rows = steep.shape
    for s in range(samples):
        for i in range(rows - 1, -1, -1):
            y = 0.0
            for j in range(n):
                y -= steep[s, j, i] * of_q[s, j]
            for a in range(i + 1, rows):
                y -= triangle[s, i, a] * multipliers[a, s]
            multipliers[i, s] = y / triangle[s, i, i]
