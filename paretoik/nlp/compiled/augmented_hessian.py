"""The Hessian of a quadratic program, made definite by its active rows, and its factors; compiled.

K = H + ρ Σ aᵢaᵢᵀ, a sum over active rows, is positive definite where H is so along them and ρ is large. With the sparse
rows alone it is banded, and factorised so; where that does not make it definite, all rows count and it is dense. Where
H is flat along the rows it is regularised from then on: nothing moves that way by itself. Source: Nocedal & Wright,
section 17.4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation import compiled
from paretoik.nlp.compiled.array_loops import clear
from paretoik.nlp.compiled.bordered_cholesky import factorise, solve, solve_columns


class AugmentationOptions(NamedTuple):
    """How K becomes definite; ρ and what is added have no unit: they are in sizes of H, its largest diagonal entry."""

    stiffness: tuple[float, ...] = (1.0, 1e3, 1e3, 1e6, 1e6)  # ρ, tried in turn: a larger one costs digits
    dense: int = 2  # the first of these that all rows count with
    flat: int = 4  # the one that H is regularised with
    regularisation: float = 1e-6  # what is added to the diagonal of H then: far below any curvature that counts


OPTIONS = AugmentationOptions()
IS_DENSE, IS_REGULARISED = 0, 1  # places in the flags


class AugmentedHessian(NamedTuple):
    """K and its factors, banded with a border (``bordered_cholesky``) and dense."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    L: np.ndarray
    X: np.ndarray
    S: np.ndarray
    full: np.ndarray  # (unknowns, unknowns), a band as wide as the matrix
    full_factor: np.ndarray
    no_border: np.ndarray  # (0, unknowns): that of the dense matrix
    flags: np.ndarray


@compiled
def allocate_augmented_hessian(n, band, border):
    """Return the arrays for n unknowns."""
    size = n - border
    return AugmentedHessian(
        np.zeros((size, band)),
        np.zeros((border, size)),
        np.zeros((border, border)),
        np.zeros((size, band)),
        np.zeros((border, size)),
        np.zeros((border, border)),
        np.zeros((n, n)),
        np.zeros((n, n)),
        np.zeros((0, n)),
        np.zeros(2, dtype=np.bool_),
    )


@compiled
def factorise_augmented_hessian(program, hessian, is_active, scale):
    """Factorise K with the first ρ that makes it definite, H over ``scale``; return this ρ, −1 where none does."""
    size = 0.0
    for i in range(len(program.A)):
        size = max(size, abs(program.A[i, 0]) / scale)
    size += size == 0.0
    for attempt in range(OPTIONS.flat if hessian.flags[IS_REGULARISED] else 0, len(OPTIONS.stiffness)):
        is_dense, is_regularised = attempt >= OPTIONS.dense, attempt == OPTIONS.flat
        rho, delta = OPTIONS.stiffness[attempt] * size, OPTIONS.regularisation * size if is_regularised else 0.0
        hessian.flags[IS_DENSE], hessian.flags[IS_REGULARISED] = is_dense, is_regularised
        if _factorise(program, hessian, is_active, rho, delta, is_dense, scale):
            return rho
    return -1.0


@compiled
def _factorise(program, hessian, is_active, rho, delta, is_dense, scale):
    """Factorise K with ``delta`` on its diagonal, banded or dense; return whether it is positive definite."""
    size, band = program.A.shape
    matrix, border, none = hessian.full if is_dense else hessian.A, len(program.C), hessian.no_border
    for part in (matrix, hessian.B, hessian.C):
        clear(part)
    for i in range(size):
        for d in range(min(band, i + 1)):
            matrix[i, d] = program.A[i, d] / scale
        matrix[i, 0] += delta
    for e in range(border):
        for j in range(size):
            _add_entry(hessian, is_dense, size, size + e, j, program.B[e, j] / scale)
        for f in range(e + 1):
            _add_entry(hessian, is_dense, size, size + e, size + f, program.C[e, f] / scale)
        _add_entry(hessian, is_dense, size, size + e, size + e, delta)
    _stiffen(program, hessian, is_active, rho, is_dense)
    if is_dense:
        return factorise(hessian.full, none, none, hessian.full_factor, none, none, 0)
    return factorise(hessian.A, hessian.B, hessian.C, hessian.L, hessian.X, hessian.S, 0)


@compiled
def _stiffen(program, hessian, is_active, rho, is_dense):
    """Add ρ aaᵀ of the active rows, the dense ones only where K is dense."""
    size, limits = len(program.A), len(program.entries)
    matrix = hessian.full if is_dense else hessian.A
    for i in range(limits):
        if is_active[i] and matrix.shape[1] == len(hessian.full) and _has_all_columns(program.columns[i]):
            _add_square(matrix, rho, program.entries[i])
        elif is_active[i]:
            for a in range(program.columns.shape[1]):
                for b in range(program.columns.shape[1]):
                    row, column = program.columns[i, a], program.columns[i, b]
                    value = rho * program.entries[i, a] * program.entries[i, b]
                    if row >= column and value != 0.0:
                        _add_entry(hessian, is_dense, size, row, column, value)
    for e in range(len(program.dense) if is_dense else 0):
        if is_active[limits + e]:
            for i in range(len(hessian.full)):
                for j in range(i + 1):
                    hessian.full[i, i - j] += rho * program.dense[e, i] * program.dense[e, j]


@compiled
def _has_all_columns(columns):
    """Return whether the entries of a row are those of the first unknowns, in order."""
    count = 0
    for k in range(len(columns)):
        count += columns[k] == k
    return count == len(columns)


@compiled(level=3)
def _add_square(matrix, rho, row):
    """Add ρ aaᵀ of a row whose entries are those of the first unknowns to the lower half of a K without a border."""
    for i in range(len(row)):
        factor = rho * row[i]
        for d in range(i + 1):
            matrix[i, d] += factor * row[i - d]


@compiled
def _add_entry(hessian, is_dense, size, row, column, value):
    """Add to an entry of the lower half of K."""
    if is_dense:
        hessian.full[row, row - column] += value
    elif row < size:
        hessian.A[row, row - column] += value
    elif column < size:
        hessian.B[row - size, column] += value
    else:
        hessian.C[row - size, column - size] += value
        if row != column:
            hessian.C[column - size, row - size] += value


@compiled
def solve_augmented_columns(hessian, columns, count):
    """Overwrite the first columns of a matrix as ``solve_augmented_hessian`` does each of them."""
    if hessian.flags[IS_DENSE]:
        solve_columns(hessian.full_factor, hessian.no_border, hessian.no_border, hessian.no_border, columns, count)
    else:
        solve_columns(hessian.L, hessian.B, hessian.X, hessian.S, columns, count)


@compiled
def solve_augmented_hessian(hessian, x):
    """Overwrite x with K⁻¹ x."""
    if hessian.flags[IS_DENSE]:
        solve(hessian.full_factor, hessian.no_border, hessian.no_border, hessian.no_border, x)
    else:
        solve(hessian.L, hessian.B, hessian.X, hessian.S, x)
