"""Sums and products over arrays, written as loops: array expressions take numba a second each to compile."""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled


@compiled
def finite_indices(values):
    """Return the indices of what is finite."""
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
    """Make all entries of a matrix 0."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 0.0


@compiled
def add_scaled(matrix, factor, other):
    """Add a multiple of another matrix."""
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
