"""The compiled kernel of motions, whose Newton matrix is banded in time.

Unknowns are steps along the self-motion of every sample: q moves along the null space of the tasks' Jacobian and is
then retracted onto the path, so that every iterate is on the path. The program has (dof − task rows) unknowns per
sample. Its exact second derivatives, with the path's curvature, are banded in time; the border closes a cycle.
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.banded import kernel as steps
from paretoik.nlp.banded.kernel import implement
from paretoik.nlp.linear_algebra import add_scaled, clear, inner_product, norm
from paretoik.trajectory import curve_state_kernel as curve_states
from paretoik.trajectory import kink_smoothing
from paretoik.trajectory import self_motion_kernel as self_motion_steps
from paretoik.trajectory.kernel_arrays import MotionKernel, allocate, sample_count

# Limits on variables and functions of an instant, as rows of the program; compiled
#
# Row i is factors[i] · (value − bounds[i]) ≥ 0. Its value is that of row ``limited``[i, 0] at instant
# ``limited``[i, 1]; rows are the variables u at an instant, then the limited functions.


@compiled
def limit_gradient(kernel, work, multipliers):
    """Write the gradient of −multipliers · c by u.

    The multipliers of variables and rows are written too, in their own units.
    """
    gradient_u, by_row, gradients = work.gradient_u, work.by_row, work.gradients
    limited, factors = kernel.limited, kernel.factors
    variables, samples = gradient_u.shape
    clear(by_row)
    for i in range(len(factors)):
        by_row[limited[i, 0], limited[i, 1]] -= factors[i] * multipliers[i]
    sums = len(work.objective_gradients)
    for a in range(variables):
        for s in range(samples):
            gradient_u[a, s] = by_row[a, s]
        for g in range(len(kernel.row_peaks)):
            for s in range(samples):
                gradient_u[a, s] += by_row[variables + g, s] * gradients[sums + g, a, s]


@compiled
def sum_stiffness(kernel, work, stiffness):
    """Write the stiffness of variables and rows in their own units."""
    by_row, limited = work.by_row, kernel.limited
    clear(by_row)
    for i in range(len(limited)):
        by_row[limited[i, 0], limited[i, 1]] += stiffness[i] * kernel.factors[i] ** 2


@compiled
def write_rows(kernel, work, columns, entries):
    """Write limits' rows by the unknowns; without kinks and peaks only."""
    variables, instants = work.gradient_u.shape
    limited, gradients, sums = kernel.limited, work.gradients, len(work.objective_gradients)
    r, width = work.tangent.shape[2], entries.shape[1]
    local = np.zeros((instants, variables, width))
    for s in range(instants):
        self_motion_steps.local_basis(
            s, kernel.neighbours, kernel.coefficients, work.tangent, work.curve.chain, local[s]
        )
    for i in range(len(limited)):
        row, s, factor = limited[i, 0], limited[i, 1], kernel.factors[i]
        for b in range(width):
            first = kernel.first_unknown[kernel.neighbours[s, b // r]]
            columns[i, b] = first + b % r if first >= 0 else 0
            entries[i, b] = factor * local[s, row, b] if row < variables and first >= 0 else 0.0
        if row >= variables:
            for a in range(variables):
                scaled = factor * gradients[sums + row - variables, a, s]
                if scaled != 0.0:
                    for b in range(width):
                        if kernel.first_unknown[kernel.neighbours[s, b // r]] >= 0:
                            entries[i, b] += scaled * local[s, a, b]


# Peaks of a motion: epigraph variables σ on the border of Newton's matrix; compiled
#
# A peak is the least σ with σ − piece ≥ 0 for every piece at every sample. The rows σ − piece are ordinary limited
# rows. These functions add their derivatives by σ, which follows the samples in a point.


@compiled
def peak_rows(kernel, n):
    """Return the number of rows (n entries each) for a point's peaks."""
    return (len(kernel.peak_inputs) + n - 1) // n


@compiled
def copy_peaks(kernel, work, x):
    """Copy the epigraph variables σ of a point into the functions' inputs."""
    samples, n = sample_count(kernel), x.shape[1]
    for k in range(len(kernel.peak_inputs)):
        for s in range(len(kernel.ones)):
            work.inputs[kernel.peak_inputs[k], s] = x[samples + k // n, k % n]


@compiled
def lift_peaks(kernel, work, x):
    """Write a motion's least σ into its point.

    Functions of samples must have been evaluated at σ = 0.
    """
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
    """Write the Lagrangian's gradient by σ.

    The Lagrangian is weights · F − multipliers · c. The signed multipliers of rows are those in ``by_row``.
    """
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
    """Write the border's rows for σ, from stiffnesses in ``by_row``."""
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
    """Write the change of σ with a step of the unknowns."""
    samples, n = sample_count(kernel), dx.shape[1]
    for k in range(len(kernel.peak_inputs)):
        dx[samples + k // n, k % n] = step[kernel.unknowns + k]


# The kernel of motions; compiled.


@implement(steps.dimensions, MotionKernel)
def dimensions(kernel, x):
    """Return the Newton matrix's (size, band, border), and the limits' number."""
    rows = len(kernel.curve.row_scales)
    band = kernel.coefficients.shape[2] * (x.shape[1] - rows)
    return kernel.unknowns - kernel.border, band, kernel.border + len(kernel.peak_inputs), len(kernel.factors)


@implement(steps.objective_scale, MotionKernel)
def objective_scale(kernel, weights):
    """Return 1: sums are divided by their scales."""
    return 1.0


@implement(steps.allocate_workspace, MotionKernel)
def allocate_workspace(kernel, x):
    """Return the workspace for motions of x's shape."""
    return allocate(kernel, x.shape[1])


@implement(steps.add_auxiliary, MotionKernel)
def add_auxiliary(kernel, work, x):
    """Return the point of a motion, with each peak's least σ.

    The sizes of kinks are measured.
    """
    samples, n = x.shape
    point = np.zeros((samples + peak_rows(kernel, n), n))
    for s in range(samples):
        for j in range(n):
            point[s, j] = x[s, j] / kernel.scales[j]
    _write_states(kernel, work, point)
    copy_peaks(kernel, work, point)
    kink_smoothing.evaluate_functions(kernel, work)
    kink_smoothing.measure_kinks(kernel, work)
    lift_peaks(kernel, work, point)
    return point


@compiled
def _write_states(kernel, work, x):
    """Write the variables u of all instants at a point."""
    u, n = work.inputs[: len(work.gradient_spline)], len(kernel.scales)
    self_motion_steps.apply_stencil(x, kernel.neighbours, kernel.coefficients, u)
    if kernel.kinked:
        work.inputs[4 * n : 4 * n + len(u)] = u
    curve_states.project_instants(kernel.curve, work.curve, u)


@compiled
def _add_by_positions(kernel, work, gradient, scale, gradient_q):
    """Add the gradient by q from a gradient by u.

    The gradients are (time, dof) and (variables, instants); the latter is multiplied by ``scale`` (instants,).
    """
    curve_states.chain_gradient(work.curve, gradient[: len(work.gradient_u)], work.gradient_spline)
    self_motion_steps.add_transposed_stencil(
        work.gradient_spline, scale, kernel.neighbours, kernel.coefficients, gradient_q
    )


@implement(steps.remove_auxiliary, MotionKernel)
def remove_auxiliary(kernel, x):
    """Return the motion of a point."""
    return x[: sample_count(kernel)] * kernel.scales


@implement(steps.set_smoothing, MotionKernel)
def set_smoothing(kernel, work, mu):
    """Set the width of kinks; return whether there are any."""
    kink_smoothing.set_widths(kernel, work, mu)
    return len(kernel.kinks) > 0


@implement(steps.restore, MotionKernel)
def restore(kernel, work, x):
    """Return 0: a motion is on the path already."""
    return 0.0


@implement(steps.evaluate, MotionKernel)
def evaluate(kernel, work, x, F, c):
    """Write the sums and the distances from limits of the motion x."""
    samples, n = sample_count(kernel), x.shape[1]
    sums, variables = len(work.objective_gradients), len(work.gradient_u)
    inputs, values, quadrature = work.inputs, work.values, kernel.quadrature
    limited, factors, bounds = kernel.limited, kernel.factors, kernel.bounds
    _write_states(kernel, work, x)
    copy_peaks(kernel, work, x)
    kink_smoothing.evaluate_functions(kernel, work)
    for total in range(len(F)):
        k, peak = kernel.totals[total], -1 - kernel.totals[total]
        F[total] = 0.0 if k >= 0 else x[samples + peak // n, peak % n]
        for s in range(len(quadrature) if k >= 0 else 0):
            F[total] += quadrature[s] * values[k, s]
    for i in range(len(factors)):
        row, s = limited[i, 0], limited[i, 1]
        value = inputs[row, s] if row < variables else values[sums + row - variables, s]
        c[i] = factors[i] * (value - bounds[i])


@implement(steps.linearise, MotionKernel)
def linearise(kernel, work, x):
    """Prepare the path's tangent and the gradients at x.

    Returns False at a singularity.
    """
    slopes, gradients, instants = work.slopes, work.gradients, len(kernel.ones)
    slope_of, slope_by = kernel.slope_of, kernel.slope_by
    _write_states(kernel, work, x)
    if len(kernel.kinks):
        copy_peaks(kernel, work, x)
        kink_smoothing.evaluate_functions(kernel, work)
        kink_smoothing.linearise_kinks(kernel, work)
    for s in range(work.path_inputs.shape[1]):
        for j in range(x.shape[1]):
            work.path_inputs[j, s] = x[s, j]
    run(kernel.track, work.path_inputs, work.tracked)
    curve_states.linearise_instants(kernel.curve, work.curve)
    if not self_motion_steps.tangent_frames(work.tracked, work.tangent, work.normal, work.triangle):
        return False
    if kernel.stops:
        self_motion_steps.tie_last_sample(work.tangent, work.normal)
    run(kernel.slope, work.inputs, work.slopes)
    functions = len(gradients)
    for f in range(functions if len(kernel.kinks) else 0):  # entries that are always 0
        clear(gradients[f])
    for e in range(len(slope_of)):
        for s in range(instants):
            gradients[slope_of[e], slope_by[e], s] = slopes[functions + e, s]
    if len(kernel.kinks):
        kink_smoothing.chain_gradients(kernel, work)
    for k in range(len(work.objective_gradients)):
        gradient = work.objective_gradients[k]
        clear(gradient)
        _add_by_positions(kernel, work, work.gradients[k], kernel.quadrature, gradient)
    return True


@implement(steps.reduced_gradient, MotionKernel)
def reduced_gradient(kernel, work, weights, multipliers, out):
    """Write the reduced gradient of weights · F − multipliers · c.

    It is by the unknowns; the gradient by q is in the workspace.
    """
    clear(work.gradient_q)
    clear(work.gradient_u)
    if len(multipliers):
        limit_gradient(kernel, work, multipliers)
        _add_by_positions(kernel, work, work.gradient_u, kernel.ones, work.gradient_q)
    for total in range(len(weights)):
        if weights[total] != 0.0 and kernel.totals[total] >= 0:
            add_scaled(work.gradient_q, weights[total], work.objective_gradients[kernel.totals[total]])
    self_motion_steps.project_gradient(work.gradient_q, work.tangent, kernel.first_unknown, out)
    peak_gradient(kernel, work, weights, multipliers, out)


@implement(steps.prepare_multipliers, MotionKernel)
def prepare_multipliers(kernel, work, weights):
    """Write path, sum and row multipliers as inputs of the Hessian.

    The Hessian is that of the Lagrangian.
    """
    first, variables, samples = kernel.multipliers, len(work.gradient_u), work.gradient_u.shape[1]
    inputs, by_row, quadrature = work.inputs, work.by_row, kernel.quadrature
    for g in range(len(by_row) - variables):
        for s in range(samples):
            inputs[first[2] + g, s] = by_row[variables + g, s]
    for total in range(len(weights)):
        if kernel.totals[total] >= 0:
            for s in range(samples):
                inputs[first[1] + kernel.totals[total], s] = weights[total] * quadrature[s]
    if len(kernel.kinks):
        kink_smoothing.tie_multipliers(kernel, work, weights)
    rows = len(kernel.curve.row_scales)
    nu = work.path_inputs[first[0] : first[0] + rows]
    self_motion_steps.path_multipliers(work.gradient_q, work.normal, work.triangle, nu)
    if kernel.curve.projects:
        by_curve = work.gradient_spline
        by_curve[:] = work.gradient_u[: len(by_curve)]
        for total in range(len(weights)):
            k = kernel.totals[total]
            for a in range(len(by_curve) if k >= 0 and weights[total] != 0.0 else 0):
                for s in range(samples):
                    by_curve[a, s] += weights[total] * quadrature[s] * work.gradients[k, a, s]
        of_curve = inputs[first[0] + rows : first[1]]
        curve_states.curve_multipliers(kernel.curve, work.curve, by_curve, of_curve)


@implement(steps.residual_norm, MotionKernel)
def residual_norm(kernel, residual):
    """Return the root mean square over time."""
    return np.sqrt(sample_count(kernel)) * norm(residual)


@implement(steps.assemble, MotionKernel)
def assemble(kernel, work, stiffness, A, B, C):
    """Write Newton's matrix, sample by sample.

    It is the Lagrangian's second derivatives plus the stiffness of limits.
    """
    variables, samples = work.gradient_u.shape
    states = len(work.gradient_spline)
    behind = 2 * states if kernel.curve.projects else variables  # the spline's u follow those of the curve
    local = np.zeros((behind, kernel.coefficients.shape[2] * work.tangent.shape[2]))
    phi, row, half = np.zeros((behind, behind)), np.empty(variables), np.zeros(local.shape)
    run(kernel.curvature, work.inputs, work.seconds)
    run(kernel.track_curvature, work.path_inputs, work.track_seconds)
    self_motion_steps.add_path_hessian(work.track_seconds, work.tangent, kernel.first_unknown, A, C)
    sum_stiffness(kernel, work, stiffness)
    stencil = kernel.neighbours, kernel.coefficients, kernel.first_unknown
    for s in range(samples):
        clear(phi)
        # add the Hessian of one sample by u
        block = phi[:variables, :variables]
        variables, sums = len(row), len(work.objective_gradients)
        second_i, second_j, seconds = kernel.second_i, kernel.second_j, work.seconds
        by_row, gradients = work.by_row, work.gradients
        for e in range(len(second_i)):
            i, j = second_i[e], second_j[e]
            if i < variables and j < variables:
                block[i, j] = block[j, i] = seconds[e, s]
        for a in range(variables):
            block[a, a] += by_row[a, s]
        if len(kernel.kinks):
            kink_smoothing.add_kink_hessian(kernel, work, s, row, block)
        for g in range(len(kernel.row_peaks)):
            for a in range(variables):
                row[a] = gradients[sums + g, a, s]
            for a in range(variables):
                scaled = by_row[variables + g, s] * row[a]
                if scaled != 0.0:
                    for b in range(variables):
                        block[a, b] += scaled * row[b]
        curve_states.add_twist(work.curve, s, phi[states:, states:])
        self_motion_steps.add_hessian(s, phi, stencil, work.tangent, work.curve.chain, local, half, (A, B, C))
    assemble_peaks(kernel, work, A, B, C)
    largest = 0.0
    for i in range(A.shape[0]):
        largest = max(largest, abs(A[i, 0]))
    return largest


@implement(steps.expand_step, MotionKernel)
def expand_step(kernel, work, step, dx):
    """Write the change of q and σ; return q's largest change."""
    step_peaks(kernel, step, dx)
    return self_motion_steps.expand_motion_step(step, work.tangent, kernel.first_unknown, dx)


@implement(steps.directional_derivatives, MotionKernel)
def directional_derivatives(kernel, work, dx, dF, dc):
    """Write the derivatives of sums and limits along dx."""
    du, by_row, gradients = work.du, work.by_row, work.gradients
    limited, factors = kernel.limited, kernel.factors
    (variables, instants), n, samples = du.shape, dx.shape[1], sample_count(kernel)
    sums = len(work.objective_gradients)
    self_motion_steps.apply_stencil(dx, kernel.neighbours, kernel.coefficients, du)
    curve_states.chain_directions(work.curve, du)
    for total in range(len(dF)):
        k, peak = kernel.totals[total], -1 - kernel.totals[total]
        dF[total] = inner_product(work.objective_gradients[k], dx) if k >= 0 else dx[samples + peak // n, peak % n]
    for a in range(variables):
        for s in range(instants):
            by_row[a, s] = du[a, s]
    for g in range(len(kernel.row_peaks)):
        peak = kernel.row_peaks[g]
        for s in range(instants):
            by_row[variables + g, s] = 0.0 if peak < 0 else dx[samples + peak // n, peak % n]
        for a in range(variables):
            for s in range(instants):
                by_row[variables + g, s] += gradients[sums + g, a, s] * du[a, s]
    for i in range(len(factors)):
        dc[i] = factors[i] * by_row[limited[i, 0], limited[i, 1]]


@implement(steps.row_width, MotionKernel)
def row_width(kernel, work):
    """Return the number of unknowns of an instant's neighbours."""
    return kernel.coefficients.shape[2] * work.tangent.shape[2]


@implement(steps.constraint_rows, MotionKernel)
def constraint_rows(kernel, work, columns, entries):
    """Write limits' rows by the unknowns; without kinks and peaks only."""
    write_rows(kernel, work, columns, entries)


@implement(steps.retract, MotionKernel)
def retract(kernel, work, x, dx, length, trial):
    """Write the motion after a step, retracted onto the path.

    Returns whether the retraction succeeded.
    """
    samples = sample_count(kernel)
    for s in range(x.shape[0]):
        for j in range(x.shape[1]):
            trial[s, j] = x[s, j] + length * dx[s, j]
    if kernel.stops:
        for j in range(x.shape[1]):
            trial[samples - 1, j] = trial[samples - 2, j]
    return self_motion_steps.retract_motion(
        kernel.track, work.path_inputs, trial, work.normal, work.triangle, work.tracked
    )
