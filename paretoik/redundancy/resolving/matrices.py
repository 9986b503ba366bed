"""Small symmetric matrices, compiled."""

from __future__ import annotations

import numpy as np

from paretoik.calculus.compiling import compiled

SWEEPS = 30  # of rotations, at most
FLAT = 1e-13  # share of the largest diagonal entry: a pivot below is none


@compiled
def decomposed(A, factor):
    """Write the lower factor of A, and the inverses of its diagonal; return whether A is positive definite."""
    rows, largest = A.shape[0], 0.0
    for i in range(rows):
        largest = max(largest, abs(A[i, i]))
    for i in range(rows):
        for m in range(i + 1):
            total = A[i, m]
            for c in range(m):
                total -= factor[i, c] * factor[m, c]
            if m < i:
                factor[i, m] = total * factor[m, m]
            elif total > FLAT * largest:
                factor[i, i] = 1.0 / np.sqrt(total)
            else:
                return False
    return True


@compiled
def substituted(factor, right):
    """Overwrite ``right`` with what solves for it."""
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
def least_eigenvalue(A, spare):
    """Return the least eigenvalue of a symmetric matrix, by Jacobi's rotations on a copy."""
    rows = A.shape[0]
    for i in range(rows):
        for m in range(rows):
            spare[i, m] = A[i, m]
    for _ in range(SWEEPS):
        off, on = 0.0, 0.0
        for i in range(rows):
            on += spare[i, i] ** 2
            for m in range(i):
                off += spare[i, m] ** 2
        if not off > 1e-32 * on:
            break
        for i in range(1, rows):
            for m in range(i):
                if spare[i, m] == 0.0:
                    continue
                turn = (spare[i, i] - spare[m, m]) / (2.0 * spare[i, m])
                t = (1.0 if turn >= 0 else -1.0) / (abs(turn) + np.sqrt(turn * turn + 1.0))
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                for r in range(rows):
                    a, b = spare[r, m], spare[r, i]
                    spare[r, m], spare[r, i] = c * a - s * b, s * a + c * b
                for r in range(rows):
                    a, b = spare[m, r], spare[i, r]
                    spare[m, r], spare[i, r] = c * a - s * b, s * a + c * b
    least = spare[0, 0]
    for i in range(1, rows):
        least = min(least, spare[i, i])
    return least
