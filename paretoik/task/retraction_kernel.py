"""Compiled Newton's method onto the path, and the rates of its result."""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run, run_block
from paretoik.compilation.numba_cache import compiled


@compiled(what="the retraction onto paths", seconds=2)
def newton(arrays, targets, directions, scales, settings, q, errors, same_sheet):
    """Move each posture q (samples, dof) onto the path along its ``directions``.

    arrays: arrays of the evaluator of errors and Jacobian entries at (q, targets)
    directions: directions (samples, dof, rows) of each posture
    scales: units (rows,) of errors
    settings: tolerance, max_step and max_iterations

    Writes q, the largest error at the last evaluation, and whether the determinant of the Newton matrix was positive
    there; if so, the posture is on the sheet of its start. Samples share the lanes of the evaluator's workspace; the
    lane of a finished sample is used for the next sample.
    """
    code, constants, inputs, outputs, workspace = arrays
    samples, n, rows = directions.shape
    tolerance, max_step, max_iterations = settings
    width, loaded = workspace.shape[1], inputs.shape[0]
    for j in range(constants.shape[0]):
        for lane in range(width):
            workspace[loaded + j, lane] = constants[j]
    sample_of, iterations = np.empty(width, dtype=np.int64), np.empty(width, dtype=np.int64)
    matrix, step = np.empty((rows, rows)), np.empty(rows)
    next_sample = active = 0
    while True:
        while active < width and next_sample < samples:
            sample_of[active], iterations[active] = next_sample, 0
            next_sample += 1
            active += 1
        if active == 0:
            break
        for j in range(loaded):
            for lane in range(active):
                column = inputs[j]
                s = sample_of[lane]
                workspace[j, lane] = q[s, column] if column < n else targets[s, column - n]
        run_block(code, workspace, active)
        unfinished = 0
        for lane in range(active):
            s = sample_of[lane]
            # the matrix J · directions, the errors, and the largest of them divided by scales; NaN if one is NaN
            size = 0.0
            for i in range(rows):
                step[i] = workspace[outputs[i], lane]
                size = max(size, abs(step[i]) / scales[i]) if step[i] == step[i] else np.nan
                for k in range(rows):
                    total = 0.0
                    for j in range(n):
                        total += workspace[outputs[rows + i * n + j], lane] * directions[s, j, k]
                    matrix[i, k] = total
            same_sheet[s] = solve(matrix, step) > 0
            errors[s] = size
            iterations[lane] += 1
            if not size > tolerance:
                continue
            # a step along the directions, each entry at most max_step; NaN counts as 0
            for k in range(rows):
                length = min(max(step[k], -max_step), max_step) if step[k] == step[k] else 0.0
                for j in range(n):
                    q[s, j] += directions[s, j, k] * length
            if iterations[lane] < max_iterations:
                sample_of[unfinished], iterations[unfinished] = s, iterations[lane]
                unfinished += 1
        active = unfinished


@compiled
def write_directions(normals, spline, scales, directions):
    """Write the directions D = W² Jᵀ and their two derivatives.

    The output ``directions`` is (3, points, dof, rows).

    normals: evaluator of J, J̇ and J̈ at ``spline`` (3, points, dof)
    scales: joint scales W
    """
    _, points, n, rows = directions.shape
    places, values = np.empty((3 * n, points)), np.empty((3 * rows * n, points))
    for o in range(3):
        for p in range(points):
            for j in range(n):
                places[o * n + j, p] = spline[o, p, j]
    run(normals, places, values)
    for o in range(3):
        for p in range(points):
            for j in range(n):
                for i in range(rows):
                    directions[o, p, j, i] = values[(o * rows + i) * n + j, p] * scales[j] ** 2


@compiled
def project_rates(rates, inputs, scales, spline, directions, state, multipliers):
    """Write velocities and accelerations of a spline's projection q = s + D λ.

    The positions are already in ``state``[0].

    rates: evaluator of ∂g/∂q, ġ and g̈ at ``inputs``, the state, then targets with two derivatives
    spline, state: positions, velocities and accelerations (3, points, dof)
    directions: D, Ḋ and D̈
    multipliers: output λ, λ̇ and λ̈ (3, points, rows)

    Errors become inf or NaN.
    """
    _, points, n, rows = directions.shape
    matrix, right, values = np.empty((rows, rows)), np.empty(rows), np.empty((rows * (n + 2), points))
    for p in range(points):
        for i in range(rows):
            right[i] = 0.0
            for j in range(n):
                right[i] += directions[0, p, j, i] * (state[0, p, j] - spline[0, p, j]) / scales[j] ** 2
            for k in range(rows):
                matrix[i, k] = 0.0
                for j in range(n):
                    matrix[i, k] += directions[0, p, j, i] * directions[0, p, j, k] / scales[j] ** 2
        solve(matrix, right)
        multipliers[0, p] = right
        for j in range(n):
            inputs[j, p] = state[0, p, j]
    for order in range(1, 3):
        for p in range(points):
            for j in range(n):
                rate = spline[order, p, j]
                for k in range(rows):  # first ṡ + Ḋ λ, then add D λ̇; first s̈ + D̈ λ + 2 Ḋ λ̇, then add D λ̈
                    rate += directions[order, p, j, k] * multipliers[0, p, k]
                    if order == 2:
                        rate += 2 * directions[1, p, j, k] * multipliers[1, p, k]
                state[order, p, j] = inputs[order * n + j, p] = rate
        run(rates, inputs, values)
        for p in range(points):
            for i in range(rows):
                right[i] = -values[rows * (n + order - 1) + i, p]
                for k in range(rows):
                    matrix[i, k] = 0.0
                    for j in range(n):
                        matrix[i, k] += values[i * n + j, p] * directions[0, p, j, k]
            solve(matrix, right)
            multipliers[order, p] = right
            for j in range(n):
                for k in range(rows):
                    state[order, p, j] += directions[0, p, j, k] * right[k]
                inputs[order * n + j, p] = state[order, p, j]


@compiled
def solve_small_systems(matrices, right, determinants):
    """Overwrite ``right`` (count, size) with solutions; write the determinants.

    The matrices (count, size, size) are overwritten too.
    """
    for i in range(len(matrices)):
        determinants[i] = solve(matrices[i], right[i])


@compiled
def solve(matrix, right):
    """Overwrite ``right`` with matrix⁻¹ right; return the determinant.

    Gaussian elimination without pivoting: directions are ordered so that the matrix is at first lower triangular with a
    positive diagonal. A pivot of 0 gives inf or NaN.
    """
    size, determinant = len(right), 1.0
    for i in range(size):
        determinant *= matrix[i, i]
        for k in range(i + 1, size):
            factor = matrix[k, i] / matrix[i, i]
            for c in range(i + 1, size):
                matrix[k, c] -= factor * matrix[i, c]
            right[k] -= factor * right[i]
    for i in range(size - 1, -1, -1):
        for c in range(i + 1, size):
            right[i] -= matrix[i, c] * right[c]
        right[i] /= matrix[i, i]
    return determinant
