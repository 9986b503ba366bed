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
