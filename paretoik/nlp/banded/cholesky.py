"""Linear systems with a banded matrix and a border, compiled.

The matrix is [[A, B], [Bᵀ, C]]; Newton's method over time needs it.

A (size, band) contains its lower half: A[i, d] is entry (i, i − d). The border couples unknowns that are far apart in
time: the periodic boundary of a cycle, bounds on sums over all samples. If the band is as wide as its size, A is dense.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.linear_algebra import substitute_lu

PIVOT_TOLERANCE = 1e-14  # smallest pivot, as a share of its diagonal entry


@compiled
def factorise(A, B, C, L, X, S, negative):
    """Factorise the matrix; return whether its inertia is right.

    L of A = L Lᵀ, X = A⁻¹ B and the factors of S = C − Bᵀ X are written. The inertia is right if A is positive definite
    and S has exactly ``negative`` negative eigenvalues.
    """
    if not _cholesky(A, L):
        return False
    size, borders = A.shape[0], C.shape[0]
    for e in range(borders):
        for i in range(size):
            X[e, i] = B[e, i]
        _substitute(L, X[e])
    for e in range(borders):
        for b in range(borders):
            total = C[e, b]
            for i in range(size):
                total -= B[e, i] * X[b, i]
            S[e, b] = total
    count = 0  # without pivoting: the border is definite block by block if the inertia is right
    for e in range(borders):
        if not abs(S[e, e]) > 0.0:
            return False
        count += S[e, e] < 0
        for b in range(e + 1, borders):
            factor = S[b, e] / S[e, e]
            for i in range(e + 1, borders):
                S[b, i] -= factor * S[e, i]
            S[b, e] = factor
    return count == negative


@compiled
def solve(L, B, X, S, x):
    """Overwrite x with the solution of the factorised system.

    x has the banded part, then the border.
    """
    size, borders = L.shape[0], S.shape[0]
    if borders:
        corner = np.empty(borders)
        for e in range(borders):
            corner[e] = x[size + e]
            for i in range(size):
                corner[e] -= X[e, i] * x[i]
        substitute_lu(S, borders, corner)
    _substitute(L, x)
    for e in range(borders):
        for i in range(size):
            x[i] -= X[e, i] * corner[e]
        x[size + e] = corner[e]


@compiled(level=3)  # this level vectorises over several columns
def solve_columns(L, B, X, S, columns, count):
    """Overwrite the first columns of a matrix with their solutions.

    Each equals the result of ``solve`` bit for bit.
    """
    size, borders = L.shape[0], S.shape[0]
    corner = np.empty((borders, count))
    for e in range(borders):
        for w in range(count):
            corner[e, w] = columns[size + e, w]
        for i in range(size):
            _subtract(corner[e], X[e, i], columns[i], count)
    for e in range(borders):
        for b in range(e):
            _subtract(corner[e], S[e, b], corner[b], count)
    for e in range(borders - 1, -1, -1):
        for b in range(e + 1, borders):
            _subtract(corner[e], S[e, b], corner[b], count)
        _divide(corner[e], S[e, e], count)
    size, band = L.shape
    for i in range(size):
        for d in range(1, min(i, band - 1) + 1):
            _subtract(columns[i], L[i, d], columns[i - d], count)
        _divide(columns[i], L[i, 0], count)
    for i in range(size - 1, -1, -1):
        for d in range(1, min(size - 1 - i, band - 1) + 1):
            _subtract(columns[i], L[i + d, d], columns[i + d], count)
        _divide(columns[i], L[i, 0], count)
    for e in range(borders):
        for i in range(size):
            _subtract(columns[i], X[e, i], corner[e], count)
        for w in range(count):
            columns[size + e, w] = corner[e, w]


@compiled(level=3)
def _subtract(row, factor, other, count):
    for w in range(count):
        row[w] -= factor * other[w]


@compiled(level=3)
def _divide(row, divisor, count):
    for w in range(count):
        row[w] /= divisor


@compiled
def _cholesky(A, L):
    """Write L of A = L Lᵀ; return whether A is definite."""
    size, band = A.shape
    for i in range(size):
        for d in range(min(i, band - 1), -1, -1):
            j = i - d
            total = A[i, d]
            for k in range(max(0, i - band + 1), j):
                total -= L[i, i - k] * L[j, j - k]
            if d:
                L[i, d] = total / L[j, 0]
            elif total > PIVOT_TOLERANCE * abs(A[i, 0]):
                L[i, 0] = np.sqrt(total)
            else:
                return False
    return True


@compiled
def _substitute(L, x):
    """Overwrite x with A⁻¹ x."""
    size, band = L.shape
    for i in range(size):
        for d in range(1, min(i, band - 1) + 1):
            x[i] -= L[i, d] * x[i - d]
        x[i] /= L[i, 0]
    for i in range(size - 1, -1, -1):
        for d in range(1, min(size - 1 - i, band - 1) + 1):
            x[i] -= L[i + d, d] * x[i + d]
        x[i] /= L[i, 0]
