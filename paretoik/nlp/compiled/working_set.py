"""The optimality system of a quadratic program on its active constraints, which come and go; compiled.

    [H, −Aᵀ] [d]   [r]
    [A,   0] [y] = [b]

K = H + ρ Σ aᵢaᵢᵀ, a sum over active rows, is positive definite where H is so along them. With the sparse rows alone it
is banded, and factorised so; where that does not make it definite, all rows count and it is dense. Then
d = K⁻¹(r + Aᵀŷ) and A K⁻¹ Aᵀ ŷ = b − A K⁻¹ r, ŷ = y + ρ b. A row that is dropped stays, its ŷ being the ρ aᵀd that K
has too much of, until K is factorised anew. Source: Nocedal & Wright, sections 16.2 and 17.4; Gill, Murray, Saunders &
Wright 1990, A Schur-complement method for sparse quadratic programming.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation import compiled
from paretoik.nlp.compiled.array_loops import clear
from paretoik.nlp.compiled.bordered_cholesky import factorise, solve
from paretoik.nlp.compiled.dense_lu import factorise_lu, solve_lu
from paretoik.nlp.compiled.quadratic_program import row_product, write_row

STIFFNESS = (1.0, 1e3, 1e3, 1e6, 1e6)  # ρ, in sizes of H, tried in turn
DENSE = 2  # the first of them that all rows count with
FLAT = 4  # the one that H is regularised with
REGULARISATION = 1e-6  # in sizes of H: what is added to it where it is flat
CURVATURE = 1e-13  # along a row, a share of its ρ: less is rounding


class WorkingSet(NamedTuple):
    """K, factorised, and the rows in the Schur complement M."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    L: np.ndarray
    X: np.ndarray
    S: np.ndarray
    full: np.ndarray  # (unknowns, unknowns), a band as wide as the matrix
    full_factor: np.ndarray
    nothing: np.ndarray  # (0, unknowns): the border of the dense matrix
    rows: np.ndarray  # (capacity,) constraints
    stiffness: np.ndarray  # (capacity,): ρ of rows in K, else 0
    solved: np.ndarray  # (capacity, unknowns): K⁻¹ a
    schur: np.ndarray  # (capacity, capacity)
    factors: np.ndarray  # of it, with row exchanges
    exchanges: np.ndarray
    right: np.ndarray  # (capacity,)
    vector: np.ndarray  # (unknowns,)
    position: np.ndarray  # (constraints,): in the rows, −1 for none
    is_active: np.ndarray  # (constraints,)
    counts: np.ndarray  # rows, changes since K was factorised, whether K is dense, whether it is regularised


@compiled
def allocate_working_set(n, band, border, constraints, updates):
    """Return the arrays for n unknowns."""
    capacity, size = n + updates + 4, n - border
    return WorkingSet(
        np.zeros((size, band)),
        np.zeros((border, size)),
        np.zeros((border, border)),
        np.zeros((size, band)),
        np.zeros((border, size)),
        np.zeros((border, border)),
        np.zeros((n, n)),
        np.zeros((n, n)),
        np.zeros((0, n)),
        np.zeros(capacity, dtype=np.int64),
        np.zeros(capacity),
        np.zeros((capacity, n)),
        np.zeros((capacity, capacity)),
        np.zeros((capacity, capacity)),
        np.zeros(capacity, dtype=np.int64),
        np.zeros(capacity),
        np.zeros(n),
        np.zeros(constraints, dtype=np.int64),
        np.zeros(constraints, dtype=np.bool_),
        np.zeros(4, dtype=np.int64),
    )


@compiled
def factorise_working_set(program, work, multipliers, first, scale):
    """Factorise K of the active rows, those with a multiplier the ``first`` time; return whether it is definite.

    Where H is flat along them it is regularised from then on: nothing moves that way by itself.
    """
    count, largest = 0, 0.0
    for i in range(len(multipliers)):
        if first:
            work.is_active[i] = multipliers[i] > 0.0
        work.position[i] = -1
        count += work.is_active[i]
    if count > len(program.gradient):
        return False
    for i in range(len(program.A)):
        largest = max(largest, abs(program.A[i, 0]) / scale)
    largest += largest == 0.0
    work.counts[0], work.counts[1] = 0, 0
    for which in range(FLAT if work.counts[3] else 0, len(STIFFNESS)):
        rho, delta = STIFFNESS[which] * largest, REGULARISATION * largest if which == FLAT else 0.0
        work.counts[2], work.counts[3] = which >= DENSE, which == FLAT
        if _factorise(program, work, rho, delta, which >= DENSE, scale):
            for i in range(len(multipliers)):
                if work.is_active[i]:
                    _append(program, work, i, rho if which >= DENSE or i < len(program.entries) else 0.0)
            return _factorise_schur(work)
    return False


@compiled
def _factorise(program, work, rho, delta, is_full, scale):
    """Factorise K with ``delta`` on its diagonal, banded or dense; return whether it is positive definite."""
    size, band = program.A.shape
    matrix, border = work.full if is_full else work.A, len(program.C)
    for part in (matrix, work.B, work.C):
        clear(part)
    for i in range(size):
        for d in range(min(band, i + 1)):
            matrix[i, d] = program.A[i, d] / scale
        matrix[i, 0] += delta
    for e in range(border):
        for j in range(size):
            _add_entry(work, is_full, size, size + e, j, program.B[e, j] / scale)
        for f in range(e + 1):
            _add_entry(work, is_full, size, size + e, size + f, program.C[e, f] / scale)
        _add_entry(work, is_full, size, size + e, size + e, delta)
    _stiffen(program, work, rho, is_full)
    if is_full:
        return factorise(work.full, work.nothing, work.nothing, work.full_factor, work.nothing, work.nothing, 0)
    return factorise(work.A, work.B, work.C, work.L, work.X, work.S, 0)


@compiled
def _stiffen(program, work, rho, is_full):
    """Add ρ aaᵀ of the active rows, the dense ones only where K is dense."""
    size, limits = len(program.A), len(program.entries)
    for i in range(limits):
        if work.is_active[i]:
            for a in range(program.columns.shape[1]):
                for b in range(program.columns.shape[1]):
                    row, column = program.columns[i, a], program.columns[i, b]
                    value = rho * program.entries[i, a] * program.entries[i, b]
                    if row >= column and value != 0.0:
                        _add_entry(work, is_full, size, row, column, value)
    for e in range(len(program.dense) if is_full else 0):
        if work.is_active[limits + e]:
            for i in range(len(work.full)):
                for j in range(i + 1):
                    work.full[i, i - j] += rho * program.dense[e, i] * program.dense[e, j]


@compiled
def _add_entry(work, is_full, size, row, column, value):
    """Add to an entry of the lower half of K."""
    if is_full:
        work.full[row, row - column] += value
    elif row < size:
        work.A[row, row - column] += value
    elif column < size:
        work.B[row - size, column] += value
    else:
        work.C[row - size, column - size] += value
        if row != column:
            work.C[column - size, row - size] += value


@compiled
def _solve(work, x):
    """Overwrite x with K⁻¹ x."""
    if work.counts[2]:
        solve(work.full_factor, work.nothing, work.nothing, work.nothing, x)
    else:
        solve(work.L, work.B, work.X, work.S, x)


@compiled
def _append(program, work, i, rho):
    """Append a row to the Schur complement."""
    count = work.counts[0]
    vector = work.solved[count]
    write_row(program, i, vector)
    _solve(work, vector)
    work.rows[count], work.position[i], work.stiffness[count] = i, count, rho
    for w in range(count + 1):
        work.schur[count, w] = work.schur[w, count] = row_product(program, work.rows[w], vector)
    work.counts[0] = count + 1


@compiled
def _factorise_schur(work):
    """Factorise the Schur complement; return whether it is regular."""
    count, factors = work.counts[0], work.factors
    for i in range(count):
        for j in range(count):
            factors[i, j] = work.schur[i, j]
        if not work.is_active[work.rows[i]]:
            factors[i, i] -= 1.0 / work.stiffness[i]
    return factorise_lu(factors, work.exchanges, count)


@compiled
def solve_working_set(program, work, gradient_rate, value_rate, step_rate, multiplier_rates):
    """Write d and y for r = −``gradient_rate`` and b = −``value_rate``; y is 0 where nothing is active."""
    count, vector = work.counts[0], work.vector
    for j in range(len(vector)):
        vector[j] = -gradient_rate[j]
    _solve(work, vector)
    for w in range(count):
        i = work.rows[w]
        below = -value_rate[i] if work.is_active[i] else 0.0
        work.right[w] = below - row_product(program, i, vector)
    solve_lu(work.factors, work.exchanges, work.counts[0], work.right)
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
def response(program, work, row, along):
    """Write the y that make A_activeᵀ y nearest to a row by K⁻¹; return the share of the row that they leave."""
    count, vector = work.counts[0], work.vector
    write_row(program, row, vector)
    _solve(work, vector)
    whole = left = row_product(program, row, vector)
    for w in range(count):
        work.right[w] = -row_product(program, work.rows[w], vector)
    solve_lu(work.factors, work.exchanges, work.counts[0], work.right)
    for i in range(len(along)):
        along[i] = 0.0
    for w in range(count):
        left += work.right[w] * row_product(program, row, work.solved[w])
        if work.is_active[work.rows[w]]:
            along[work.rows[w]] = -work.right[w]
    return left / max(whole, 1e-300)


@compiled
def is_definite_without(work, row):
    """Return whether curvature stays positive without an active row, by Haynsworth's inertia formula."""
    place = work.position[row]
    for w in range(work.counts[0]):
        work.right[w] = w == place
    solve_lu(work.factors, work.exchanges, work.counts[0], work.right)
    return work.right[place] - work.stiffness[place] > CURVATURE * work.stiffness[place]


@compiled
def add_constraint(program, work, row):
    """Make a constraint active; the system is to be updated then."""
    work.is_active[row] = True
    work.counts[1] += 1
    if work.position[row] < 0:
        _append(program, work, row, 0.0)


@compiled
def drop_constraint(work, row):
    """Make an active constraint inactive; the system is to be updated then."""
    place = work.position[row]
    work.is_active[row] = False
    work.counts[1] += 1
    if work.stiffness[place] == 0.0:
        _remove(work, place)


@compiled
def update_working_set(program, work, multipliers, updates, scale):
    """Factorise the system after constraints came or went, K too after ``updates``; return whether it is definite."""
    if work.counts[1] <= updates and _factorise_schur(work):
        return True
    return factorise_working_set(program, work, multipliers, False, scale)


@compiled
def _remove(work, place):
    """Remove a row from the Schur complement, the last one taking its place."""
    last = work.counts[0] - 1
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
    work.counts[0] = last
