"""Orthonormal bases by Householder's reflections I − v vᵀ, |v|² = 2, compiled (Golub & Van Loan, section 5.1)."""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled

RANK_TOLERANCE = 1e-11  # of a row's length: what the rows before it may leave of it at least


@compiled
def triangularise(rows, triangle):
    """Overwrite rows (m, n) by the reflections v of rowsᵀ = Q [R; 0], and write R; False where they are dependent."""
    m, n = rows.shape
    for i in range(m):
        whole, size = 0.0, 0.0
        for j in range(n):
            whole += rows[i, j] ** 2
            if j >= i:
                size += rows[i, j] ** 2
        if not size > RANK_TOLERANCE**2 * whole:
            return False
        size = np.sqrt(size)
        for j in range(i):
            triangle[j, i] = rows[i, j]
            rows[i, j] = 0.0
        triangle[i, i] = -size if rows[i, i] >= 0 else size
        rows[i, i] -= triangle[i, i]
        square = 0.0
        for j in range(i, n):
            square += rows[i, j] ** 2
        scale = np.sqrt(2.0 / square)
        for j in range(i, n):
            rows[i, j] *= scale
        for k in range(i + 1, m):
            reflect(rows[i], rows[k])
    return True


@compiled
def reflect(v, x):
    """Overwrite x with (I − v vᵀ) x."""
    total = 0.0
    for j in range(len(x)):
        total += v[j] * x[j]
    for j in range(len(x)):
        x[j] -= total * v[j]


@compiled
def rotate(reflectors, x):
    """Overwrite x with Qᵀ x: first what lies across the null space, then along it."""
    for i in range(len(reflectors)):
        reflect(reflectors[i], x)


@compiled
def rotate_back(reflectors, x):
    """Overwrite x with Q x."""
    for i in range(len(reflectors) - 1, -1, -1):
        reflect(reflectors[i], x)


@compiled
def rotate_matrix(reflectors, work, matrix):
    """Overwrite a symmetric matrix with Qᵀ matrix Q."""
    n = len(matrix)
    for i in range(len(reflectors)):
        v, total = reflectors[i], 0.0
        for a in range(n):
            work[a] = 0.0
            for b in range(n):
                work[a] += matrix[a, b] * v[b]
            total += work[a] * v[a]
        for a in range(n):
            work[a] -= 0.5 * total * v[a]
        for a in range(n):
            for b in range(n):
                matrix[a, b] -= v[a] * work[b] + work[a] * v[b]


@compiled
def back_substitute(triangle, x):
    """Overwrite the first entries of x with R⁻¹ x."""
    for i in range(len(triangle) - 1, -1, -1):
        for k in range(i + 1, len(triangle)):
            x[i] -= triangle[i, k] * x[k]
        x[i] /= triangle[i, i]


@compiled
def eliminate(matrix, right, triangle):
    """Overwrite right with matrix⁻¹ right; return False beyond a fold of the equations.

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
