"""The limits of a motion, each a variable or a function at an instant, as rows of its program; compiled.

Row i is factors[i] · (value − bounds[i]) ≥ 0, the value that of row ``limited``[i, 0] at instant ``limited``[i, 1]: of
the variables u at an instant first, then of the functions that are limited.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled
from paretoik.nlp.compiled.array_loops import clear
from paretoik.trajectory.compiled import self_motion_steps


@compiled
def limit_gradient(kernel, work, multipliers):
    """Write the gradient of −multipliers · c by u, and the multipliers of variables and rows in their own units."""
    gradient_u, by_row, gradients = work.gradient_u, work.by_row, work.gradients
    limited, factors = kernel.limited, kernel.factors
    variables, samples = gradient_u.shape
    clear(by_row)
    for i in range(len(factors)):
        by_row[limited[i, 0], limited[i, 1]] -= factors[i] * multipliers[i]
    sums = len(work.objective_gradients)
    for a in range(variables):
        for s in range(samples):
            gradient_u[a, s] = by_row[a, s]
        for g in range(len(kernel.row_peaks)):
            for s in range(samples):
                gradient_u[a, s] += by_row[variables + g, s] * gradients[sums + g, a, s]


@compiled
def sum_stiffness(kernel, work, stiffness):
    """Write the stiffness of variables and rows in their own units."""
    by_row, limited = work.by_row, kernel.limited
    clear(by_row)
    for i in range(len(limited)):
        by_row[limited[i, 0], limited[i, 1]] += stiffness[i] * kernel.factors[i] ** 2


@compiled
def write_rows(kernel, work, columns, entries):
    """Write the rows of limits by the unknowns; there are no kinks and peaks."""
    variables, instants = work.gradient_u.shape
    limited, gradients, sums = kernel.limited, work.gradients, len(work.objective_gradients)
    r, width = work.tangent.shape[2], entries.shape[1]
    local = np.zeros((instants, variables, width))
    for s in range(instants):
        self_motion_steps.local_basis(
            s, kernel.neighbours, kernel.coefficients, work.tangent, work.curve.chain, local[s]
        )
    for i in range(len(limited)):
        row, s, factor = limited[i, 0], limited[i, 1], kernel.factors[i]
        for b in range(width):
            first = kernel.first_unknown[kernel.neighbours[s, b // r]]
            columns[i, b] = first + b % r if first >= 0 else 0
            entries[i, b] = factor * local[s, row, b] if row < variables and first >= 0 else 0.0
        if row >= variables:
            for a in range(variables):
                scaled = factor * gradients[sums + row - variables, a, s]
                if scaled != 0.0:
                    for b in range(width):
                        if kernel.first_unknown[kernel.neighbours[s, b // r]] >= 0:
                            entries[i, b] += scaled * local[s, a, b]
