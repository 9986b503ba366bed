"""Linear algebra in loops, compiled: numba needs a second to compile each array expression."""

from __future__ import annotations

import numpy as np

from paretoik.compilation.numba_cache import compiled

# Small symmetric matrices, compiled.


@compiled
def cholesky(A, factor):
    """Write A's Cholesky factor with an inverted diagonal; return whether A is positive definite."""
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
    """Overwrite ``right`` with A⁻¹ · ``right``."""
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
    """Write A = J D Jᵀ for a diagonal D."""
    rows, n = J.shape
    for i in range(rows):
        for m in range(i + 1):
            total = 0.0
            for j in range(n):
                total += J[i, j] * D[j] * J[m, j]
            A[i, m] = A[m, i] = total


# Orthonormal bases by Householder reflections I − v vᵀ, |v|² = 2, compiled (Golub & Van Loan, section 5.1).


RANK_TOLERANCE = 1e-11  # least part of a row that is independent of the rows before it, as a share of the row's length


@compiled
def triangularise(rows, triangle):
    """Overwrite rows (m, n) with the reflectors v of rowsᵀ = Q [R; 0], write R; return False if dependent."""
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
    """Overwrite x with Qᵀ x: the part in the row space, then the part in the null space."""
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
    """Overwrite right with matrix⁻¹ · right; return False beyond a fold of the equations.

    At the start of a step the matrix is the transpose of ``triangle``; its pivots keep their signs up to a fold.
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


# Dense systems in the first rows and columns of larger arrays, by LU factors with row exchanges; compiled.


@compiled
def factorise_lu(matrix, exchanges, count):
    """Overwrite the first ``count`` rows and columns with their LU factors; return whether they are regular."""
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
    """Overwrite the first entries of x with the solution, without row exchanges."""
    for i in range(count):
        for j in range(i):
            x[i] -= factors[i, j] * x[j]
    for i in range(count - 1, -1, -1):
        for j in range(i + 1, count):
            x[i] -= factors[i, j] * x[j]
        x[i] /= factors[i, i]


# Sums and products over arrays, written as loops.


@compiled
def finite_indices(values):
    """Return the indices of the finite values."""
    count = 0
    for value in values:
        count += np.isfinite(value)
    indices = np.empty(count, dtype=np.int64)
    count = 0
    for i in range(len(values)):
        if np.isfinite(values[i]):
            indices[count] = i
            count += 1
    return indices


@compiled
def clear(matrix):
    """Set all entries of a matrix to 0."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 0.0


@compiled
def add_scaled(matrix, factor, other):
    """Add ``factor`` · ``other`` to a matrix."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] += factor * other[i, j]


@compiled
def inner_product(matrix, other):
    """Return the sum of products of the entries of two matrices."""
    total = 0.0
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * other[i, j]
    return total


@compiled
def dot(vector, other):
    """Return the inner product of two vectors."""
    total = 0.0
    for k in range(len(other)):
        total += vector[k] * other[k]
    return total


@compiled
def norm(vector):
    """Return the Euclidean length of a vector."""
    total = 0.0
    for value in vector:
        total += value * value
    return np.sqrt(total)
