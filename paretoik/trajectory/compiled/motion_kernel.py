"""Motions as compiled code takes them: the kernel whose Newton matrix is banded in time.

Unknowns are steps in the self-motion of every sample: q moves along the null space of the tasks' Jacobian and is then
retracted onto the path, so that every iterate follows it. What is left is a program in (dof − task rows) numbers a
sample whose exact second derivatives, the path's curvature included, are banded in time; a cycle closes in the border.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation import compiled
from paretoik.nlp.compiled import kernel_steps as steps
from paretoik.nlp.compiled.array_loops import add_scaled, clear, inner_product, norm
from paretoik.nlp.compiled.kernel_steps import implement
from paretoik.trajectory.compiled import self_motion_steps


class MotionKernel(NamedTuple):
    """A MotionProgram of smooth sums, as arrays; see there, and ``self_motion_steps`` for the stencil."""

    value: tuple[np.ndarray, ...]
    slope: tuple[np.ndarray, ...]
    slope_of: np.ndarray
    slope_by: np.ndarray
    curvature: tuple[np.ndarray, ...]
    second_i: np.ndarray
    second_j: np.ndarray
    track: tuple[np.ndarray, ...]
    neighbours: np.ndarray
    coefficients: np.ndarray
    first_unknown: np.ndarray
    unknowns: int
    border: int  # so many unknowns, the last, belong to the border
    stride: int  # instants from one sample to the next: functions are evaluated at all instants
    stops: bool  # the last sample is the nearest to the one before
    ones: np.ndarray
    quadrature: np.ndarray
    inputs: np.ndarray
    multipliers: np.ndarray
    limited: np.ndarray  # (limits, 2): variable or row, and sample
    sides: np.ndarray  # (limits,): 1 a lower limit, −1 an upper
    bounds: np.ndarray  # (limits,)
    longest_step: float = 0.4  # [rad or m] of any joint: too little to reach another branch of the self-motion unseen
    penalty: float = 1.0
    implied_slacks: bool = True
    large_multiplier: float = np.inf


class Workspace(NamedTuple):
    """What the steps write: U variables of an instant, K sums, G limited rows, r unknowns a sample.

    Path equations are evaluated at the samples, everything else at the instants.
    """

    inputs: np.ndarray
    path_inputs: np.ndarray
    tracked: np.ndarray  # path equations and their Jacobian
    tangent: np.ndarray  # (time, dof, r)
    normal: np.ndarray  # (time, dof, rows)
    triangle: np.ndarray  # (time, rows, rows)
    values: np.ndarray  # (K + G, instants)
    slopes: np.ndarray
    seconds: np.ndarray
    gradients: np.ndarray  # (K + G, U, instants) of sums and rows by u
    objective_gradients: np.ndarray  # (K, time, dof) of sums by q
    by_row: np.ndarray  # (U + G, instants): a number a variable and a limited row
    gradient_u: np.ndarray  # (U, instants)
    gradient_q: np.ndarray  # (time, dof)
    du: np.ndarray  # (U, instants)


@implement(steps.dimensions, MotionKernel)
def dimensions(kernel, x):
    """Return (size, band, border) of the Newton matrix and the number of limits."""
    rows = kernel.multipliers[1] - kernel.multipliers[0]
    band = kernel.coefficients.shape[2] * (x.shape[1] - rows)
    return kernel.unknowns - kernel.border, band, kernel.border, len(kernel.sides)


@implement(steps.objective_scale, MotionKernel)
def objective_scale(kernel, weights):
    """Return 1: sums are divided by their scales."""
    return 1.0


@implement(steps.allocate_workspace, MotionKernel)
def allocate_workspace(kernel, x):
    """Return the workspace for motions of x's shape."""
    samples, n = x.shape
    instants = len(kernel.ones)
    variables = kernel.coefficients.shape[0] * n
    rows = kernel.multipliers[1] - kernel.multipliers[0]
    sums = kernel.multipliers[2] - kernel.multipliers[1]
    limited = len(kernel.inputs) - kernel.multipliers[2]
    return Workspace(
        kernel.inputs.copy(),
        kernel.inputs[:, :: kernel.stride].copy(),
        np.empty((rows + rows * n, samples)),
        np.zeros((samples, n, n - rows)),
        np.zeros((samples, n, rows)),
        np.zeros((samples, rows, rows)),
        np.empty((sums + limited, instants)),
        np.empty((sums + limited + len(kernel.slope_of), instants)),
        np.empty((len(kernel.second_i), instants)),
        np.zeros((sums + limited, variables, instants)),
        np.zeros((sums, samples, n)),
        np.zeros((variables + limited, instants)),
        np.zeros((variables, instants)),
        np.zeros((samples, n)),
        np.zeros((variables, instants)),
    )


@implement(steps.restore, MotionKernel)
def restore(kernel, work, x):
    """Return 0: a motion is on the path from the start."""
    return 0.0


@implement(steps.evaluate, MotionKernel)
def evaluate(kernel, work, x, F, c):
    """Write the sums and the distances from limits of the motion x."""
    sums, variables = len(F), len(work.gradient_u)
    inputs, values, quadrature = work.inputs, work.values, kernel.quadrature
    limited, sides, bounds = kernel.limited, kernel.sides, kernel.bounds
    self_motion_steps.apply_stencil(x, kernel.neighbours, kernel.coefficients, work.inputs)
    run(kernel.value, work.inputs, work.values)
    for k in range(sums):
        F[k] = 0.0
        for s in range(len(quadrature)):
            F[k] += quadrature[s] * values[k, s]
    for i in range(len(sides)):
        row, s = limited[i, 0], limited[i, 1]
        value = inputs[row, s] if row < variables else values[sums + row - variables, s]
        c[i] = sides[i] * (value - bounds[i])


@implement(steps.linearise, MotionKernel)
def linearise(kernel, work, x):
    """Prepare the tangent of the path and the gradients at x; return False at a singularity."""
    inputs, slopes, gradients = work.path_inputs, work.slopes, work.gradients
    slope_of, slope_by = kernel.slope_of, kernel.slope_by
    for j in range(x.shape[1]):
        for s in range(x.shape[0]):
            inputs[j, s] = x[s, j]
    run(kernel.track, work.path_inputs, work.tracked)
    if not self_motion_steps.tangent_frames(work.tracked, work.tangent, work.normal, work.triangle):
        return False
    if kernel.stops:
        self_motion_steps.tie_last_sample(work.tangent, work.normal)
    run(kernel.slope, work.inputs, work.slopes)
    functions = len(gradients)
    for e in range(len(slope_of)):
        for s in range(slopes.shape[1]):
            gradients[slope_of[e], slope_by[e], s] = slopes[functions + e, s]
    for k in range(len(work.objective_gradients)):
        gradient = work.objective_gradients[k]
        clear(gradient)
        self_motion_steps.add_transposed_stencil(
            work.gradients[k], kernel.quadrature, kernel.neighbours, kernel.coefficients, gradient
        )
    return True


@implement(steps.reduced_gradient, MotionKernel)
def reduced_gradient(kernel, work, weights, multipliers, out):
    """Write the gradient of weights · F − multipliers · c by the unknowns; leave that by q in the workspace."""
    clear(work.gradient_q)
    if len(multipliers):
        _limit_gradient(kernel, work, multipliers)
        self_motion_steps.add_transposed_stencil(
            work.gradient_u, kernel.ones, kernel.neighbours, kernel.coefficients, work.gradient_q
        )
    for k in range(len(weights)):
        if weights[k] != 0.0:
            add_scaled(work.gradient_q, weights[k], work.objective_gradients[k])
    self_motion_steps.project_gradient(work.gradient_q, work.tangent, kernel.first_unknown, out)


@compiled
def _limit_gradient(kernel, work, multipliers):
    """Write the gradient of −multipliers · c by u, and the multipliers of variables and rows, signed."""
    gradient_u, by_row, gradients = work.gradient_u, work.by_row, work.gradients
    limited, sides = kernel.limited, kernel.sides
    variables, samples = gradient_u.shape
    clear(by_row)
    for i in range(len(sides)):
        by_row[limited[i, 0], limited[i, 1]] -= sides[i] * multipliers[i]
    sums = len(work.objective_gradients)
    for a in range(variables):
        for s in range(samples):
            gradient_u[a, s] = by_row[a, s]
        for g in range(len(gradients) - sums):
            for s in range(samples):
                gradient_u[a, s] += by_row[variables + g, s] * gradients[sums + g, a, s]


@implement(steps.prepare_multipliers, MotionKernel)
def prepare_multipliers(kernel, work, weights):
    """Write the multipliers of path, sums and rows where the Hessian of the Lagrangian reads them."""
    first, variables, samples = kernel.multipliers, len(work.gradient_u), work.gradient_u.shape[1]
    inputs, by_row, quadrature = work.inputs, work.by_row, kernel.quadrature
    for g in range(len(by_row) - variables):
        for s in range(samples):
            inputs[first[2] + g, s] = by_row[variables + g, s]
    for k in range(len(weights)):
        for s in range(samples):
            inputs[first[1] + k, s] = weights[k] * quadrature[s]
    self_motion_steps.path_multipliers(
        work.gradient_q, work.normal, work.triangle, kernel.stride, inputs[first[0] : first[1]]
    )


@implement(steps.residual_norm, MotionKernel)
def residual_norm(kernel, residual):
    """Return the root mean square over time."""
    return np.sqrt(len(kernel.ones) // kernel.stride + kernel.stride - 1) * norm(residual)


@implement(steps.assemble, MotionKernel)
def assemble(kernel, work, stiffness, A, B, C):
    """Add up the second derivatives of the Lagrangian and the stiffness of the limits, sample by sample."""
    variables, samples = work.gradient_u.shape
    local = np.zeros((variables, kernel.coefficients.shape[2] * work.tangent.shape[2]))
    phi, row, half = np.empty((variables, variables)), np.empty(variables), np.zeros(local.shape)
    run(kernel.curvature, work.inputs, work.seconds)
    clear(work.by_row)
    by_row, limited = work.by_row, kernel.limited
    for i in range(len(limited)):
        by_row[limited[i, 0], limited[i, 1]] += stiffness[i]
    for s in range(samples):
        _sample_hessian(kernel, work, s, row, phi)
        self_motion_steps.add_hessian(
            s, phi, kernel.neighbours, kernel.coefficients, work.tangent, kernel.first_unknown, local, half, A, B, C
        )
    largest = 0.0
    for i in range(A.shape[0]):
        largest = max(largest, abs(A[i, 0]))
    return largest


@compiled
def _sample_hessian(kernel, work, s, row, phi):
    """Write the Hessian (U, U) of one sample by u."""
    variables, sums = len(phi), len(work.objective_gradients)
    second_i, second_j, seconds = kernel.second_i, kernel.second_j, work.seconds
    by_row, gradients = work.by_row, work.gradients
    clear(phi)
    for e in range(len(second_i)):
        i, j = second_i[e], second_j[e]
        phi[i, j] = phi[j, i] = seconds[e, s]
    for a in range(variables):
        phi[a, a] += by_row[a, s]
    for g in range(len(gradients) - sums):
        for a in range(variables):
            row[a] = gradients[sums + g, a, s]
        for a in range(variables):
            scaled = by_row[variables + g, s] * row[a]
            for b in range(variables):
                phi[a, b] += scaled * row[b]


@implement(steps.expand_step, MotionKernel)
def expand_step(kernel, work, step, dx):
    """Write the change of q; return its largest entry."""
    return self_motion_steps.expand_motion_step(step, work.tangent, kernel.first_unknown, dx)


@implement(steps.directional_derivatives, MotionKernel)
def directional_derivatives(kernel, work, dx, dF, dc):
    """Write the derivatives of sums and limits along dx."""
    du, by_row, gradients = work.du, work.by_row, work.gradients
    limited, sides = kernel.limited, kernel.sides
    variables, samples = du.shape
    sums = len(dF)
    self_motion_steps.apply_stencil(dx, kernel.neighbours, kernel.coefficients, du)
    for k in range(sums):
        dF[k] = inner_product(work.objective_gradients[k], dx)
    for a in range(variables):
        for s in range(samples):
            by_row[a, s] = du[a, s]
    for g in range(len(gradients) - sums):
        for s in range(samples):
            by_row[variables + g, s] = 0.0
        for a in range(variables):
            for s in range(samples):
                by_row[variables + g, s] += gradients[sums + g, a, s] * du[a, s]
    for i in range(len(sides)):
        dc[i] = sides[i] * by_row[limited[i, 0], limited[i, 1]]


@implement(steps.retract, MotionKernel)
def retract(kernel, work, x, dx, length, trial):
    """Write the motion on the path that a step leads to; return whether it got there."""
    samples, n = x.shape
    for s in range(samples):
        for j in range(n):
            trial[s, j] = x[s, j] + length * dx[s, j]
    if kernel.stops:
        for j in range(n):
            trial[-1, j] = trial[-2, j]
    return self_motion_steps.retract_motion(
        kernel.track, work.path_inputs, trial, work.normal, work.triangle, work.tracked
    )
