"""The kernel with a dense Newton matrix, for small programs.

It evaluates the rows of a ``dense_program``, in parts. Each part is a few functions of a few unknowns, evaluated at
several places (the lanes of ``AssembledRows``). Objectives are linear: F(x) = objectives · x. Derivatives are lists of
entries, one per place.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.evaluator import BLOCK_SIZE
from paretoik.autodiff.interpreter import run
from paretoik.compilation.numba_cache import compiled
from paretoik.errors import EvaluationFailed
from paretoik.nlp.banded import kernel as steps
from paretoik.nlp.banded.kernel import implement
from paretoik.nlp.dense.traced_rows import AssembledRows, Part
from paretoik.nlp.linear_algebra import (
    back_substitute,
    eliminate,
    norm,
    rotate,
    rotate_back,
    rotate_matrix,
    triangularise,
)

VALUE, FIRST, SECOND = 0, 1, 2


class DenseKernel(NamedTuple):
    """A program of parts; its rows are h, then c.

    programs: (parts, 3, 10) for values, first and second derivatives: begin and end of code, constants, inputs and
        outputs, then numbers of registers and outputs
    parts: (parts, 8) numbers of places, unknowns, parameters and rows, whether there are equalities, and first indices
        in ``where``, ``parameters`` and ``row``
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
    where: np.ndarray  # (unknowns, places) of each part: indices of its unknowns
    parameters: np.ndarray  # (parameters, places) of each part
    row: np.ndarray  # (rows, places) of each part: row of the program
    begin_first: np.ndarray  # (parts + 1,): index of each part's first entry
    first_row: np.ndarray
    first_column: np.ndarray
    begin_second: np.ndarray
    second_row: np.ndarray
    second_column: np.ndarray
    by_row: np.ndarray  # the entries of first derivatives of c, sorted by row
    begin_row: np.ndarray  # (inequalities + 1,)
    equality_tolerance: float = 1e-12  # tolerance of h(x) = 0
    retractions: int = 10  # largest number of Newton steps
    far: float = 1e3  # largest violation of h from which a retraction starts
    restorations: int = 400  # largest number of Levenberg–Marquardt steps
    longest_step: float = np.inf
    penalty: float = 100.0
    implied_slacks: bool = False
    large_multiplier: float = 100.0


class DenseWorkspace(NamedTuple):
    """Arrays that the steps write."""

    inputs: np.ndarray  # inputs of a part's program
    space: np.ndarray  # registers of a part's program
    outputs: np.ndarray  # rows of a part
    first: np.ndarray
    second: np.ndarray
    values: np.ndarray  # (rows,)
    multipliers: np.ndarray  # (rows,): multipliers of h, then those of c with negative sign
    reflectors: np.ndarray  # (equalities, unknowns)
    triangle: np.ndarray  # (equalities, equalities): R of ∂hᵀ = Y R
    jacobian: np.ndarray  # (equalities, unknowns)
    matrix: np.ndarray  # (equalities, equalities)
    gradient: np.ndarray  # (unknowns,), rotated by the reflections
    vector: np.ndarray  # (unknowns,)
    point: np.ndarray  # (unknowns,): point at which derivatives are taken
    right: np.ndarray  # (equalities,)
    hessian: np.ndarray  # (unknowns, unknowns)


@compiled
def run_part(kernel, work, x, p, which, out):
    """Write part p's values or derivatives at x into ``out``; ``which``: VALUE, FIRST or SECOND.

    The program of second derivatives also reads the multipliers.
    """
    places, unknowns, parameters, rows = kernel.parts[p, 0], kernel.parts[p, 1], kernel.parts[p, 2], kernel.parts[p, 3]
    where, parameter, first = kernel.parts[p, 5], kernel.parts[p, 6], kernel.parts[p, 7]
    inputs = work.inputs[: (unknowns + parameters + rows) * places]
    for i in range(unknowns * places):
        inputs[i] = x[kernel.where[where + i]]
    begin = unknowns * places
    for i in range(parameters * places):
        inputs[begin + i] = kernel.parameters[parameter + i]
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
def evaluate_rows(kernel, work, x, equalities_only):
    """Write the values of h and c, or only of h."""
    for p in range(len(kernel.parts)):
        if equalities_only and not kernel.parts[p, 4]:
            continue
        begin, count = kernel.parts[p, 7], kernel.parts[p, 3] * kernel.parts[p, 0]
        run_part(kernel, work, x, p, VALUE, work.outputs[begin : begin + count])
        for i in range(begin, begin + count):
            work.values[kernel.row[i]] = work.outputs[i]


@compiled
def equality_error(kernel, work):
    """Return the largest |h|, inf if one is not finite."""
    worst = 0.0
    for i in range(kernel.equalities):
        if not np.isfinite(work.values[i]):
            return np.inf
        worst = max(worst, abs(work.values[i]))
    return worst


@compiled
def first_derivatives(kernel, work, x, equalities_only):
    """Write the entries of ∂h and ∂c, and ∂h as a matrix, from all parts or only those with equalities."""
    for p in range(len(kernel.parts)):
        if not equalities_only or kernel.parts[p, 4]:
            run_part(kernel, work, x, p, FIRST, work.first[kernel.begin_first[p] : kernel.begin_first[p + 1]])
    for i in range(kernel.equalities):
        for j in range(kernel.unknowns):
            work.jacobian[i, j] = 0.0
    for p in range(len(kernel.parts)):
        if kernel.parts[p, 4]:
            for e in range(kernel.begin_first[p], kernel.begin_first[p + 1]):
                if kernel.first_row[e] < kernel.equalities:
                    work.jacobian[kernel.first_row[e], kernel.first_column[e]] += work.first[e]


# Levenberg–Marquardt method for the equalities of small programs, compiled.
#
#     minimise    ‖h + ∂h d‖² + λ ‖d‖²,  solved by d = −∂hᵀ (∂h ∂hᵀ + λ I)⁻¹ h


@compiled
def _damped_step(kernel, work, damping):
    """Write ∂hᵀ (∂h ∂hᵀ + damping · mean diagonal · I)⁻¹ h; return False if singular."""
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


# The steps of the interior-point method (``banded.kernel``).


@implement(steps.dimensions, DenseKernel)
def _dimensions(kernel, x):
    size = kernel.unknowns - kernel.equalities
    return size, size, 0, kernel.inequalities


@implement(steps.objective_scale, DenseKernel)
def _objective_scale(kernel, weights):
    """Return the length of the gradient of weights · F, or 1 if it is 0."""
    total = 0.0
    for j in range(kernel.unknowns):
        slope = 0.0
        for k in range(len(weights)):
            slope += weights[k] * kernel.objectives[k, j]
        total += slope * slope
    return np.sqrt(total) if total > 0.0 else 1.0


@implement(steps.allocate_workspace, DenseKernel)
def _allocate_workspace(kernel, x):
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
def _add_auxiliary(kernel, work, x):
    return x.copy()


@implement(steps.remove_auxiliary, DenseKernel)
def _remove_auxiliary(kernel, x):
    return x


@implement(steps.set_smoothing, DenseKernel)
def _set_smoothing(kernel, work, mu):
    return False


@implement(steps.restore, DenseKernel)
def _restore(kernel, work, x):
    """Move x onto h(x) = 0 by Levenberg–Marquardt steps. Source: Nocedal & Wright, section 10.3."""
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


@implement(steps.evaluate, DenseKernel)
def _evaluate(kernel, work, x, F, c):
    for k in range(len(F)):
        F[k] = 0.0
        for j in range(kernel.unknowns):
            F[k] += kernel.objectives[k, j] * x[j]
    evaluate_rows(kernel, work, x, False)
    for i in range(kernel.inequalities):
        c[i] = work.values[kernel.equalities + i]


@implement(steps.linearise, DenseKernel)
def _linearise(kernel, work, x):
    """Write first derivatives and reflectors of ∂hᵀ; return False if its rank is deficient."""
    for j in range(kernel.unknowns):
        work.point[j] = x[j]
    first_derivatives(kernel, work, x, False)
    for i in range(kernel.equalities):
        for j in range(kernel.unknowns):
            work.reflectors[i, j] = work.jacobian[i, j]
    return triangularise(work.reflectors, work.triangle)


@implement(steps.reduced_gradient, DenseKernel)
def _reduced_gradient(kernel, work, weights, multipliers, out):
    """Write ∇(weights · F − multipliers · c) along the null space.

    The workspace gets the whole gradient, rotated.
    """
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
def _prepare_multipliers(kernel, work, weights):
    """Write the multipliers ν of h.

    They satisfy ∂hᵀ ν = −(gradient in the row space of ∂h).
    """
    for i in range(kernel.equalities):
        work.multipliers[i] = -work.gradient[i]
    back_substitute(work.triangle, work.multipliers)


@implement(steps.residual_norm, DenseKernel)
def _residual_norm(kernel, residual):
    return norm(residual)


@implement(steps.assemble, DenseKernel)
def _assemble(kernel, work, stiffness, A, B, C):
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
def _expand_step(kernel, work, step, dx):
    m, largest = kernel.equalities, 0.0
    for j in range(kernel.unknowns):
        dx[j] = step[j - m] if j >= m else 0.0
    rotate_back(work.reflectors, dx)
    for j in range(kernel.unknowns):
        largest = max(largest, abs(dx[j]))
    return largest


@implement(steps.directional_derivatives, DenseKernel)
def _directional_derivatives(kernel, work, dx, dF, dc):
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
def _row_width(kernel, work):
    return kernel.unknowns - kernel.equalities


@implement(steps.constraint_rows, DenseKernel)
def _constraint_rows(kernel, work, columns, entries):
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
def _retract(kernel, work, x, dx, length, trial):
    """Write the point on h = 0 after a step.

    Newton steps are in the row space of ∂h at x.
    """
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


# Small dense programs as arrays, for compiled solvers.


def dense_kernel(program: AssembledRows, costs: Float[np.ndarray, "objectives unknowns"]) -> DenseKernel:
    """Return rows and linear objectives for compiled code.

    Raises EvaluationFailed if there are too few unknowns.
    """
    kernel = _kernel(program)
    if kernel.equalities > kernel.unknowns:
        raise EvaluationFailed(f"program must have at least {kernel.equalities} unknowns, got {kernel.unknowns}")
    return kernel._replace(objectives=np.ascontiguousarray(costs, dtype=float))


@lru_cache(maxsize=64)
def _kernel(whole: AssembledRows) -> DenseKernel:
    """Return the kernel without objectives."""
    parts, equalities = whole.parts, whole.equalities
    tables, first, second = [], [], []
    begin = np.zeros(3, dtype=np.int64)
    for part, row in zip(parts, whole.places, strict=True):
        program, where = part.program, part.where.T
        counts = [where.shape[1], len(where), part.parameters.shape[1], len(row)]
        tables.append([*counts, program.equalities > 0, *begin])
        begin += where.size, part.parameters.size, row.size
        (i, j), (a, b) = program.jacobian_pattern, program.hessian_pattern
        first.append((row[i].ravel(), where[j].ravel()))
        second.append((where[a].ravel(), where[b].ravel()))
    first_row, first_column = np.concatenate(first, axis=1).astype(np.int64)
    second_row, second_column = np.concatenate(second, axis=1).astype(np.int64)
    order = np.lexsort((first_column, first_row))
    by_row = order[first_row[order] >= equalities]
    return DenseKernel(
        unknowns=whole.unknowns,
        equalities=equalities,
        inequalities=whole.inequalities,
        objectives=np.zeros((0, whole.unknowns)),
        **_concatenate_evaluators(parts),
        parts=np.array(tables, dtype=np.int64),
        where=np.concatenate([part.where.T.ravel() for part in parts]).astype(np.int64),
        parameters=np.concatenate([part.parameters.T.ravel() for part in parts]),
        row=np.concatenate([row.ravel() for row in whole.places]).astype(np.int64),
        begin_first=np.cumsum([0, *(len(pair[0]) for pair in first)]),
        first_row=first_row,
        first_column=first_column,
        begin_second=np.cumsum([0, *(len(pair[0]) for pair in second)]),
        second_row=second_row,
        second_column=second_column,
        by_row=by_row,
        begin_row=np.searchsorted(first_row[by_row], equalities + np.arange(whole.inequalities + 1)),
    )


def _concatenate_evaluators(parts: Sequence[Part]) -> dict[str, Any]:
    """Return the joined arrays of all evaluators, and a table with the beginning and end of each."""
    names = ("code", "constants", "inputs", "outputs")
    orders = [(part.program.values, part.program.jacobian_entries, part.program.hessian_entries) for part in parts]
    flat = [evaluator for each in orders for evaluator in each]
    sizes = np.array([[len(getattr(each, name)) for name in names] for each in flat])
    ends = np.cumsum(sizes, axis=0)
    table = np.concatenate(
        [np.stack([ends - sizes, ends], axis=2).reshape(len(flat), -1), [[e.registers, len(e.outputs)] for e in flat]],
        axis=1,
    )
    joined = {name: np.concatenate([getattr(each, name) for each in flat]) for name in names}
    return joined | {"programs": table.reshape(len(parts), 3, -1).astype(np.int64)}
