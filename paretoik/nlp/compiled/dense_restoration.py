"""Levenberg and Marquardt's method for the equalities of small programs, compiled."""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled
from paretoik.nlp.compiled.dense_program import equality_error, evaluate_rows, first_derivatives


@compiled
def restore_equalities(kernel, work, x):
    """Move x onto h(x) = 0 by Levenberg & Marquardt's method (Nocedal & Wright, section 10.3); return what is left."""
    damping = 0.0
    evaluate_rows(kernel, work, x, True)
    error = equality_error(kernel, work)
    for _ in range(kernel.restorations):
        if error <= kernel.equality_tolerance or not error < np.inf:
            break
        square = 0.0
        for i in range(kernel.equalities):
            work.right[i] = work.values[i]
            square += work.values[i] ** 2
        first_derivatives(kernel, work, x, True)
        if not _damped_step(kernel, work, damping):
            damping = max(1e-12, 10 * damping)
            if damping > 1e12:
                break
            continue
        for j in range(kernel.unknowns):
            work.gradient[j] = x[j] - work.vector[j]
        evaluate_rows(kernel, work, work.gradient, True)
        error = equality_error(kernel, work)
        after = 0.0
        for i in range(kernel.equalities):
            after += work.values[i] ** 2
        if after < square:
            for j in range(kernel.unknowns):
                x[j] = work.gradient[j]
            damping = damping / 10 if damping > 1e-12 else 0.0
        else:
            damping = max(1e-6, 10 * damping)
            evaluate_rows(kernel, work, x, True)
            error = equality_error(kernel, work)
            if damping > 1e12:
                break
    return 0.0 if error <= 100 * kernel.equality_tolerance else error


@compiled
def _damped_step(kernel, work, damping):
    """Write ∂hᵀ (∂h ∂hᵀ + damping · I)⁻¹ h, the damping relative to the mean of the diagonal; False where singular."""
    m, n = kernel.equalities, kernel.unknowns
    trace = 0.0
    for i in range(m):
        for k in range(i + 1):
            total = 0.0
            for j in range(n):
                total += work.jacobian[i, j] * work.jacobian[k, j]
            work.matrix[i, k] = total
        trace += work.matrix[i, i]
    for i in range(m):
        work.matrix[i, i] += damping * trace / m
    for i in range(m):
        for k in range(i + 1):
            total = work.matrix[i, k]
            for j in range(k):
                total -= work.matrix[i, j] * work.matrix[k, j]
            if k < i:
                work.matrix[i, k] = total / work.matrix[k, k]
            elif total > 1e-13 * trace:
                work.matrix[i, i] = np.sqrt(total)
            else:
                return False
    for i in range(m):
        for k in range(i):
            work.right[i] -= work.matrix[i, k] * work.right[k]
        work.right[i] /= work.matrix[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            work.right[i] -= work.matrix[k, i] * work.right[k]
        work.right[i] /= work.matrix[i, i]
    for j in range(n):
        work.vector[j] = 0.0
        for i in range(m):
            work.vector[j] += work.jacobian[i, j] * work.right[i]
    return True
