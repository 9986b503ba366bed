"""Symmetric matrices with a band and a border, as in Newton's method over time; compiled.

The matrix is [[A, Bᵀ], [B, C]]. The border couples unknowns that are far apart in time: the periodic boundary of a
cycle, or bounds on sums over all samples. If the band is as wide as A, A is dense.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.linear_algebra import clear, substitute_lu

PIVOT_TOLERANCE = 1e-14  # smallest pivot, as a share of its diagonal entry


class BorderedMatrix(NamedTuple):
    """A matrix [[A, Bᵀ], [B, C]], and its factors if it is factorised."""

    A: np.ndarray  # (size, band), the lower half: entry (i, i − d) is A[i, d]
    B: np.ndarray  # (border, size)
    C: np.ndarray  # (border, border)
    L: np.ndarray  # (size, band): A = L Lᵀ
    X: np.ndarray  # (border, size): A⁻¹ Bᵀ, by rows
    S: np.ndarray  # (border, border): LU factors of C − B X


@compiled
def allocate_matrix(size, band, border):
    """Return a matrix of zeros."""
    return BorderedMatrix(
        np.zeros((size, band)),
        np.zeros((border, size)),
        np.zeros((border, border)),
        np.zeros((size, band)),
        np.zeros((border, size)),
        np.zeros((border, border)),
    )


@compiled
def clear_matrix(matrix):
    """Set all entries to 0."""
    clear(matrix.A)
    clear(matrix.B)
    clear(matrix.C)


@compiled
def add_entry(matrix, row, column, value):
    """Add a value to an entry of the lower half."""
    size = len(matrix.A)
    if row < size:
        matrix.A[row, row - column] += value
    elif column < size:
        matrix.B[row - size, column] += value
    else:
        matrix.C[row - size, column - size] += value
        if row != column:
            matrix.C[column - size, row - size] += value


@compiled
def factorise(matrix, negative):
    """Factorise the matrix; return whether its inertia is right.

    It is right if A is positive definite and C − B A⁻¹ Bᵀ has exactly ``negative`` negative eigenvalues.
    """
    A, B, C, L, X, S = matrix.A, matrix.B, matrix.C, matrix.L, matrix.X, matrix.S
    (size, band), borders = A.shape, C.shape[0]
    for i in range(size):  # Cholesky's factorisation
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
    count = 0  # pivots are not exchanged: the border is definite block by block if the inertia is right
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
def _substitute(L, x):
    """Overwrite x with (L Lᵀ)⁻¹ x."""
    size, band = L.shape
    for i in range(size):
        for d in range(1, min(i, band - 1) + 1):
            x[i] -= L[i, d] * x[i - d]
        x[i] /= L[i, 0]
    for i in range(size - 1, -1, -1):
        for d in range(1, min(size - 1 - i, band - 1) + 1):
            x[i] -= L[i + d, d] * x[i + d]
        x[i] /= L[i, 0]


@compiled
def solve(matrix, x):
    """Overwrite x, the banded part and then the border, with the solution of the factorised system."""
    L, X, S = matrix.L, matrix.X, matrix.S
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


@compiled
def solve_columns(matrix, columns, count):
    """Overwrite the first columns of a matrix with their solutions, bit for bit as ``solve`` does."""
    L, X, S = matrix.L, matrix.X, matrix.S
    (size, band), borders = L.shape, S.shape[0]
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


@compiled
def _subtract(row, factor, other, count):
    for w in range(count):
        row[w] -= factor * other[w]


@compiled
def _divide(row, divisor, count):
    for w in range(count):
        row[w] /= divisor
