"""The optimality system of a quadratic program on its active constraints, which come and go; compiled.

    [H, −Aᵀ] [d]   [r]
    [A,   0] [y] = [b]

With K = H + ρ Σ aᵢaᵢᵀ (``augmented_hessian``), d = K⁻¹(r + Aᵀŷ) and A K⁻¹ Aᵀ ŷ = b − A K⁻¹ r, ŷ = y + ρ b. A row that
is dropped stays, its ŷ being the ρ aᵀd that K has too much of, until K is factorised anew. Source: Nocedal & Wright,
sections 16.2 and 17.4; Gill, Murray, Saunders & Wright 1990, A Schur-complement method for sparse quadratic
programming.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation import compiled
from paretoik.nlp.compiled.augmented_hessian import (
    IS_DENSE,
    IS_REGULARISED,
    AugmentedHessian,
    allocate_augmented_hessian,
    factorise_augmented_hessian,
    solve_augmented_columns,
    solve_augmented_hessian,
)
from paretoik.nlp.compiled.dense_lu import factorise_lu, solve_lu
from paretoik.nlp.compiled.quadratic_program import column_products, row_product, write_column, write_row


class WorkingSetOptions(NamedTuple):
    """Tolerance of the test that a row may be dropped."""

    curvature: float = 1e-13  # along the row, a share of its ρ: less is rounding


OPTIONS = WorkingSetOptions()
ROWS, CHANGES = 0, 1  # places in the counts


class WorkingSet(NamedTuple):
    """K, factorised, and the rows in its Schur complement."""

    hessian: AugmentedHessian  # K
    rows: np.ndarray  # (capacity,) constraints
    stiffness: np.ndarray  # (capacity,): ρ of rows in K, else 0
    solved: np.ndarray  # (capacity, unknowns): K⁻¹ a
    schur: np.ndarray  # (capacity, capacity)
    factors: np.ndarray  # of it, with row exchanges
    exchanges: np.ndarray
    right: np.ndarray  # (capacity,)
    vector: np.ndarray  # (unknowns,)
    columns: np.ndarray  # (unknowns, capacity)
    position: np.ndarray  # (constraints,): in the rows, −1 for none
    is_active: np.ndarray  # (constraints,)
    counts: np.ndarray  # rows, and changes since K was factorised


@compiled
def allocate_working_set(n, band, border, constraints, updates):
    """Return the arrays for n unknowns."""
    capacity = n + updates + 4
    return WorkingSet(
        allocate_augmented_hessian(n, band, border),
        np.zeros(capacity, dtype=np.int64),
        np.zeros(capacity),
        np.zeros((capacity, n)),
        np.zeros((capacity, capacity)),
        np.zeros((capacity, capacity)),
        np.zeros(capacity, dtype=np.int64),
        np.zeros(capacity),
        np.zeros(n),
        np.zeros((n, capacity)),
        np.zeros(constraints, dtype=np.int64),
        np.zeros(constraints, dtype=np.bool_),
        np.zeros(2, dtype=np.int64),
    )


@compiled
def factorise_working_set(program, work, scale):
    """Factorise K of the active rows and its Schur complement, H over ``scale``; return whether K is definite."""
    count = 0
    for i in range(len(work.is_active)):
        work.position[i] = -1
        count += work.is_active[i]
    if count > len(program.gradient):
        return False
    work.counts[ROWS], work.counts[CHANGES] = 0, 0
    rho = factorise_augmented_hessian(program, work.hessian, work.is_active, scale)
    if rho < 0.0:
        return False
    _append_active(program, work, rho)
    return _factorise_schur(work)


@compiled
def _append_active(program, work, rho):
    """Append all active rows to an empty Schur complement: as ``_append`` does each, many at a time."""
    count = 0
    for i in range(len(work.is_active)):
        if work.is_active[i]:
            is_stiff = work.hessian.flags[IS_DENSE] or i < len(program.entries)
            work.rows[count], work.position[i], work.stiffness[count] = i, count, rho if is_stiff else 0.0
            write_column(program, i, work.columns, count)
            count += 1
    work.counts[ROWS] = count
    solve_augmented_columns(work.hessian, work.columns, count)
    for w in range(count):
        column_products(program, work.rows[w], work.columns, w, count, work.right)
        for v in range(w, count):
            work.schur[v, w] = work.schur[w, v] = work.right[v]
        for j in range(len(work.columns)):
            work.solved[w, j] = work.columns[j, w]


@compiled
def _append(program, work, i, rho):
    """Append a row to the Schur complement."""
    count = work.counts[ROWS]
    vector = work.solved[count]
    write_row(program, i, vector)
    solve_augmented_hessian(work.hessian, vector)
    work.rows[count], work.position[i], work.stiffness[count] = i, count, rho
    for w in range(count + 1):
        work.schur[count, w] = work.schur[w, count] = row_product(program, work.rows[w], vector)
    work.counts[ROWS] = count + 1


@compiled
def _factorise_schur(work):
    """Factorise the Schur complement; return whether it is regular."""
    count, factors = work.counts[ROWS], work.factors
    for i in range(count):
        for j in range(count):
            factors[i, j] = work.schur[i, j]
        if not work.is_active[work.rows[i]]:
            factors[i, i] -= 1.0 / work.stiffness[i]
    return factorise_lu(factors, work.exchanges, count)


@compiled
def solve_working_set(program, work, gradient_rate, value_rate, step_rate, multiplier_rates):
    """Write d and y for r = −``gradient_rate`` and b = −``value_rate``; y is 0 where nothing is active."""
    count, vector = work.counts[ROWS], work.vector
    for j in range(len(vector)):
        vector[j] = -gradient_rate[j]
    solve_augmented_hessian(work.hessian, vector)
    for w in range(count):
        i = work.rows[w]
        b = -value_rate[i] if work.is_active[i] else 0.0
        work.right[w] = b - row_product(program, i, vector)
    solve_lu(work.factors, work.exchanges, work.counts[ROWS], work.right)
    for j in range(len(vector)):
        step_rate[j] = vector[j]
    for i in range(len(multiplier_rates)):
        multiplier_rates[i] = 0.0
    for w in range(count):
        i, factor = work.rows[w], work.right[w]
        for j in range(len(vector)):
            step_rate[j] += factor * work.solved[w, j]
        if work.is_active[i]:
            multiplier_rates[i] = factor + work.stiffness[w] * value_rate[i]


@compiled
def project_row(program, work, row, multipliers):
    """Write the y that make A_activeᵀ y nearest to a row by K⁻¹; return the share of the row that they do not make."""
    count, vector = work.counts[ROWS], work.vector
    write_row(program, row, vector)
    solve_augmented_hessian(work.hessian, vector)
    length = remainder = row_product(program, row, vector)
    for w in range(count):
        work.right[w] = -row_product(program, work.rows[w], vector)
    solve_lu(work.factors, work.exchanges, work.counts[ROWS], work.right)
    for i in range(len(multipliers)):
        multipliers[i] = 0.0
    for w in range(count):
        remainder += work.right[w] * row_product(program, row, work.solved[w])
        if work.is_active[work.rows[w]]:
            multipliers[work.rows[w]] = -work.right[w]
    return remainder / max(length, 1e-300)


@compiled
def is_definite_without(work, row):
    """Return whether curvature stays positive without an active row, by Haynsworth's inertia formula."""
    place = work.position[row]
    for w in range(work.counts[ROWS]):
        work.right[w] = w == place
    solve_lu(work.factors, work.exchanges, work.counts[ROWS], work.right)
    return work.right[place] - work.stiffness[place] > OPTIONS.curvature * work.stiffness[place]


@compiled
def regularise_without(work, row):
    """Make an active constraint inactive and have H regularised at the update; return False where it is already."""
    if work.hessian.flags[IS_REGULARISED]:
        return False
    work.is_active[row], work.hessian.flags[IS_REGULARISED] = False, True
    work.counts[CHANGES] = len(work.rows)  # more than any number of updates: K is factorised anew
    return True


@compiled
def add_constraint(program, work, row):
    """Make a constraint active; the system is to be updated then."""
    work.is_active[row] = True
    work.counts[CHANGES] += 1
    if work.position[row] < 0:
        _append(program, work, row, 0.0)


@compiled
def drop_constraint(work, row):
    """Make an active constraint inactive; the system is to be updated then."""
    place = work.position[row]
    work.is_active[row] = False
    work.counts[CHANGES] += 1
    if work.stiffness[place] == 0.0:
        _remove(work, place)


@compiled
def update_working_set(program, work, updates, scale):
    """Factorise the system after constraints came or went, K too after ``updates``; return whether it is definite."""
    if work.counts[CHANGES] <= updates and _factorise_schur(work):
        return True
    return factorise_working_set(program, work, scale)


@compiled
def _remove(work, place):
    """Remove a row from the Schur complement, the last one taking its place."""
    last = work.counts[ROWS] - 1
    work.position[work.rows[place]] = -1
    if place != last:
        work.rows[place], work.stiffness[place] = work.rows[last], work.stiffness[last]
        work.position[work.rows[place]] = place
        for j in range(work.solved.shape[1]):
            work.solved[place, j] = work.solved[last, j]
        for w in range(last + 1):
            work.schur[place, w] = work.schur[last, w]
        for w in range(last + 1):
            work.schur[w, place] = work.schur[w, last]
        work.schur[place, place] = work.schur[last, last]
    work.counts[ROWS] = last
