"""Dense systems by LU factors, rows exchanged, in the first rows and columns of larger arrays; compiled."""

from __future__ import annotations

from paretoik.compilation import compiled


@compiled
def factorise_lu(matrix, exchanges, count):
    """Overwrite the first ``count`` rows and columns with their factors; return whether they are regular."""
    for k in range(count):
        pivot = k
        for i in range(k + 1, count):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        exchanges[k] = pivot
        if pivot != k:
            for j in range(count):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
        if not abs(matrix[k, k]) > 0.0:
            return False
        for i in range(k + 1, count):
            factor = matrix[i, k] / matrix[k, k]
            matrix[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, count):
                    matrix[i, j] -= factor * matrix[k, j]
    return True


@compiled
def solve_lu(factors, exchanges, count, x):
    """Overwrite the first entries of x with the solution."""
    for k in range(count):
        pivot = exchanges[k]
        x[k], x[pivot] = x[pivot], x[k]
    substitute_lu(factors, count, x)


@compiled
def substitute_lu(factors, count, x):
    """Overwrite the first entries of x with the solution where no rows were exchanged."""
    for i in range(count):
        for j in range(i):
            x[i] -= factors[i, j] * x[j]
    for i in range(count - 1, -1, -1):
        for j in range(i + 1, count):
            x[i] -= factors[i, j] * x[j]
        x[i] /= factors[i, i]
