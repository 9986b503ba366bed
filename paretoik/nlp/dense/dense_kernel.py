"""The kernel with a dense Newton matrix, for small programs (``dense_program``)."""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.evaluator import BLOCK_SIZE
from paretoik.nlp.banded import kernel as steps
from paretoik.nlp.banded.kernel import implement
from paretoik.nlp.dense.dense_rows import (
    SECOND,
    DenseKernel,
    DenseWorkspace,
    equality_error,
    evaluate_rows,
    first_derivatives,
    restore_equalities,
    run_part,
)
from paretoik.nlp.linear_algebra import (
    back_substitute,
    eliminate,
    norm,
    rotate,
    rotate_back,
    rotate_matrix,
    triangularise,
)

__all__ = ["DenseKernel"]  # this file implements its steps


@implement(steps.dimensions, DenseKernel)
def dimensions(kernel, x):
    """Return (size, band, border) of the Newton matrix and the number of inequalities."""
    size = kernel.unknowns - kernel.equalities
    return size, size, 0, kernel.inequalities


@implement(steps.objective_scale, DenseKernel)
def objective_scale(kernel, weights):
    """Return the length of the gradient of weights · F, or 1 if that is 0."""
    total = 0.0
    for j in range(kernel.unknowns):
        slope = 0.0
        for k in range(len(weights)):
            slope += weights[k] * kernel.objectives[k, j]
        total += slope * slope
    return np.sqrt(total) if total > 0.0 else 1.0


@implement(steps.allocate_workspace, DenseKernel)
def allocate_workspace(kernel, x):
    """Return the workspace."""
    n, m = kernel.unknowns, kernel.equalities
    inputs, space = 1, 1
    for p in range(len(kernel.parts)):
        places, rows = kernel.parts[p, 0], kernel.parts[p, 3]
        inputs = max(inputs, (kernel.parts[p, 1] + kernel.parts[p, 2] + rows) * places)
        for which in range(3):
            space = max(space, kernel.programs[p, which, 8] * min(places, BLOCK_SIZE))
    return DenseWorkspace(
        np.zeros(inputs),
        np.empty(space),
        np.empty(len(kernel.row)),
        np.empty(len(kernel.first_row)),
        np.empty(len(kernel.second_row)),
        np.empty(m + kernel.inequalities),
        np.zeros(m + kernel.inequalities),
        np.zeros((m, n)),
        np.zeros((m, m)),
        np.zeros((m, n)),
        np.zeros((m, m)),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        np.zeros(m),
        np.zeros((n, n)),
    )


@implement(steps.add_auxiliary, DenseKernel)
def add_auxiliary(kernel, work, x):
    """Return a copy of x."""
    return x.copy()


@implement(steps.remove_auxiliary, DenseKernel)
def remove_auxiliary(kernel, x):
    """Return x."""
    return x


@implement(steps.set_smoothing, DenseKernel)
def set_smoothing(kernel, work, mu):
    """Return False: nothing is smoothed."""
    return False


@implement(steps.restore, DenseKernel)
def restore(kernel, work, x):
    """Move x onto h(x) = 0; return the largest |h| that is left."""
    return restore_equalities(kernel, work, x)


@implement(steps.evaluate, DenseKernel)
def evaluate(kernel, work, x, F, c):
    """Write F and c at x."""
    for k in range(len(F)):
        F[k] = 0.0
        for j in range(kernel.unknowns):
            F[k] += kernel.objectives[k, j] * x[j]
    evaluate_rows(kernel, work, x, False)
    for i in range(kernel.inequalities):
        c[i] = work.values[kernel.equalities + i]


@implement(steps.linearise, DenseKernel)
def linearise(kernel, work, x):
    """Write first derivatives and the reflections that triangularise ∂hᵀ; False if rank is deficient."""
    for j in range(kernel.unknowns):
        work.point[j] = x[j]
    first_derivatives(kernel, work, x, False)
    for i in range(kernel.equalities):
        for j in range(kernel.unknowns):
            work.reflectors[i, j] = work.jacobian[i, j]
    return triangularise(work.reflectors, work.triangle)


@implement(steps.reduced_gradient, DenseKernel)
def reduced_gradient(kernel, work, weights, multipliers, out):
    """Write ∇(weights · F − multipliers · c) along the null space; the workspace has all of it, rotated."""
    n, m = kernel.unknowns, kernel.equalities
    for j in range(n):
        work.gradient[j] = 0.0
    for k in range(len(weights)):
        if weights[k] != 0.0:
            for j in range(n):
                work.gradient[j] += weights[k] * kernel.objectives[k, j]
    if len(multipliers):
        for i in range(kernel.inequalities):
            work.multipliers[m + i] = -multipliers[i]
        for e in range(len(work.first)):
            if kernel.first_row[e] >= m:
                work.gradient[kernel.first_column[e]] += work.multipliers[kernel.first_row[e]] * work.first[e]
    rotate(work.reflectors, work.gradient)
    for j in range(n - m):
        out[j] = work.gradient[m + j]


@implement(steps.prepare_multipliers, DenseKernel)
def prepare_multipliers(kernel, work, weights):
    """Write the multipliers ν of h: ∂hᵀ ν = −(gradient across the null space)."""
    for i in range(kernel.equalities):
        work.multipliers[i] = -work.gradient[i]
    back_substitute(work.triangle, work.multipliers)


@implement(steps.residual_norm, DenseKernel)
def residual_norm(kernel, residual):
    """Return the Euclidean length."""
    return norm(residual)


@implement(steps.assemble, DenseKernel)
def assemble(kernel, work, stiffness, A, B, C):
    """Write Zᵀ (∇²L + ∂cᵀ diag(stiffness) ∂c) Z; return the size of its diagonal."""
    n, m, hessian = kernel.unknowns, kernel.equalities, work.hessian
    for i in range(n):
        for j in range(n):
            hessian[i, j] = 0.0
    for p in range(len(kernel.parts)):
        run_part(kernel, work, work.point, p, SECOND, work.second[kernel.begin_second[p] : kernel.begin_second[p + 1]])
    for e in range(len(work.second)):
        i, j = kernel.second_row[e], kernel.second_column[e]
        hessian[max(i, j), min(i, j)] += work.second[e]
    largest = 0.0
    for i in range(n):
        largest = max(largest, abs(hessian[i, i]))
    # add ∂cᵀ diag(stiffness) ∂c to the lower half
    for i in range(kernel.inequalities):
        for a in range(kernel.begin_row[i], kernel.begin_row[i + 1]):
            one = kernel.by_row[a]
            column, scaled = kernel.first_column[one], stiffness[i] * work.first[one]
            for b in range(kernel.begin_row[i], a + 1):
                other = kernel.by_row[b]
                hessian[column, kernel.first_column[other]] += scaled * work.first[other]
    for i in range(n):
        for j in range(i):
            hessian[j, i] = hessian[i, j]
    rotate_matrix(work.reflectors, work.vector, hessian)
    for i in range(n - m):
        for j in range(i + 1):
            A[i, i - j] = hessian[m + i, m + j]
    return max(largest, 1e-3)


@implement(steps.expand_step, DenseKernel)
def expand_step(kernel, work, step, dx):
    """Write dx = Z · step; return its largest entry."""
    m, largest = kernel.equalities, 0.0
    for j in range(kernel.unknowns):
        dx[j] = step[j - m] if j >= m else 0.0
    rotate_back(work.reflectors, dx)
    for j in range(kernel.unknowns):
        largest = max(largest, abs(dx[j]))
    return largest


@implement(steps.directional_derivatives, DenseKernel)
def directional_derivatives(kernel, work, dx, dF, dc):
    """Write the derivatives of F and c along dx."""
    for k in range(len(dF)):
        dF[k] = 0.0
        for j in range(kernel.unknowns):
            dF[k] += kernel.objectives[k, j] * dx[j]
    for i in range(kernel.inequalities):
        dc[i] = 0.0
    for e in range(len(work.first)):
        if kernel.first_row[e] >= kernel.equalities:
            dc[kernel.first_row[e] - kernel.equalities] += work.first[e] * dx[kernel.first_column[e]]


@implement(steps.row_width, DenseKernel)
def row_width(kernel, work):
    """Return the number of columns of the null space."""
    return kernel.unknowns - kernel.equalities


@implement(steps.constraint_rows, DenseKernel)
def constraint_rows(kernel, work, columns, entries):
    """Write the rows of inequalities along the null space."""
    m, row = kernel.equalities, np.zeros(kernel.unknowns)
    for i in range(kernel.inequalities):
        for j in range(kernel.unknowns):
            row[j] = 0.0
        for a in range(kernel.begin_row[i], kernel.begin_row[i + 1]):
            row[kernel.first_column[kernel.by_row[a]]] += work.first[kernel.by_row[a]]
        rotate(work.reflectors, row)
        for j in range(kernel.unknowns - m):
            columns[i, j], entries[i, j] = j, row[m + j]


@implement(steps.retract, DenseKernel)
def retract(kernel, work, x, dx, length, trial):
    """Write the point on h = 0 from a step, by Newton steps across the null space at x."""
    m, n = kernel.equalities, kernel.unknowns
    for j in range(n):
        trial[j] = x[j] + length * dx[j]
    if m == 0:
        return True
    for attempt in range(kernel.retractions):
        evaluate_rows(kernel, work, trial, True)
        error = equality_error(kernel, work)
        if error <= kernel.equality_tolerance:
            return True
        if not error < kernel.far or attempt == kernel.retractions - 1:
            return error <= 100 * kernel.equality_tolerance
        first_derivatives(kernel, work, trial, True)
        for i in range(m):
            work.right[i] = work.values[i]
            rotate(work.reflectors, work.jacobian[i])
            for k in range(m):
                work.matrix[i, k] = work.jacobian[i, k]
        if not eliminate(work.matrix, work.right, work.triangle):
            return False
        for j in range(n):
            work.vector[j] = work.right[j] if j < m else 0.0
        rotate_back(work.reflectors, work.vector)
        for j in range(n):
            trial[j] -= work.vector[j]
    return False
