"""Peaks of a motion: epigraph variables σ on the border of Newton's matrix, compiled.

A peak is the least σ with σ − piece ≥ 0 for every piece at every sample. The rows σ − piece are limited rows as others
are; what is added here is how they change with σ, which stands in rows of a point below its samples.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled
from paretoik.trajectory.compiled import curve_states, self_motion_steps
from paretoik.trajectory.compiled.motion_arrays import sample_count


@compiled
def peak_rows(kernel, n):
    """Return the number of rows of n entries that peaks take in a point."""
    return (len(kernel.peak_inputs) + n - 1) // n


@compiled
def copy_peaks(kernel, work, x):
    """Write the σ of a point where the functions of a sample read them."""
    samples, n = sample_count(kernel), x.shape[1]
    for k in range(len(kernel.peak_inputs)):
        for s in range(len(kernel.ones)):
            work.inputs[kernel.peak_inputs[k], s] = x[samples + k // n, k % n]


@compiled
def lift_peaks(kernel, work, x):
    """Write the least σ that a motion allows into its point; the functions of a sample were evaluated at σ = 0."""
    samples, n = sample_count(kernel), x.shape[1]
    sums = len(work.objective_gradients)
    for k in range(len(kernel.peak_inputs)):
        largest = -np.inf
        for g in range(len(kernel.row_peaks)):
            if kernel.row_peaks[g] == k:
                for s in range(len(kernel.ones)):
                    largest = max(largest, -work.values[sums + g, s])
        x[samples + k // n, k % n] = largest


@compiled
def peak_gradient(kernel, work, weights, multipliers, out):
    """Write the gradient of weights · F − multipliers · c by σ; the signed multipliers of rows are in ``by_row``."""
    first, variables = kernel.unknowns, len(work.gradient_u)
    for total in range(len(weights)):
        if kernel.totals[total] < 0:
            out[first - 1 - kernel.totals[total]] += weights[total]
    if len(multipliers):
        for g in range(len(kernel.row_peaks)):
            if kernel.row_peaks[g] >= 0:
                for s in range(work.by_row.shape[1]):
                    out[first + kernel.row_peaks[g]] += work.by_row[variables + g, s]


@compiled
def assemble_peaks(kernel, work, A, B, C):
    """Write the rows of the border that belong to σ; the stiffness of rows is in ``by_row``."""
    variables, samples = work.gradient_u.shape
    sums, size = len(work.objective_gradients), A.shape[0]
    for k in range(len(kernel.peak_inputs)):
        total, row = 0.0, kernel.border + k
        for a in range(variables):
            for s in range(samples):
                work.gradient_u[a, s] = 0.0
        for g in range(len(kernel.row_peaks)):
            if kernel.row_peaks[g] == k:
                for s in range(samples):
                    total += work.by_row[variables + g, s]
                for a in range(variables):
                    for s in range(samples):
                        work.gradient_u[a, s] += work.by_row[variables + g, s] * work.gradients[sums + g, a, s]
        C[row, row] = total
        for s in range(work.gradient_q.shape[0]):
            for j in range(work.gradient_q.shape[1]):
                work.gradient_q[s, j] = 0.0
        curve_states.chain_gradient(work.curve, work.gradient_u, work.gradient_spline)
        self_motion_steps.add_transposed_stencil(
            work.gradient_spline, kernel.ones, kernel.neighbours, kernel.coefficients, work.gradient_q
        )
        self_motion_steps.project_gradient(work.gradient_q, work.tangent, kernel.first_unknown, work.projected)
        for i in range(size):
            B[row, i] = work.projected[i]
        for i in range(kernel.border):
            C[row, i] = C[i, row] = work.projected[size + i]


@compiled
def step_peaks(kernel, step, dx):
    """Write how σ changes with a step of the unknowns."""
    samples, n = sample_count(kernel), dx.shape[1]
    for k in range(len(kernel.peak_inputs)):
        dx[samples + k // n, k % n] = step[kernel.unknowns + k]
