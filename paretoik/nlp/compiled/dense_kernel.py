"""Small programs as compiled code takes them: the kernel whose Newton matrix is dense.

A program is made of parts, each a few functions of a few unknowns, the same at several places (``assembled``). Its
objectives are linear: F(x) = ``objectives`` · x. First and second derivatives are lists of entries, one a place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.evaluator import BLOCK_SIZE
from paretoik.autodiff.interpreter import run
from paretoik.compilation import compiled
from paretoik.nlp.compiled import kernel_steps as steps
from paretoik.nlp.compiled.array_loops import norm
from paretoik.nlp.compiled.householder import (
    back_substitute,
    eliminate,
    rotate,
    rotate_back,
    rotate_matrix,
    triangularise,
)
from paretoik.nlp.compiled.kernel_steps import implement

EQUALITY_TOLERANCE = 1e-12  # of h(x) = 0
RETRACTIONS = 10  # Newton steps at most
FAR = 1e3  # violation of h that no retraction starts from
RESTORATIONS = 400  # Levenberg–Marquardt steps at most
VALUE, FIRST, SECOND = 0, 1, 2


class DenseKernel(NamedTuple):
    """A program of parts. Rows are those of h, then those of c.

    ``programs`` (parts, 3, 10) are the beginnings and ends of code, constants, inputs and outputs of each part's
    values, first and second derivatives, its registers and outputs; ``parts`` (parts, 8) its places, unknowns,
    parameters, rows, whether it has equalities, and where its ``where``, ``parameters`` and rows begin.
    """

    unknowns: int
    equalities: int
    inequalities: int
    objectives: np.ndarray  # (objectives, unknowns)
    code: np.ndarray
    constants: np.ndarray
    inputs: np.ndarray
    outputs: np.ndarray
    programs: np.ndarray
    parts: np.ndarray
    where: np.ndarray  # unknowns of all parts, (unknowns, places) each
    parameters: np.ndarray  # likewise
    row: np.ndarray  # of the program, for the rows (rows, places) of each part
    begin_first: np.ndarray  # (parts + 1,) where its entries begin
    first_row: np.ndarray
    first_column: np.ndarray
    begin_second: np.ndarray
    second_row: np.ndarray
    second_column: np.ndarray
    by_row: np.ndarray  # the entries of first derivatives of c, row by row
    begin_row: np.ndarray  # (inequalities + 1,)
    longest_step: float = np.inf
    penalty: float = 100.0
    implied_slacks: bool = False
    large_multiplier: float = 100.0


class DenseWorkspace(NamedTuple):
    """What the steps write."""

    given: np.ndarray  # inputs of a part's program
    space: np.ndarray  # its registers
    outputs: np.ndarray  # rows, as parts give them
    first: np.ndarray
    second: np.ndarray
    values: np.ndarray  # (rows,)
    multipliers: np.ndarray  # (rows,) of h, then those of c, negative
    reflectors: np.ndarray  # (equalities, unknowns)
    triangle: np.ndarray  # (equalities, equalities): R of ∂hᵀ = Y R
    jacobian: np.ndarray  # (equalities, unknowns)
    matrix: np.ndarray  # (equalities, equalities)
    gradient: np.ndarray  # (unknowns,), rotated by the reflections
    vector: np.ndarray  # (unknowns,)
    point: np.ndarray  # (unknowns,) where derivatives are taken
    right: np.ndarray  # (equalities,)
    hessian: np.ndarray  # (unknowns, unknowns)


@implement(steps.dimensions, DenseKernel)
def dimensions(kernel, x):
    """Return (size, band, border) of the Newton matrix and the number of inequalities."""
    size = kernel.unknowns - kernel.equalities
    return size, size, 0, kernel.inequalities


@implement(steps.objective_scale, DenseKernel)
def objective_scale(kernel, weights):
    """Return the length of the gradient of weights · F, 1 where that is 0."""
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
    given, space = 1, 1
    for p in range(len(kernel.parts)):
        places, rows = kernel.parts[p, 0], kernel.parts[p, 3]
        given = max(given, (kernel.parts[p, 1] + kernel.parts[p, 2] + rows) * places)
        for which in range(3):
            space = max(space, kernel.programs[p, which, 8] * min(places, BLOCK_SIZE))
    return DenseWorkspace(
        np.zeros(given),
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


@compiled
def _run_part(kernel, work, x, p, which, out):
    """Run one program of a part at x, of the multipliers where it is the second derivatives."""
    places, unknowns, parameters, rows = kernel.parts[p, 0], kernel.parts[p, 1], kernel.parts[p, 2], kernel.parts[p, 3]
    where, given, first = kernel.parts[p, 5], kernel.parts[p, 6], kernel.parts[p, 7]
    inputs = work.given[: (unknowns + parameters + rows) * places]
    for i in range(unknowns * places):
        inputs[i] = x[kernel.where[where + i]]
    begin = unknowns * places
    for i in range(parameters * places):
        inputs[begin + i] = kernel.parameters[given + i]
    begin += parameters * places
    for i in range(rows * places):
        inputs[begin + i] = work.multipliers[kernel.row[first + i]] if which == SECOND else 0.0
    ends = kernel.programs[p, which]
    width = min(places, BLOCK_SIZE)
    run(
        (
            kernel.code[ends[0] : ends[1]],
            kernel.constants[ends[2] : ends[3]],
            kernel.inputs[ends[4] : ends[5]],
            kernel.outputs[ends[6] : ends[7]],
            work.space[: ends[8] * width].reshape((ends[8], width)),
        ),
        inputs.reshape((unknowns + parameters + rows, places)),
        out.reshape((ends[9], places)),
    )


@compiled
def _rows(kernel, work, x, equalities_only):
    """Write the values of h and c, or of h alone."""
    for p in range(len(kernel.parts)):
        if equalities_only and not kernel.parts[p, 4]:
            continue
        begin, count = kernel.parts[p, 7], kernel.parts[p, 3] * kernel.parts[p, 0]
        _run_part(kernel, work, x, p, VALUE, work.outputs[begin : begin + count])
        for i in range(begin, begin + count):
            work.values[kernel.row[i]] = work.outputs[i]


@compiled
def _equality_error(kernel, work):
    """Return the largest |h|, inf where one is not finite."""
    worst = 0.0
    for i in range(kernel.equalities):
        if not np.isfinite(work.values[i]):
            return np.inf
        worst = max(worst, abs(work.values[i]))
    return worst


@compiled
def _first_derivatives(kernel, work, x, equalities_only):
    """Write the entries of ∂h and ∂c, or those of parts with equalities, and ∂h as a matrix."""
    for p in range(len(kernel.parts)):
        if not equalities_only or kernel.parts[p, 4]:
            _run_part(kernel, work, x, p, FIRST, work.first[kernel.begin_first[p] : kernel.begin_first[p + 1]])
    for i in range(kernel.equalities):
        for j in range(kernel.unknowns):
            work.jacobian[i, j] = 0.0
    for p in range(len(kernel.parts)):
        if kernel.parts[p, 4]:
            for e in range(kernel.begin_first[p], kernel.begin_first[p + 1]):
                if kernel.first_row[e] < kernel.equalities:
                    work.jacobian[kernel.first_row[e], kernel.first_column[e]] += work.first[e]


@implement(steps.restore, DenseKernel)
def restore(kernel, work, x):
    """Move x onto h(x) = 0 by Levenberg & Marquardt's method (Nocedal & Wright, section 10.3); return what is left."""
    damping = 0.0
    _rows(kernel, work, x, True)
    error = _equality_error(kernel, work)
    for _ in range(RESTORATIONS):
        if error <= EQUALITY_TOLERANCE or not error < np.inf:
            break
        square = 0.0
        for i in range(kernel.equalities):
            work.right[i] = work.values[i]
            square += work.values[i] ** 2
        _first_derivatives(kernel, work, x, True)
        if not _damped_step(kernel, work, damping):
            damping = max(1e-12, 10 * damping)
            if damping > 1e12:
                break
            continue
        for j in range(kernel.unknowns):
            work.gradient[j] = x[j] - work.vector[j]
        _rows(kernel, work, work.gradient, True)
        error = _equality_error(kernel, work)
        after = 0.0
        for i in range(kernel.equalities):
            after += work.values[i] ** 2
        if after < square:
            for j in range(kernel.unknowns):
                x[j] = work.gradient[j]
            damping = damping / 10 if damping > 1e-12 else 0.0
        else:
            damping = max(1e-6, 10 * damping)
            _rows(kernel, work, x, True)
            error = _equality_error(kernel, work)
            if damping > 1e12:
                break
    return 0.0 if error <= 100 * EQUALITY_TOLERANCE else error


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


@implement(steps.evaluate, DenseKernel)
def evaluate(kernel, work, x, F, c):
    """Write F and c at x."""
    for k in range(len(F)):
        F[k] = 0.0
        for j in range(kernel.unknowns):
            F[k] += kernel.objectives[k, j] * x[j]
    _rows(kernel, work, x, False)
    for i in range(kernel.inequalities):
        c[i] = work.values[kernel.equalities + i]


@implement(steps.linearise, DenseKernel)
def linearise(kernel, work, x):
    """Write first derivatives and the reflections that triangularise ∂hᵀ; return False where its rank is not full."""
    for j in range(kernel.unknowns):
        work.point[j] = x[j]
    _first_derivatives(kernel, work, x, False)
    for i in range(kernel.equalities):
        for j in range(kernel.unknowns):
            work.reflectors[i, j] = work.jacobian[i, j]
    return triangularise(work.reflectors, work.triangle)


@implement(steps.reduced_gradient, DenseKernel)
def reduced_gradient(kernel, work, weights, multipliers, out):
    """Write the gradient of weights · F − multipliers · c along the null space; leave it, rotated, in the workspace."""
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
    """Write ν with ∂hᵀ ν = −(gradient across the null space)."""
    for i in range(kernel.equalities):
        work.multipliers[i] = -work.gradient[i]
    back_substitute(work.triangle, work.multipliers)


@implement(steps.residual_norm, DenseKernel)
def residual_norm(kernel, residual):
    """Return the Euclidean length."""
    return norm(residual)


@implement(steps.assemble, DenseKernel)
def assemble(kernel, work, stiffness, A, B, C):
    """Write the reduced Hessian of the Lagrangian and of the stiff constraints."""
    n, m, hessian = kernel.unknowns, kernel.equalities, work.hessian
    for i in range(n):
        for j in range(n):
            hessian[i, j] = 0.0
    for p in range(len(kernel.parts)):
        _run_part(kernel, work, work.point, p, SECOND, work.second[kernel.begin_second[p] : kernel.begin_second[p + 1]])
    for e in range(len(work.second)):
        i, j = kernel.second_row[e], kernel.second_column[e]
        hessian[max(i, j), min(i, j)] += work.second[e]
    largest = 0.0
    for i in range(n):
        largest = max(largest, abs(hessian[i, i]))
    _add_stiffness(kernel, work.first, stiffness, hessian)
    for i in range(n):
        for j in range(i):
            hessian[j, i] = hessian[i, j]
    rotate_matrix(work.reflectors, work.vector, hessian)
    for i in range(n - m):
        for j in range(i + 1):
            A[i, i - j] = hessian[m + i, m + j]
    return max(largest, 1e-3)


@compiled
def _add_stiffness(kernel, first, stiffness, hessian):
    """Add ∂cᵀ diag(stiffness) ∂c to the lower half."""
    for i in range(kernel.inequalities):
        for a in range(kernel.begin_row[i], kernel.begin_row[i + 1]):
            one = kernel.by_row[a]
            column, scaled = kernel.first_column[one], stiffness[i] * first[one]
            for b in range(kernel.begin_row[i], a + 1):
                other = kernel.by_row[b]
                hessian[column, kernel.first_column[other]] += scaled * first[other]


@implement(steps.expand_step, DenseKernel)
def expand_step(kernel, work, step, dx):
    """Write the change of x; return its largest entry."""
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


@implement(steps.retract, DenseKernel)
def retract(kernel, work, x, dx, length, trial):
    """Write the point of h = 0 that a step leads to, by Newton's method across the null space at x."""
    m, n = kernel.equalities, kernel.unknowns
    for j in range(n):
        trial[j] = x[j] + length * dx[j]
    if m == 0:
        return True
    for attempt in range(RETRACTIONS):
        _rows(kernel, work, trial, True)
        error = _equality_error(kernel, work)
        if error <= EQUALITY_TOLERANCE:
            return True
        if not error < FAR or attempt == RETRACTIONS - 1:
            return error <= 100 * EQUALITY_TOLERANCE
        _first_derivatives(kernel, work, trial, True)
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
