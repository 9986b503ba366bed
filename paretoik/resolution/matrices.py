"""Small symmetric matrices, compiled."""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled


@compiled
def cholesky(A, factor):
    """Write the lower factor of A, its diagonal inverted; return whether A is positive definite."""
    rows, largest = A.shape[0], 0.0
    tolerance = 1e-13  # share of the largest diagonal entry: a matrix with a smaller pivot counts as singular
    for i in range(rows):
        largest = max(largest, abs(A[i, i]))
    for i in range(rows):
        for m in range(i + 1):
            total = A[i, m]
            for c in range(m):
                total -= factor[i, c] * factor[m, c]
            if m < i:
                factor[i, m] = total * factor[m, m]
            elif total > tolerance * largest:
                factor[i, i] = 1.0 / np.sqrt(total)
            else:
                return False
    return True


@compiled
def solve_cholesky(factor, right):
    """Overwrite ``right`` with A⁻¹ ``right``."""
    rows = right.shape[0]
    for i in range(rows):
        for c in range(i):
            right[i] -= factor[i, c] * right[c]
        right[i] *= factor[i, i]
    for i in range(rows - 1, -1, -1):
        for c in range(i + 1, rows):
            right[i] -= factor[c, i] * right[c]
        right[i] *= factor[i, i]


@compiled
def smallest_eigenvalue(A, work):
    """Return the smallest eigenvalue of a symmetric matrix: Householder tridiagonalisation, then implicit QL steps.

    ``work`` (rows + 4, rows) is overwritten. Source: Golub & Van Loan, Matrix Computations, sections 8.3.1 and 8.3.3.
    """
    rows = A.shape[0]
    diagonal, off, v, w = work[rows], work[rows + 1], work[rows + 2], work[rows + 3]
    for i in range(rows):
        off[i] = 0.0
        for m in range(rows):
            work[i, m] = A[i, m]
    for k in range(rows - 2):
        size = 0.0
        for i in range(k + 1, rows):
            size += work[i, k] ** 2
        size = np.sqrt(size)
        off[k] = -size if work[k + 1, k] > 0 else size
        square = size * (size + abs(work[k + 1, k]))  # half of |v|²
        if not square > 0.0:
            off[k] = work[k + 1, k]
            continue
        for i in range(k + 1, rows):
            v[i] = work[i, k]
        v[k + 1] -= off[k]
        projection = 0.0
        for i in range(k + 1, rows):
            w[i] = 0.0
            for m in range(k + 1, rows):
                w[i] += work[i, m] * v[m] / square
            projection += v[i] * w[i] / (2.0 * square)
        for i in range(k + 1, rows):
            for m in range(k + 1, rows):
                work[i, m] -= v[i] * (w[m] - projection * v[m]) + (w[i] - projection * v[i]) * v[m]
    if rows > 1:
        off[rows - 2] = work[rows - 1, rows - 2]
    for i in range(rows):
        diagonal[i] = work[i, i]
    _implicit_ql(diagonal, off)
    smallest = diagonal[0]
    for i in range(1, rows):
        smallest = min(smallest, diagonal[i])
    return smallest


@compiled
def _implicit_ql(diagonal, off):
    """Overwrite the diagonal of a symmetric tridiagonal matrix with its eigenvalues; ``off`` are its off-diagonals."""
    iterations, rounding = 40, 2.2e-16  # for one eigenvalue, at most; of an off-diagonal entry that counts as 0
    for low in range(diagonal.shape[0]):
        for _ in range(iterations):
            high = low
            while high < diagonal.shape[0] - 1:
                if abs(off[high]) <= rounding * (abs(diagonal[high]) + abs(diagonal[high + 1])):
                    break
                high += 1
            if high == low:
                break
            g = (diagonal[low + 1] - diagonal[low]) / (2.0 * off[low])
            r = np.sqrt(g * g + 1.0)
            g = diagonal[high] - diagonal[low] + off[low] / (g + (r if g >= 0 else -r))
            s, c, p, split = 1.0, 1.0, 0.0, False
            for i in range(high - 1, low - 1, -1):
                f, b = s * off[i], c * off[i]
                r = np.sqrt(f * f + g * g)
                off[i + 1] = r
                if r == 0.0:  # the matrix splits into two blocks
                    diagonal[i + 1] -= p
                    off[high] = 0.0
                    split = True
                    break
                s, c = f / r, g / r
                g = diagonal[i + 1] - p
                r = (diagonal[i] - g) * s + 2.0 * c * b
                p = s * r
                diagonal[i + 1] = g + p
                g = c * r - b
            if not split:
                diagonal[low] -= p
                off[low] = g
                off[high] = 0.0
