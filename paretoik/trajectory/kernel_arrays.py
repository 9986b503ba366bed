"""Motions as arrays for compiled code: program, workspace, and steps on the self-motion of every sample.

The variables u of an instant, its position and rates, are sums over samples (``Stencil``). The unknowns of a sample are
steps along its ``tangent`` (time, dof, unknowns), the null space of the tasks' Jacobian.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.linear_algebra import clear, eliminate
from paretoik.trajectory.curve_state_kernel import Curve, CurveWork, allocate_curve
from paretoik.trajectory.discretisation import Stencil


class MotionKernel(NamedTuple):
    """A ``MotionProgram`` of sums and peaks as arrays.

    A point has a row of joint positions per sample, divided by ``scales``, then rows with the epigraph variables σ of
    its peaks. Path equations are evaluated at the samples, functions at all instants. Functions of an instant are sums,
    limited rows (with the rows σ − piece of peaks), then the ties of slacks v.
    """

    value: tuple[np.ndarray, ...]
    slope: tuple[np.ndarray, ...]
    slope_of: np.ndarray
    slope_by: np.ndarray
    curvature: tuple[np.ndarray, ...]
    second_i: np.ndarray
    second_j: np.ndarray
    track: tuple[np.ndarray, ...]
    track_curvature: tuple[np.ndarray, ...]
    curve: Curve
    kinked: bool  # whether the spline's u are variables too, after the curve's
    stencil: Stencil
    stride: int  # number of instants from one sample to the next
    stops: bool  # whether the last sample is the posture nearest to the one before
    ones: np.ndarray
    quadrature: np.ndarray
    inputs: np.ndarray
    multipliers: np.ndarray
    limited: np.ndarray  # (limits, 2): variable or row, and sample
    factors: np.ndarray  # (limits,): 1 / range for a lower limit, −1 / range for an upper one
    bounds: np.ndarray  # (limits,)
    scales: np.ndarray  # (dof,): units of joints
    totals: np.ndarray  # (totals,): index k of a sum, or −1 − k of a peak
    peak_inputs: np.ndarray  # (peaks,)
    row_peaks: np.ndarray  # (rows,): index of the row's peak, −1 if it has none
    kinks: np.ndarray  # (kinks, 4): input, variable, sign and first tie of a slack v, innermost first
    nesting: int  # largest depth of nested kinks
    smoothing: float  # width of kinks over μ · size of argument: number of kinks at all instants
    longest_step: float = 0.4  # largest step of a joint [rad, arm's length]: too short to skip to another branch
    penalty: float = 10.0  # penalty of a violation by a whole range, in sizes of the objective
    implied_slacks: bool = True
    large_multiplier: float = np.inf
    dual_fraction: float = 0.25  # largest share of the way to its bounds that a kink's dual moves in a step
    least_smoothing: float = 1e-9  # least width of a kink, in sizes of its argument: rounding error


class Workspace(NamedTuple):
    """Arrays that the steps write.

    Numbers: U variables of an instant, V slacks, K sums, G limited rows, r unknowns per sample.
    """

    inputs: np.ndarray
    curve: CurveWork
    path_inputs: np.ndarray  # (inputs, time)
    tracked: np.ndarray  # path equations and their Jacobian
    track_seconds: np.ndarray  # (dof², time): second derivatives of the path equations, times their multipliers
    tangent: np.ndarray  # (time, dof, r)
    normal: np.ndarray  # (time, dof, rows)
    triangle: np.ndarray  # (time, rows, rows)
    values: np.ndarray  # (K + G + 2V, instants)
    slopes: np.ndarray
    seconds: np.ndarray
    gradients: np.ndarray  # (K + G + 2V, U + V + peaks, instants): gradients of functions, by u, then v, then σ
    objective_gradients: np.ndarray  # (K, time, dof): gradients of sums by q
    by_row: np.ndarray  # (U + G, instants): one number per variable and limited row
    gradient_u: np.ndarray  # (U, instants)
    gradient_spline: np.ndarray  # (states, instants): gradient by the spline's state
    gradient_q: np.ndarray  # (time, dof)
    du: np.ndarray  # (U, instants)
    projected: np.ndarray  # (unknowns,)
    widths: np.ndarray  # (V, 2): size of a kink's argument, and width of its smoothing
    arguments: np.ndarray  # (V, instants): half the difference of a kink's pieces
    arguments_at: np.ndarray  # (V, instants): arguments at the last linearisation
    slopes_at: np.ndarray  # (V, instants): λ there, derivative of the argument's smoothed absolute value
    duals: np.ndarray  # (V, instants): λ̂, predicted by Newton's method
    bends: np.ndarray  # (V, instants): second derivative of the smoothed absolute value, from λ and its dual
    slack_gradients: np.ndarray  # (V, U, instants)
    slack_weights: np.ndarray  # (V, instants): weight of a kink's second derivative in the Lagrangian


@compiled
def sample_count(kernel):
    """Return the number of samples."""
    return (len(kernel.ones) - 1) // kernel.stride + 1


@compiled
def allocate(kernel, n):
    """Return the workspace for motions of n joints."""
    samples, instants = sample_count(kernel), len(kernel.ones)
    slacks, rows = len(kernel.kinks), len(kernel.curve.row_scales)
    states = kernel.stencil.coefficients.shape[0] * n
    variables = 2 * states if kernel.kinked else states
    sums = kernel.multipliers[2] - kernel.multipliers[1]
    limited = len(kernel.row_peaks)
    functions = sums + limited + 2 * slacks
    by_slack = np.zeros((6, slacks, instants))
    return Workspace(
        kernel.inputs.copy(),
        allocate_curve(kernel.curve, states),
        kernel.inputs[:, :: kernel.stride].copy(),
        np.empty((rows + rows * n, samples)),
        np.empty((n * n, samples)),
        np.zeros((samples, n, n - rows)),
        np.zeros((samples, n, rows)),
        np.zeros((samples, rows, rows)),
        np.empty((functions, instants)),
        np.empty((functions + len(kernel.slope_of), instants)),
        np.empty((len(kernel.second_i), instants)),
        np.zeros((functions, variables + slacks + len(kernel.peak_inputs), instants)),
        np.zeros((sums, samples, n)),
        np.zeros((variables + limited, instants)),
        np.zeros((variables, instants)),
        np.zeros((states, instants)),
        np.zeros((samples, n)),
        np.zeros((variables, instants)),
        np.zeros(kernel.stencil.unknowns),
        np.zeros((slacks, 2)),
        by_slack[0],
        by_slack[1],
        by_slack[2],
        by_slack[3],
        by_slack[4],
        np.zeros((slacks, variables, instants)),
        by_slack[5],
    )


# Stencils: finite differences or a spline. Self-motion: steps along tangents. Retraction: back onto the path.


class RetractionOptions(NamedTuple):
    """Settings of Newton's method back onto the path."""

    tolerance: float = 1e-12  # largest error of the path equations, in arm lengths and rad: rounding error
    steps: int = 8  # largest number of steps: Newton's method squares errors; more would mean another sheet


OPTIONS = RetractionOptions()


@compiled
def apply_stencil(stencil, q, u):
    """Write the variables (orders · dof, instants) of q (time, dof)."""
    neighbours, coefficients = stencil.neighbours, stencil.coefficients
    (orders, samples, width), n = coefficients.shape, q.shape[1]
    for o in range(orders):
        for j in range(n):
            for i in range(samples):
                total = 0.0
                for k in range(width):
                    total += coefficients[o, i, k] * q[neighbours[i, k], j]
                u[o * n + j, i] = total


@compiled
def add_transposed_stencil(stencil, gradient_u, scale, gradient_q):
    """Add the gradient by q that follows from one by u, times ``scale`` (instants,)."""
    neighbours, coefficients = stencil.neighbours, stencil.coefficients
    (orders, samples, width), n = coefficients.shape, gradient_q.shape[1]
    for o in range(orders):
        for j in range(n):
            for i in range(samples):
                g = gradient_u[o * n + j, i] * scale[i]
                if g != 0.0:
                    for k in range(width):
                        gradient_q[neighbours[i, k], j] += coefficients[o, i, k] * g


@compiled
def project_gradient(stencil, gradient_q, tangent, reduced):
    """Write the gradient by the unknowns that follows from one by q."""
    (samples, n, r), first_unknown = tangent.shape, stencil.first_unknown
    reduced[:] = 0.0
    for s in range(samples):
        if first_unknown[s] >= 0:
            for a in range(r):
                for j in range(n):
                    reduced[first_unknown[s] + a] += tangent[s, j, a] * gradient_q[s, j]


@compiled
def expand_motion_step(stencil, step, tangent, dq):
    """Write q's change (time, dof) along a step; return its largest entry."""
    (samples, n, r), first_unknown = tangent.shape, stencil.first_unknown
    longest = 0.0
    clear(dq[:samples])
    for s in range(samples):
        for j in range(n):
            if first_unknown[s] >= 0:
                for a in range(r):
                    dq[s, j] += tangent[s, j, a] * step[first_unknown[s] + a]
            longest = max(longest, abs(dq[s, j]))
    return longest


@compiled
def local_basis(stencil, i, tangent, chain, local):
    """Write the derivatives of instant i's u by its neighbours' unknowns.

    ``local`` is (variables, width · unknowns); if it has the rows, the spline's u follows u. ``chain`` (states, states,
    instants) has the derivatives of u by the spline's u, or is empty if both are equal.
    """
    neighbours, coefficients = stencil.neighbours, stencil.coefficients
    (orders, _, width), (_, n, r) = coefficients.shape, tangent.shape
    for o in range(orders):
        for k in range(width):
            for j in range(n):
                for a in range(r):
                    local[o * n + j, k * r + a] = coefficients[o, i, k] * tangent[neighbours[i, k], j, a]
    states = orders * n
    if chain.shape[2]:
        spline = local[:states].copy()
        clear(local[:states])
        for a in range(states):
            for m in range(states):
                if chain[a, m, i] != 0.0:
                    for b in range(local.shape[1]):
                        local[a, b] += chain[a, m, i] * spline[m, b]
        if len(local) > states:
            local[states:] = spline


@compiled
def add_hessian(stencil, i, phi, tangent, chain, local, half, matrix):
    """Add instant i's Hessian by u to the unknowns' (A, B, C)."""
    (A, B, C), first_unknown, neighbours = matrix, stencil.first_unknown, stencil.neighbours
    width, r, size = neighbours.shape[1], tangent.shape[2], A.shape[0]
    local_basis(stencil, i, tangent, chain, local)
    for a in range(local.shape[0]):
        for b in range(local.shape[1]):
            half[a, b] = 0.0
        for m in range(local.shape[0]):
            if phi[a, m] != 0.0:
                for b in range(local.shape[1]):
                    half[a, b] += phi[a, m] * local[m, b]
    for k in range(width):
        if first_unknown[neighbours[i, k]] < 0:
            continue
        for h in range(width):
            if first_unknown[neighbours[i, h]] < 0:
                continue
            for a in range(r):
                for b in range(r):
                    row, column = first_unknown[neighbours[i, k]] + a, first_unknown[neighbours[i, h]] + b
                    if row < column:
                        continue
                    total = 0.0
                    for m in range(local.shape[0]):
                        total += local[m, k * r + a] * half[m, h * r + b]
                    if row < size:
                        A[row, row - column] += total
                    elif column < size:
                        B[row - size, column] += total
                    else:
                        C[row - size, column - size] += total
                        if row != column:
                            C[column - size, row - size] += total


@compiled
def add_path_hessian(stencil, seconds, tangent, A, C):
    """Add samples' second derivatives by q (dof², time) to the unknowns' Hessian."""
    samples, n, r = tangent.shape
    for s in range(samples):
        begin, size = stencil.first_unknown[s], A.shape[0]
        for a in range(r if begin >= 0 else 0):
            for b in range(r):
                total = 0.0
                for i in range(n):
                    for j in range(n):
                        total += tangent[s, i, a] * seconds[i * n + j, s] * tangent[s, j, b]
                if begin >= size:
                    C[begin - size + a, begin - size + b] += total
                elif b <= a:
                    A[begin + a, a - b] += total


@compiled
def tangent_frames(tracked, tangent, normal, triangle):
    """Write bases of every Jacobian's null space and row space Y, and R of Jᵀ = Y R.

    They follow from Householder reflections. ``tracked`` (rows + rows · dof, time) has path equations and Jacobian
    entries. Returns False at a singularity.
    """
    samples, n, rows = normal.shape
    work, basis, v = np.empty((n, rows)), np.empty((n, n)), np.empty(n)
    for s in range(samples):
        for j in range(n):
            for i in range(rows):
                work[j, i] = tracked[rows + i * n + j, s]
            for i in range(n):
                basis[i, j] = 1.0 if i == j else 0.0
        for i in range(rows):
            size = 0.0
            for j in range(i, n):
                size += work[j, i] ** 2
            size = np.sqrt(size)
            if not size > 1e-9:
                return False
            v[i:] = work[i:, i]
            v[i] += size if work[i, i] >= 0 else -size
            square = 0.0
            for j in range(i, n):
                square += v[j] ** 2
            for c in range(i, rows):
                _reflect(work[:, c], v, i, square)
            for c in range(n):
                _reflect(basis[c], v, i, square)
        normal[s], tangent[s] = basis[:, :rows], basis[:, rows:]
        for i in range(rows):
            triangle[s, i, i:] = work[i, i:]
    return True


@compiled
def tie_last_sample(tangent, normal):
    """Write the last tangent: that of the sample before, projected onto the last null space."""
    _, n, r = tangent.shape
    for a in range(r):
        tangent[-1, :, a] = tangent[-2, :, a]
        for i in range(normal.shape[2]):
            along = 0.0
            for j in range(n):
                along += normal[-1, j, i] * tangent[-2, j, a]
            for j in range(n):
                tangent[-1, j, a] -= along * normal[-1, j, i]


@compiled
def _reflect(x, v, begin, square):
    dot = 0.0
    for j in range(begin, len(x)):
        dot += x[j] * v[j]
    for j in range(begin, len(x)):
        x[j] -= 2 * dot / square * v[j]


@compiled
def retract_motion(track, inputs, q, normal, triangle, tracked):
    """Move q (time, dof) back onto the path; return whether it succeeded.

    Newton's method, q ← q − Y (J Y)⁻¹ g with the columns Y of ``normal``, must converge for all samples. It fails if a
    sample crosses a fold to another sheet of the self-motion manifold.
    """
    samples, n, rows = normal.shape
    matrix, right = np.empty((rows, rows)), np.empty(rows)
    for attempt in range(OPTIONS.steps):
        inputs[:n] = q[:samples].T
        run(track, inputs, tracked)
        worst = 0.0
        for i in range(rows):
            for s in range(samples):
                worst = max(worst, abs(tracked[i, s]))
        if worst <= OPTIONS.tolerance:
            return True
        if not worst < 1.0 or attempt == OPTIONS.steps - 1:
            return worst <= 100 * OPTIONS.tolerance  # long arms have larger rounding errors than the tolerance
        for s in range(samples):
            for i in range(rows):
                right[i] = tracked[i, s]
                for c in range(rows):
                    total = 0.0
                    for j in range(n):
                        total += tracked[rows + i * n + j, s] * normal[s, j, c]
                    matrix[i, c] = total
            if not eliminate(matrix, right, triangle[s]):
                return False
            for j in range(n):
                for c in range(rows):
                    q[s, j] -= normal[s, j, c] * right[c]
    return False


@compiled
def path_multipliers(gradient_q, normal, triangle, multipliers):
    """Write ν (rows, time), for which Jᵀ ν = −(gradient in J's row space)."""
    samples, n, rows = normal.shape
    for s in range(samples):
        for i in range(rows - 1, -1, -1):
            y = 0.0
            for j in range(n):
                y -= normal[s, j, i] * gradient_q[s, j]
            for a in range(i + 1, rows):
                y -= triangle[s, i, a] * multipliers[a, s]
            multipliers[i, s] = y / triangle[s, i, i]
