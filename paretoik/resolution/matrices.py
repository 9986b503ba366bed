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
def weighted_square(J, D, A):
    """Write A = J D Jᵀ, D a diagonal."""
    rows, n = J.shape
    for i in range(rows):
        for m in range(i + 1):
            total = 0.0
            for j in range(n):
                total += J[i, j] * D[j] * J[m, j]
            A[i, m] = A[m, i] = total
