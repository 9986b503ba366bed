"""Small symmetric matrices, compiled."""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled

SWEEPS = 40  # of rotations for one eigenvalue, at most
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
    """Return the least eigenvalue of a symmetric matrix: reflected to three diagonals, then by implicit QL steps.

    ``spare`` (rows + 4, rows) is room. Source: Golub & Van Loan, Matrix Computations, sections 8.3.1 and 8.3.3.
    """
    rows = A.shape[0]
    on, off, v, w = spare[rows], spare[rows + 1], spare[rows + 2], spare[rows + 3]
    for i in range(rows):
        off[i] = 0.0
        for m in range(rows):
            spare[i, m] = A[i, m]
    for k in range(rows - 2):
        size = 0.0
        for i in range(k + 1, rows):
            size += spare[i, k] ** 2
        size = np.sqrt(size)
        off[k] = -size if spare[k + 1, k] > 0 else size
        square = size * (size + abs(spare[k + 1, k]))  # half of |v|²
        if not square > 0.0:
            off[k] = spare[k + 1, k]
            continue
        for i in range(k + 1, rows):
            v[i] = spare[i, k]
        v[k + 1] -= off[k]
        along = 0.0
        for i in range(k + 1, rows):
            w[i] = 0.0
            for m in range(k + 1, rows):
                w[i] += spare[i, m] * v[m] / square
            along += v[i] * w[i] / (2.0 * square)
        for i in range(k + 1, rows):
            for m in range(k + 1, rows):
                spare[i, m] -= v[i] * (w[m] - along * v[m]) + (w[i] - along * v[i]) * v[m]
    if rows > 1:
        off[rows - 2] = spare[rows - 1, rows - 2]
    for i in range(rows):
        on[i] = spare[i, i]
    _rotated(on, off)
    least = on[0]
    for i in range(1, rows):
        least = min(least, on[i])
    return least


@compiled
def _rotated(on, off):
    """Overwrite the diagonal of a symmetric tridiagonal matrix with its eigenvalues; ``off`` is what lies beside it."""
    for low in range(on.shape[0]):
        for _ in range(SWEEPS):
            high = low
            while high < on.shape[0] - 1:
                if abs(off[high]) <= 2.2e-16 * (abs(on[high]) + abs(on[high + 1])):
                    break
                high += 1
            if high == low:
                break
            g = (on[low + 1] - on[low]) / (2.0 * off[low])
            r = np.sqrt(g * g + 1.0)
            g = on[high] - on[low] + off[low] / (g + (r if g >= 0 else -r))
            s, c, p, cut = 1.0, 1.0, 0.0, False
            for i in range(high - 1, low - 1, -1):
                f, b = s * off[i], c * off[i]
                r = np.sqrt(f * f + g * g)
                off[i + 1] = r
                if r == 0.0:  # it falls into two
                    on[i + 1] -= p
                    off[high] = 0.0
                    cut = True
                    break
                s, c = f / r, g / r
                g = on[i + 1] - p
                r = (on[i] - g) * s + 2.0 * c * b
                p = s * r
                on[i + 1] = g + p
                g = c * r - b
            if not cut:
                on[low] -= p
                off[low] = g
                off[high] = 0.0
