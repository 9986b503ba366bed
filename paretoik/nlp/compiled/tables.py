"""Sums and products over small tables, written out in loops: compiled, and without new arrays.

Only ``finite`` makes one.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled


@compiled
def finite(values):
    """Return the places of what is finite."""
    count = 0
    for value in values:
        count += np.isfinite(value)
    found = np.empty(count, dtype=np.int64)
    count = 0
    for i in range(len(values)):
        if np.isfinite(values[i]):
            found[count] = i
            count += 1
    return found


@compiled
def put(given, q):
    """Write positions q (time, dof) into the first rows of inputs (inputs, time)."""
    for j in range(q.shape[1]):
        for s in range(q.shape[0]):
            given[j, s] = q[s, j]


@compiled
def clear(array):
    """Make all entries of a table 0."""
    for i in range(array.shape[0]):
        for j in range(array.shape[1]):
            array[i, j] = 0.0


@compiled
def add(array, factor, other):
    """Add a multiple of another table."""
    for i in range(array.shape[0]):
        for j in range(array.shape[1]):
            array[i, j] += factor * other[i, j]


@compiled
def product(array, other):
    """Return the sum of products of the entries of two tables."""
    total = 0.0
    for i in range(array.shape[0]):
        for j in range(array.shape[1]):
            total += array[i, j] * other[i, j]
    return total


@compiled
def weighed(factors, f):
    """Return Σ factors · f."""
    total = 0.0
    for k in range(len(f)):
        total += factors[k] * f[k]
    return total


@compiled
def length(vector):
    """Return the Euclidean length of a vector."""
    total = 0.0
    for value in vector:
        total += value * value
    return np.sqrt(total)
