"""A parametric quadratic program, followed from guessed multipliers; compiled.

    minimise    ½ dᵀH d + gᵀd
    subject to  c + A d ≥ 0

The step d = 0 and the multipliers y ≥ 0 are optimal for the gradient Aᵀy and slacks that are 0 if y > 0. From these
data to the true ones the optimum moves in straight pieces; at the end of a piece a constraint is added or dropped. Near
the solution there are few pieces. H must be positive definite only along the active constraints: if dropping one leaves
negative curvature, the optimum ends, and so does the homotopy; if curvature is 0, the step is as short as possible.
Source: Best 1996, An algorithm for the solution of the parametric quadratic programming problem; Ferreau, Bock & Diehl
2008. The Schur complement of the active constraints solves the system of a piece (``working_set``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.array_tuples import keep, refer
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.linear_algebra import norm
from paretoik.nlp.parametric_qp.working_set import (
    QuadraticProgram,
    add_constraint,
    add_row,
    allocate_working_set,
    drop_constraint,
    drop_or_regularise,
    factorise_working_set,
    project_row,
    row_product,
    solve_working_set,
    update_working_set,
)


class QpOptions(NamedTuple):
    """Tolerances without unit: rows of A have length one; H and g are divided by ‖g‖.

    changes: largest number of changes of the active set; more count as cycling
    updates: number of updates before the matrix is factorised again
    """

    changes: int = 100
    updates: int = 24
    dependent: float = 1e-10  # largest share of a row outside the span of active rows that counts as 0
    rate: float = 1e-13  # largest rate of fall of a slack or a multiplier that is rounding
    lift: float = 1e-4  # first value of slacks, each times its own factor from 1 to 2: ties could cycle
    end: float = 1e-9  # largest remaining share of the homotopy that counts as 0


class QpHomotopy(NamedTuple):
    """The optimum, the rates of the data, and the rates of the optimum."""

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
    """Return (step, multipliers, share of the homotopy, changes of the active set) of a quadratic program's solution.

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
    """Follow the optimum to the true data or its end; return the homotopy's share and the number of changes."""
    share, changes = 0.0, 0
    if not factorise_working_set(program, work, scale):
        return share, changes
    while changes <= options.changes:
        solve_working_set(program, work, homotopy)
        for i in range(len(homotopy.slacks)):
            homotopy.slack_rates[i] = 0.0
            if not work.is_active[i]:
                homotopy.slack_rates[i] = homotopy.value_rate[i] + row_product(program, i, homotopy.step_rate)
        # the piece's length, the constraint that ends it (−1: none), and whether it is dropped
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
    """Add a constraint, in place of one that it depends on if any; return whether all can be satisfied."""
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
