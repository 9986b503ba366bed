"""Small programs as arrays for compiled code, and the evaluation of their rows.

A program consists of parts. Each part is a few functions of a few unknowns, the same at several places
(``AssembledRows``). Objectives are linear: F(x) = objectives · x. Derivatives are lists of entries, one per place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.evaluator import BLOCK_SIZE
from paretoik.autodiff.interpreter import run
from paretoik.compilation.numba_cache import compiled

VALUE, FIRST, SECOND = 0, 1, 2


class DenseKernel(NamedTuple):
    """A program of parts; its rows are h, then c.

    programs: (parts, 3, 10) for values, first and second derivatives: beginnings and ends of code, constants, inputs
        and outputs, then numbers of registers and outputs
    parts: (parts, 8) places, unknowns, parameters, rows, whether it has equalities, and where its ``where``,
        ``parameters`` and rows begin
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
    equality_tolerance: float = 1e-12  # of h(x) = 0
    retractions: int = 10  # Newton steps at most
    far: float = 1e3  # violation of h that no retraction starts from
    restorations: int = 400  # Levenberg–Marquardt steps at most
    longest_step: float = np.inf
    penalty: float = 100.0
    implied_slacks: bool = False
    large_multiplier: float = 100.0


class DenseWorkspace(NamedTuple):
    """Arrays that the steps write."""

    inputs: np.ndarray  # inputs of a part's program
    space: np.ndarray  # its registers
    outputs: np.ndarray  # rows, as parts give them
    first: np.ndarray
    second: np.ndarray
    values: np.ndarray  # (rows,)
    multipliers: np.ndarray  # (rows,) of h, then negative ones of c
    reflectors: np.ndarray  # (equalities, unknowns)
    triangle: np.ndarray  # (equalities, equalities): R of ∂hᵀ = Y R
    jacobian: np.ndarray  # (equalities, unknowns)
    matrix: np.ndarray  # (equalities, equalities)
    gradient: np.ndarray  # (unknowns,), rotated by the reflections
    vector: np.ndarray  # (unknowns,)
    point: np.ndarray  # (unknowns,) where derivatives are taken
    right: np.ndarray  # (equalities,)
    hessian: np.ndarray  # (unknowns, unknowns)


@compiled
def run_part(kernel, work, x, p, which, out):
    """Run one program of a part at x; second derivatives also read the multipliers."""
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
    """Write the entries of ∂h and ∂c (or only of parts with equalities) and ∂h as a matrix."""
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
#     minimise    ‖h + ∂h d‖² + λ ‖d‖²,  so that d = −∂hᵀ (∂h ∂hᵀ + λ I)⁻¹ h


@compiled
def restore_equalities(kernel, work, x):
    """Move x onto h(x) = 0 (Nocedal & Wright, section 10.3); return the largest |h| left, 0 on success."""
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
    """Write ∂hᵀ (∂h ∂hᵀ + damping · I)⁻¹ h, damping relative to the mean diagonal; False if singular."""
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
