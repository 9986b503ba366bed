"""A parametric quadratic program, followed from guessed multipliers; compiled.

    minimise    ½ dᵀH d + gᵀd
    subject to  c + A d ≥ 0

For guessed multipliers y ≥ 0, the step d = 0 is optimal if the gradient is Aᵀy and slacks are 0 for y > 0. While these
data change into the true ones, the optimum moves in straight pieces; a constraint is added or dropped at the end of
each. If the guess is good, there are few pieces. H must be positive definite only along the active constraints: if
dropping one leaves negative curvature, the homotopy ends; if curvature is 0, the step is as short as possible.
Source: Best 1996, An algorithm for the solution of the parametric quadratic programming problem; Ferreau, Bock & Diehl
2008. The Schur complement of the active constraints solves the system of a piece.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.array_tuples import keep, refer
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.banded.cholesky import (
    BorderedMatrix,
    add_entry,
    allocate_matrix,
    clear_matrix,
    factorise,
    solve,
    solve_columns,
)
from paretoik.nlp.linear_algebra import factorise_lu, norm, solve_lu

# The quadratic program in arrays, and its rows.


class QuadraticProgram(NamedTuple):
    """The program min ½ dᵀHd + gᵀd with c + Ad ≥ 0; rows of A, sparse ones first, have length one."""

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


@compiled
def column_products(program, i, matrix, first, count, products):
    """Write the products of row i with the columns ``first`` to ``count`` − 1 of a matrix."""
    limits = len(program.entries)
    for w in range(first, count):
        products[w] = 0.0
    if i >= limits:
        for j in range(len(matrix)):
            _add_products(program.dense[i - limits, j], matrix[j], first, count, products)
        return
    for k in range(program.columns.shape[1]):
        _add_products(program.entries[i, k], matrix[program.columns[i, k]], first, count, products)


@compiled
def _add_products(factor, row, first, count, products):
    for w in range(first, count):
        products[w] += factor * row[w]


# The Hessian of a quadratic program, made definite by its active rows, and its factors.
#
# K = H + ρ Σ aᵢaᵢᵀ over active rows is positive definite if H is positive definite along them and ρ is large. With only
# the sparse rows K is banded; if it is not definite, all rows count and K is dense. If H has no curvature along the
# rows, it is regularised from then on, so that the optimum does not move without need. Source: Nocedal & Wright,
# section 17.4.


class WorkingSetOptions(NamedTuple):
    """Settings of K; ρ and the regularisation are relative to the largest diagonal entry of H."""

    stiffness: tuple[float, ...] = (1.0, 1e3, 1e3, 1e6, 1e6)  # ρ, tried in order: a larger one costs digits
    dense: int = 2  # index of the first ρ with all rows
    flat: int = 4  # index of the ρ with a regularised H
    regularisation: float = 1e-6  # added to H's diagonal from then on: much less than any curvature that counts
    curvature: float = 1e-13  # least curvature along a row that may be dropped, as a share of ρ: less is rounding


OPTIONS = WorkingSetOptions()
IS_DENSE, IS_REGULARISED = 0, 1  # indices of ``flags``
ROWS, CHANGES = 0, 1  # indices of ``counts``


@compiled
def factorise_hessian(program, work, scale):
    """Factorise K for H / ``scale``; return the first ρ that makes K definite, −1 if none does."""
    (size, band), border, limits, n = program.A.shape, len(program.C), len(program.entries), len(program.gradient)
    largest = 0.0
    for i in range(size):
        largest = max(largest, abs(program.A[i, 0]) / scale)
    largest += largest == 0.0
    for attempt in range(OPTIONS.flat if work.flags[IS_REGULARISED] else 0, len(OPTIONS.stiffness)):
        is_dense, is_regularised = attempt >= OPTIONS.dense, attempt == OPTIONS.flat
        work.flags[IS_DENSE], work.flags[IS_REGULARISED] = is_dense, is_regularised
        rho = OPTIONS.stiffness[attempt] * largest
        delta = OPTIONS.regularisation * largest if is_regularised else 0.0
        # H / scale + delta I
        K = work.full if is_dense else work.banded
        clear_matrix(K)
        for i in range(size):
            for d in range(min(band, i + 1)):
                K.A[i, d] = program.A[i, d] / scale
            K.A[i, 0] += delta
        for e in range(border):
            for j in range(size):
                add_entry(K, size + e, j, program.B[e, j] / scale)
            for f in range(e + 1):
                add_entry(K, size + e, size + f, program.C[e, f] / scale)
            add_entry(K, size + e, size + e, delta)
        # ρ aaᵀ of the active rows; dense rows only if K is dense
        for i in range(limits):
            in_order = K.A.shape[1] == n  # whether the row's entries are those of the first unknowns of a dense K
            for k in range(program.columns.shape[1]):
                in_order &= program.columns[i, k] == k
            if work.is_active[i] and in_order:
                _add_square(K.A, rho, program.entries[i])
            elif work.is_active[i]:
                for a in range(program.columns.shape[1]):
                    for b in range(program.columns.shape[1]):
                        row, column = program.columns[i, a], program.columns[i, b]
                        value = rho * program.entries[i, a] * program.entries[i, b]
                        if row >= column and value != 0.0:
                            add_entry(K, row, column, value)
        for e in range(len(program.dense) if is_dense else 0):
            if work.is_active[limits + e]:
                for i in range(n):
                    for j in range(i + 1):
                        K.A[i, i - j] += rho * program.dense[e, i] * program.dense[e, j]
        if factorise(K, 0):
            return rho
    return -1.0


@compiled
def _add_square(matrix, rho, row):
    """Add ρ aaᵀ to a dense matrix; the entries of row a are those of the first unknowns."""
    for i in range(len(row)):
        factor = rho * row[i]
        for d in range(i + 1):
            matrix[i, d] += factor * row[i - d]


@compiled
def factorised(work):
    """Return K, banded or dense, as it was factorised."""
    return work.full if work.flags[IS_DENSE] else work.banded


# The optimality system of a quadratic program for its current active constraints.
#
#     [H, −Aᵀ] [d]   [r]
#     [A,   0] [y] = [b]
#
# With K = H + ρ Σ aᵢaᵢᵀ and ŷ = y + ρ b, the solution is d = K⁻¹(r + Aᵀŷ) with A K⁻¹ Aᵀ ŷ = b − A K⁻¹ r. A dropped row
# stays until K is factorised again; until then its ŷ = ρ aᵀd cancels its part of K. Source: Nocedal & Wright, sections
# 16.2 and 17.4; Gill, Murray, Saunders & Wright 1990, A Schur-complement method for sparse quadratic programming.


class WorkingSet(NamedTuple):
    """The factors of K, and the rows of the Schur complement."""

    banded: BorderedMatrix  # K with only the sparse rows
    full: BorderedMatrix  # K with all rows: its band is as wide as the matrix
    flags: np.ndarray  # whether K is ``full``, and whether H is regularised
    rows: np.ndarray  # (capacity,) constraints
    stiffness: np.ndarray  # (capacity,): ρ of rows in K, else 0
    solved: np.ndarray  # (capacity, unknowns): K⁻¹ a
    schur: np.ndarray  # (capacity, capacity)
    factors: np.ndarray  # LU factors of schur, with row exchanges
    exchanges: np.ndarray
    right: np.ndarray  # (capacity,)
    vector: np.ndarray  # (unknowns,)
    columns: np.ndarray  # (unknowns, capacity)
    position: np.ndarray  # (constraints,): index in ``rows``, −1 for none
    is_active: np.ndarray  # (constraints,)
    counts: np.ndarray  # numbers of rows, and of changes since K was factorised


@compiled
def allocate_working_set(n, band, border, constraints, updates):
    """Return the arrays for n unknowns."""
    capacity = n + updates + 4
    return WorkingSet(
        allocate_matrix(n - border, band, border),
        allocate_matrix(n, n, 0),
        np.zeros(2, dtype=np.bool_),
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
    """Factorise K, for H / ``scale``, and the Schur complement of the active rows; return whether K is definite."""
    count = 0
    for i in range(len(work.is_active)):
        work.position[i] = -1
        count += work.is_active[i]
    if count > len(program.gradient):
        return False
    work.counts[ROWS], work.counts[CHANGES] = 0, 0
    rho = factorise_hessian(program, work, scale)
    if rho < 0.0:
        return False
    # active rows enter the empty Schur complement one by one
    place = 0
    for i in range(len(work.is_active)):
        if work.is_active[i]:
            is_stiff = work.flags[IS_DENSE] or i < len(program.entries)
            work.rows[place], work.position[i], work.stiffness[place] = i, place, rho if is_stiff else 0.0
            write_column(program, i, work.columns, place)
            place += 1
    work.counts[ROWS] = place
    solve_columns(factorised(work), work.columns, place)
    for w in range(place):
        column_products(program, work.rows[w], work.columns, w, place, work.right)
        for v in range(w, place):
            work.schur[v, w] = work.schur[w, v] = work.right[v]
        for j in range(len(work.columns)):
            work.solved[w, j] = work.columns[j, w]
    return _factorise_schur(work)


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
def solve_working_set(program, work, homotopy):
    """Write the rates d and y of the optimum for the rates of the data; y of inactive rows is 0.

    r = −(rate of the gradient) and b = −(rate of the values).
    """
    gradient_rate, value_rate = homotopy.gradient_rate, homotopy.value_rate
    step_rate, multiplier_rates = homotopy.step_rate, homotopy.multiplier_rates
    count, vector = work.counts[ROWS], work.vector
    for j in range(len(vector)):
        vector[j] = -gradient_rate[j]
    solve(factorised(work), vector)
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
    """Write the y whose A_activeᵀ y is nearest to a row in the norm of K⁻¹; return the share that is left."""
    count, vector = work.counts[ROWS], work.vector
    write_row(program, row, vector)
    solve(factorised(work), vector)
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
def drop_or_regularise(work, row):
    """Drop an active constraint; return whether the optimum continues without it.

    It does if curvature stays positive (Haynsworth's inertia formula). Else H is regularised, and the next update
    decides; if H is regularised already, the optimum ends.
    """
    place = work.position[row]
    for w in range(work.counts[ROWS]):
        work.right[w] = w == place
    solve_lu(work.factors, work.exchanges, work.counts[ROWS], work.right)
    if work.right[place] - work.stiffness[place] > OPTIONS.curvature * work.stiffness[place]:
        drop_constraint(work, row)
        return True
    if work.flags[IS_REGULARISED]:
        return False
    work.is_active[row], work.flags[IS_REGULARISED] = False, True
    work.counts[CHANGES] = len(work.rows)  # more than any number of updates: factorise K again
    return True


@compiled
def add_constraint(program, work, row):
    """Make a constraint active; the caller must then update the system."""
    work.is_active[row] = True
    work.counts[CHANGES] += 1
    if work.position[row] < 0:
        # the row enters the Schur complement
        count = work.counts[ROWS]
        vector = work.solved[count]
        write_row(program, row, vector)
        solve(factorised(work), vector)
        work.rows[count], work.position[row], work.stiffness[count] = row, count, 0.0
        for w in range(count + 1):
            work.schur[count, w] = work.schur[w, count] = row_product(program, work.rows[w], vector)
        work.counts[ROWS] = count + 1


@compiled
def drop_constraint(work, row):
    """Make an active constraint inactive; the caller must then update the system."""
    place = work.position[row]
    work.is_active[row] = False
    work.counts[CHANGES] += 1
    if work.stiffness[place] == 0.0:
        # the row leaves the Schur complement; the last row takes its place
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


@compiled
def update_working_set(program, work, updates, scale):
    """Factorise the system after changes, and K if these exceed ``updates``; return whether K is definite."""
    if work.counts[CHANGES] <= updates and _factorise_schur(work):
        return True
    return factorise_working_set(program, work, scale)


# The homotopy.


class QpOptions(NamedTuple):
    """Tolerances without unit: rows of A have length one; H and g are divided by ‖g‖.

    changes: largest number of changes of the active set; more count as cycling
    updates: number of updates before K is factorised again
    """

    changes: int = 100
    updates: int = 24
    dependent: float = 1e-10  # largest share of a row outside the span of active rows that counts as 0
    rate: float = 1e-13  # largest rate of decrease of a slack or a multiplier that counts as rounding
    lift: float = 1e-4  # first value of slacks, each times its own factor from 1 to 2: equal slacks could cycle
    end: float = 1e-9  # largest remaining share of the homotopy that counts as 0


class QpHomotopy(NamedTuple):
    """Optimum of a QP; rates of its data and of the optimum along the homotopy."""

    step: np.ndarray
    multipliers: np.ndarray
    slacks: np.ndarray
    gradient_rate: np.ndarray
    value_rate: np.ndarray
    step_rate: np.ndarray
    slack_rates: np.ndarray
    multiplier_rates: np.ndarray


@compiled(what="the parametric quadratic program", seconds=5)
def solve_from(A, B, C, gradient, columns, entries, dense, values, multipliers, options):
    """Return a quadratic program's (step, multipliers, share of the homotopy, changes of the active set).

        minimise    ½ dᵀH d + gᵀd,  H = [[A, Bᵀ], [B, C]] with A banded (``banded.cholesky``)
        subject to  values + [rows] d ≥ 0

    Row i has ``entries``[i] at ``columns``[i]; the ``dense`` rows follow. Rows with a positive guess in ``multipliers``
    must be independent. A share below 1 means that the optimum ends there: constraints cannot all be satisfied, or
    curvature becomes negative.
    """
    entries, dense, values, scale = entries.copy(), dense.copy(), values.copy(), max(norm(gradient), 1e-300)
    # constraints are divided by the lengths of their rows
    limits = len(entries)
    lengths = np.empty(len(values))
    for i in range(len(values)):
        row = entries[i] if i < limits else dense[i - limits]
        lengths[i] = max(norm(row), 1e-300)
        for j in range(len(row)):
            row[j] /= lengths[i]
        values[i] /= lengths[i]
    arrays = QuadraticProgram(A, B, C, gradient, columns, entries, dense, values)
    program = refer(arrays)
    work = allocate_working_set(len(gradient), A.shape[1], len(C), len(values), options.updates)
    # the homotopy begins at the data for which the guess is optimal
    n, count = len(gradient), len(values)
    homotopy = QpHomotopy(
        np.zeros(n), np.zeros(count), np.zeros(count), np.zeros(n), np.zeros(count), np.zeros(n), np.zeros(count),
        np.zeros(count),
    )  # fmt: skip
    for j in range(n):
        homotopy.gradient_rate[j] = gradient[j] / scale
    for i in range(count):
        if multipliers[i] > 0.0:
            homotopy.multipliers[i] = multipliers[i] * lengths[i] / scale
            add_row(program, i, -homotopy.multipliers[i], homotopy.gradient_rate)
        else:
            lift = 1.0 + i * (np.sqrt(5.0) - 1.0) / 2 % 1.0
            homotopy.slacks[i] = max(values[i], 0.0) + options.lift * lift
        homotopy.value_rate[i] = values[i] - homotopy.slacks[i]
        work.is_active[i] = homotopy.multipliers[i] > 0.0
    share, changes = _follow(program, refer(work), refer(homotopy), scale, options)
    for i in range(count):
        homotopy.multipliers[i] *= scale / lengths[i]
    keep(arrays)
    keep(work)
    return homotopy.step, homotopy.multipliers, share, changes


@compiled
def _follow(program, work, homotopy, scale, options):
    """Follow the optimum to the true data, or until it ends; return the homotopy's share and changes."""
    share, changes = 0.0, 0
    if not factorise_working_set(program, work, scale):
        return share, changes
    while changes <= options.changes:
        solve_working_set(program, work, homotopy)
        for i in range(len(homotopy.slacks)):
            homotopy.slack_rates[i] = 0.0
            if not work.is_active[i]:
                homotopy.slack_rates[i] = homotopy.value_rate[i] + row_product(program, i, homotopy.step_rate)
        # the length of the piece: the least −slack / rate or −multiplier / rate; ``row`` ends it (−1: none)
        length, row, dropped = 1.0 - share, -1, False
        for i in range(len(homotopy.slacks)):
            if not work.is_active[i] and homotopy.slack_rates[i] < -options.rate:
                ratio = homotopy.slacks[i] / -homotopy.slack_rates[i]
                if ratio < length:
                    length, row, dropped = ratio, i, False
            elif work.is_active[i] and homotopy.multiplier_rates[i] < -options.rate:
                ratio = max(homotopy.multipliers[i], 0.0) / -homotopy.multiplier_rates[i]
                if ratio < length:
                    length, row, dropped = ratio, i, True
        # move the optimum along its piece
        for j in range(len(homotopy.step)):
            homotopy.step[j] += length * homotopy.step_rate[j]
        for i in range(len(homotopy.slacks)):
            if work.is_active[i]:
                homotopy.multipliers[i] += length * homotopy.multiplier_rates[i]
            else:
                homotopy.slacks[i] = max(homotopy.slacks[i] + length * homotopy.slack_rates[i], 0.0)
        share += length
        if row < 0 or share > 1.0 - options.end:
            return 1.0, changes
        changes += 1
        if dropped:
            homotopy.multipliers[row], homotopy.slacks[row] = 0.0, 0.0
            continues = drop_or_regularise(work, row)
        else:
            continues = _add(program, work, homotopy, row, options)
        if not continues or not update_working_set(program, work, options.updates, scale):
            return share, changes
    return share, changes


@compiled
def _add(program, work, homotopy, row, options):
    """Add a constraint, or exchange one that it depends on for it; return whether all can be satisfied."""
    remainder = project_row(program, work, row, homotopy.multiplier_rates)
    homotopy.slacks[row] = 0.0
    if remainder <= options.dependent:
        leaving, length = -1, np.inf
        for i in range(len(homotopy.slacks)):
            if work.is_active[i] and homotopy.multiplier_rates[i] > np.sqrt(options.dependent):
                ratio = homotopy.multipliers[i] / homotopy.multiplier_rates[i]
                if ratio < length:
                    leaving, length = i, ratio
        if leaving < 0:
            return False
        for i in range(len(homotopy.slacks)):
            if work.is_active[i]:
                homotopy.multipliers[i] = max(homotopy.multipliers[i] - length * homotopy.multiplier_rates[i], 0.0)
        homotopy.multipliers[row], homotopy.multipliers[leaving] = length, 0.0
        homotopy.slacks[leaving] = 0.0
        drop_constraint(work, leaving)
    add_constraint(program, work, row)
    return True
