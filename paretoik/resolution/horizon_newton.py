"""Compiled Newton's method in the null space of the program of a few samples ahead."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.linear_algebra import cholesky, solve_cholesky, weighted_square


class NewtonOptions(NamedTuple):
    """Settings of the iterations."""

    iterations: int = 60
    corrections: int = 12  # largest number of Newton's iterations back onto the path
    stationarity: float = 1e-9  # reduced gradient, as a share of the gradient's largest entry
    stalled_stationarity: float = 1e-6  # the same share, accepted if rounding hides any descent
    feasibility: float = 1e-12  # m or rad: error of the path's equations
    stalled_feasibility: float = 1e-10  # m or rad: the same error, accepted if rounding hides any progress
    largest_move: float = 0.5  # rad or m: largest move of one joint in one step
    shortest_step: float = 1e-7  # share of a step
    sufficient_decrease: float = 1e-4  # share of the predicted decrease (Armijo; Nocedal & Wright, Eq. 3.4)
    regularisation: float = 1e-3  # first addition to an indefinite Hessian, share of its largest diagonal entry


OPTIONS = NewtonOptions()


@compiled(what="the predictive control step", seconds=4)
def minimise(derivatives, hessian, row, column, inputs, horizon, dof, rows):
    """Overwrite positions with a local minimum; return (objective, converged, iterations).

    inputs: positions, fixed numbers, then multipliers (inputs, 1)
    derivatives: evaluator of the objective, its gradient, equations and their Jacobian
    hessian: evaluator of the Hessian's entries at ``row`` and ``column``

    Every step minimises the quadratic model in the null space of the Jacobian and is retracted onto the path; an
    indefinite reduced Hessian is regularised. Source: Nocedal & Wright, Numerical Optimization, algorithm 3.3 and
    section 16.2; Gabay 1982.
    """
    size, count, free, shape = horizon * dof, horizon * rows, horizon * (dof - rows), (horizon, dof, rows)
    first_multiplier = inputs.shape[0] - dof - count
    outputs = np.empty((1 + size + count + count * dof, 1))
    flat, variables = outputs.reshape(outputs.shape[0]), inputs.reshape(inputs.shape[0])
    entries, H = np.empty((row.shape[0], 1)), np.zeros((size, size))
    basis, step = np.zeros((size, free)), np.empty(size)
    reduced, factor = np.empty((free, free)), np.empty((free, free))
    direction, slope = np.empty(free), np.empty(free)
    factors, work = np.empty((horizon, rows, rows)), np.empty(rows)
    if not _retract(derivatives, inputs, outputs, factors, work, shape):
        return outputs[0, 0], False, 0
    for iteration in range(OPTIONS.iterations):
        value, largest = outputs[0, 0], 0.0
        gradient = flat[1 : 1 + size]
        J = flat[1 + size + count :].reshape((horizon, rows, dof))
        # the multipliers ν that minimise ‖∇f + Jᵀν‖ (Nocedal & Wright, Eq. 18.21)
        for k in range(horizon):
            for i in range(rows):
                total = 0.0
                for j in range(dof):
                    total -= J[k, i, j] * gradient[k * dof + j]
                work[i] = total
            solve_cholesky(factors[k], work)
            for i in range(rows):
                variables[first_multiplier + k * rows + i] = work[i]
        for k in range(horizon):
            block = basis[k * dof : (k + 1) * dof, k * (dof - rows) : (k + 1) * (dof - rows)]
            _null_basis(J[k], factors[k], work, block)
        for j in range(size):
            largest = max(largest, abs(gradient[j]))
        residual = 0.0
        for a in range(basis.shape[1]):
            slope[a] = 0.0
            for j in range(basis.shape[0]):
                slope[a] += basis[j, a] * gradient[j]
            residual = max(residual, abs(slope[a]))
        if residual <= OPTIONS.stationarity * largest:
            return value, True, iteration
        run(hessian, inputs, entries)
        for e in range(row.shape[0]):
            H[row[e], column[e]] = H[column[e], row[e]] = entries[e, 0]
        _reduce_hessian(H, basis, reduced)
        if not _factorise_regularised(reduced, factor):
            return value, False, iteration
        direction[:] = slope
        solve_cholesky(factor, direction)
        decrease = 0.0
        for a in range(free):
            decrease += slope[a] * direction[a]
        for j in range(size):
            step[j] = 0.0
            for a in range(free):
                step[j] -= basis[j, a] * direction[a]
        if not _line_search(derivatives, inputs, outputs, step, value, decrease, factors, work, shape):
            # rounding hides any further descent
            return value, residual <= OPTIONS.stalled_stationarity * largest, iteration
    return outputs[0, 0], False, OPTIONS.iterations


@compiled
def _line_search(derivatives, inputs, outputs, step, value, decrease, factors, work, shape):
    """Take the longest of shrinking steps with sufficient decrease; return False and do not move if none has."""
    size = step.shape[0]
    start, largest = np.empty(size), 0.0
    for j in range(size):
        start[j] = inputs[j, 0]
        largest = max(largest, abs(step[j]))
    length = min(1.0, OPTIONS.largest_move / largest)
    while True:
        for j in range(size):
            inputs[j, 0] = start[j] + length * step[j]
        feasible = _retract(derivatives, inputs, outputs, factors, work, shape)
        upper = value - OPTIONS.sufficient_decrease * length * decrease + 1e-14 * abs(value)
        if feasible and outputs[0, 0] <= upper:
            return True
        length *= 0.5
        if length < OPTIONS.shortest_step:
            break
    for j in range(size):
        inputs[j, 0] = start[j]
    return False


@compiled
def _retract(derivatives, inputs, outputs, factors, work, shape):
    """Retract positions onto the path by Newton's method with shortest steps; return whether it converges.

    The ``outputs`` are those of the program there, the ``factors`` the Cholesky factors of every sample's J Jᵀ.
    """
    horizon, dof, rows = shape
    size, count = horizon * dof, horizon * rows
    square, previous, flat = np.empty((rows, rows)), np.inf, outputs.reshape(outputs.shape[0])
    unweighted = np.ones(dof)
    for correction in range(OPTIONS.corrections):
        run(derivatives, inputs, outputs)
        equations, J = flat[1 + size : 1 + size + count], flat[1 + size + count :].reshape((horizon, rows, dof))
        residual = 0.0
        for i in range(count):
            residual = max(residual, abs(equations[i]))
        for k in range(horizon):
            weighted_square(J[k], unweighted, square)
            if not cholesky(square, factors[k]):
                return False
        if residual <= OPTIONS.feasibility:
            return True
        if residual <= OPTIONS.stalled_feasibility and residual >= 0.5 * previous:
            return True
        if not residual < np.inf or (correction > 3 and residual > previous):
            return False
        previous = residual
        for k in range(horizon):
            for i in range(rows):
                work[i] = equations[k * rows + i]
            solve_cholesky(factors[k], work)
            for j in range(dof):
                move = 0.0
                for i in range(rows):
                    move -= J[k, i, j] * work[i]
                inputs[k * dof + j, 0] += min(max(move, -OPTIONS.largest_move), OPTIONS.largest_move)
    return False


@compiled
def _null_basis(J, factor, work, basis):
    """Write an orthonormal basis (dof, dof − rows) of the null space from unit vectors, the longest first."""
    rows, dof = J.shape
    projected = np.eye(dof)
    for j in range(dof):
        for i in range(rows):
            work[i] = J[i, j]
        solve_cholesky(factor, work)
        for k in range(dof):
            for i in range(rows):
                projected[k, j] -= J[i, k] * work[i]
    for a in range(basis.shape[1]):
        longest, largest = 0, -1.0
        for j in range(dof):
            square = 0.0
            for k in range(dof):
                square += projected[k, j] ** 2
            if square > largest:
                longest, largest = j, square
        for k in range(dof):
            basis[k, a] = projected[k, longest] / np.sqrt(largest)
        for j in range(dof):
            product = 0.0
            for k in range(dof):
                product += basis[k, a] * projected[k, j]
            for k in range(dof):
                projected[k, j] -= product * basis[k, a]


@compiled
def _reduce_hessian(H, basis, reduced):
    size, free = basis.shape
    for a in range(free):
        for b in range(a + 1):
            total = 0.0
            for j in range(size):
                if basis[j, a] != 0.0:
                    for k in range(size):
                        total += basis[j, a] * H[j, k] * basis[k, b]
            reduced[a, b] = reduced[b, a] = total


@compiled
def _factorise_regularised(matrix, factor):
    """Factorise a matrix with a larger diagonal (ibid., algorithm 3.3); return whether it succeeds."""
    size = matrix.shape[0]
    largest = 0.0
    for a in range(size):
        largest = max(largest, abs(matrix[a, a]))
    added = 0.0
    for _ in range(60):
        if cholesky(matrix, factor):
            return True
        shift = max(2.0 * added, OPTIONS.regularisation * largest)
        for a in range(size):
            matrix[a, a] += shift - added
        added = shift
    return False
