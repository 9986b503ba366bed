"""A quadratic program in arrays, and what its rows do; compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation import compiled


class QuadraticProgram(NamedTuple):
    """½ dᵀH d + gᵀd and constraints c + A d ≥ 0: sparse rows, then dense ones; all rows have length one."""

    A: np.ndarray  # (size, band), lower half of H
    B: np.ndarray  # (border, size)
    C: np.ndarray  # (border, border)
    gradient: np.ndarray
    columns: np.ndarray  # (limits, entries)
    entries: np.ndarray
    dense: np.ndarray  # (bounds, unknowns)
    values: np.ndarray


@compiled
def row_product(program, i, vector):
    """Return the product of row i and a vector."""
    total, limits = 0.0, len(program.entries)
    if i >= limits:
        for j in range(len(vector)):
            total += program.dense[i - limits, j] * vector[j]
        return total
    for k in range(program.columns.shape[1]):
        total += program.entries[i, k] * vector[program.columns[i, k]]
    return total


@compiled
def add_row(program, i, factor, vector):
    """Add a multiple of row i to a vector."""
    limits = len(program.entries)
    if i >= limits:
        for j in range(len(vector)):
            vector[j] += factor * program.dense[i - limits, j]
        return
    for k in range(program.columns.shape[1]):
        vector[program.columns[i, k]] += factor * program.entries[i, k]


@compiled
def write_row(program, i, vector):
    """Write row i."""
    for j in range(len(vector)):
        vector[j] = 0.0
    add_row(program, i, 1.0, vector)


@compiled
def write_column(program, i, matrix, column):
    """Write row i as a column of a matrix."""
    limits = len(program.entries)
    for j in range(len(matrix)):
        matrix[j, column] = program.dense[i - limits, j] if i >= limits else 0.0
    for k in range(program.columns.shape[1] if i < limits else 0):
        matrix[program.columns[i, k], column] += program.entries[i, k]


@compiled(level=3)
def column_products(program, i, matrix, first, count, products):
    """Write the products of row i and the columns of a matrix from ``first`` to before ``count``."""
    limits = len(program.entries)
    for w in range(first, count):
        products[w] = 0.0
    if i >= limits:
        for j in range(len(matrix)):
            _add_products(program.dense[i - limits, j], matrix[j], first, count, products)
        return
    for k in range(program.columns.shape[1]):
        _add_products(program.entries[i, k], matrix[program.columns[i, k]], first, count, products)


@compiled(level=3)
def _add_products(factor, row, first, count, products):
    for w in range(first, count):
        products[w] += factor * row[w]
