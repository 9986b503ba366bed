"""The compiled kernel of motions, whose Newton matrix is banded in time.

Unknowns are steps along the self-motion of every sample: q moves along the null space of the tasks' Jacobian and is
then retracted onto the path, so that every iterate is on the path. The program has (dof − task rows) unknowns per
sample. Its exact second derivatives, with the path's curvature, are banded in time; a border couples a cycle's ends.
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.banded import kernel as steps
from paretoik.nlp.banded.kernel import implement
from paretoik.nlp.linear_algebra import add_scaled, clear, inner_product, norm
from paretoik.trajectory import curve_state_kernel as curve_states
from paretoik.trajectory.kernel_arrays import (
    MotionKernel,
    add_hessian,
    add_path_hessian,
    add_transposed_stencil,
    allocate,
    apply_stencil,
    expand_motion_step,
    local_basis,
    path_multipliers,
    project_gradient,
    retract_motion,
    sample_count,
    tangent_frames,
    tie_last_sample,
)

# Kinks of an instant's functions, smoothed more if the barrier is larger; compiled
#
# A slack v is max(a, b), or min(a, b) with sign −1; its ties are v − a and v − b, times the sign. It is eliminated by
# v = (a + b)/2 ± √(E² + ν²) with E = (a − b)/2, and its width ν decreases with the barrier. So every function of v is a
# smooth function of u and still banded in time. The derivative λ = E / √(E² + ν²) solves λ √(E² + ν²) = E. Newton's
# method iterates E and λ together: its Hessian has (1 − λ λ̂) / √(E² + ν²) instead of the second derivative
# (1 − λ²) / √(E² + ν²), and λ̂ is the λ predicted in the last step. With λ² steps are very small if ν is small. If λ̂
# moves to its bounds slowly, a kink stays stiff after it is crossed, so that steps do not oscillate; with λ̂ = 0 the
# iteration is lagged diffusivity, which never oscillates. Source: Chan, Golub & Mulet 1999, section 4; Vogel & Oman
# 1996 for lagged diffusivity.
#
# With weight w in the objective and a barrier μ on each tie, a slack would be 2 μ / w above a kink of size 0. The sizes
# of all kinks add up to the size of the objective, 1. Therefore the width of each, in its own size, is μ times the
# number of kinks.


@compiled
def evaluate_functions(kernel, work):
    """Write the functions of all instants, with smoothed slacks v."""
    inputs, values, kinks, arguments = work.inputs, work.values, kernel.kinks, work.arguments
    for j in range(len(kinks)):
        inputs[kinks[j, 0]] = 0.0
    for _ in range(kernel.nesting):  # inner kinks first
        run(kernel.value, work.inputs, work.values)
        for j in range(len(kinks)):
            row, sign, tie, width = kinks[j, 0], kinks[j, 2], kinks[j, 3], work.widths[j, 1]
            excess = width - kernel.least_smoothing * work.widths[j, 0]
            for s in range(values.shape[1]):
                v = sign * inputs[row, s]
                first, second = values[tie, s] - v, values[tie + 1, s] - v
                arguments[j, s] = (second - first) / 2
                size = np.sqrt(arguments[j, s] ** 2 + width * width) - excess
                inputs[row, s] = sign * (size - (first + second) / 2)
    run(kernel.value, work.inputs, work.values)


@compiled
def measure_kinks(kernel, work):
    """Write the size of each kink's argument: the mean of its absolute value over time."""
    samples, largest = work.arguments.shape[1], 0.0
    for j in range(len(kernel.kinks)):
        work.widths[j, 0] = 0.0
        for s in range(samples):
            work.widths[j, 0] += abs(work.arguments[j, s]) / samples
        largest = max(largest, work.widths[j, 0])
    for j in range(len(kernel.kinks)):
        work.widths[j, 0] = max(work.widths[j, 0], 1e-3 * largest, 1e-300)


@compiled
def linearise_kinks(kernel, work):
    """Write slopes and second derivatives of all kinks, and predicted duals.

    A dual moves at most a share of the way to its bounds ±1: a crossed kink stays stiff for some steps.
    """
    share = 1.0 - kernel.dual_fraction
    for j in range(len(kernel.kinks)):
        width = work.widths[j, 1]
        for s in range(work.arguments.shape[1]):
            argument, dual = work.arguments[j, s], work.duals[j, s]
            expected = work.slopes_at[j, s] + work.bends[j, s] * (argument - work.arguments_at[j, s])
            dual = min(max(expected, share * (1.0 + dual) - 1.0), 1.0 - share * (1.0 - dual))
            length = np.sqrt(argument * argument + width * width)
            work.duals[j, s], work.slopes_at[j, s], work.arguments_at[j, s] = dual, argument / length, argument
            work.bends[j, s] = (1.0 - dual * argument / length) / length


@compiled
def chain_gradients(kernel, work):
    """Add the chain rule's terms of slacks v to all gradients by u."""
    gradients, kinks, by_u = work.gradients, kernel.kinks, work.slack_gradients
    variables, samples = work.gradient_u.shape
    first_tie = len(gradients) - 2 * len(kinks)
    for j in range(len(kinks)):
        sign, tie = kinks[j, 2], kinks[j, 3]
        for f in range(tie, tie + 2):
            _chain(kernel, work, f, j)
        for a in range(variables):
            for s in range(samples):
                slope = work.slopes_at[j, s]
                by_u[j, a, s] = (
                    -0.5 * sign * ((1.0 + slope) * gradients[tie, a, s] + (1.0 - slope) * gradients[tie + 1, a, s])
                )
    for f in range(first_tie):
        _chain(kernel, work, f, len(kinks))


@compiled
def _chain(kernel, work, f, count):
    """Add the chain rule's terms of the first ``count`` slacks to ∂f/∂u."""
    gradients, by_u = work.gradients, work.slack_gradients
    for j in range(count):
        column = kernel.kinks[j, 1]
        for a in range(by_u.shape[1]):
            for s in range(by_u.shape[2]):
                gradients[f, a, s] += gradients[f, column, s] * by_u[j, a, s]


@compiled
def tie_multipliers(kernel, work, weights):
    """Write the multipliers of ties, and the weights of the kinks' second derivatives."""
    inputs, gradients, kinks, by_row = work.inputs, work.gradients, kernel.kinks, work.by_row
    variables, samples = work.gradient_u.shape
    sums, rows, first = len(work.objective_gradients), len(kernel.row_peaks), kernel.multipliers[1]
    for j in range(len(kinks) - 1, -1, -1):  # outermost first
        column, sign, tie = kinks[j, 1], kinks[j, 2], kinks[j, 3]
        for s in range(samples):
            weight = 0.0
            for k in range(sums):
                weight += inputs[first + k, s] * gradients[k, column, s]
            for g in range(rows):
                weight += by_row[variables + g, s] * gradients[sums + g, column, s]
            for i in range(j + 1, len(kinks)):
                outer = kinks[i, 3]
                for f in range(outer, outer + 2):
                    weight += inputs[first + f, s] * gradients[f, column, s]
            slope = work.slopes_at[j, s]
            inputs[first + tie, s] = -0.5 * sign * weight * (1.0 + slope)
            inputs[first + tie + 1, s] = -0.5 * sign * weight * (1.0 - slope)
            work.slack_weights[j, s] = sign * weight * work.bends[j, s]


@compiled
def add_kink_hessian(kernel, work, s, row, phi):
    """Add the second derivatives by v, and those of kinks, to instant s's Hessian (U, U)."""
    second_i, second_j, kinks, gradients = kernel.second_i, kernel.second_j, kernel.kinks, work.gradients
    variables = len(phi)
    other = np.empty(variables)
    for e in range(len(second_i)):
        if second_i[e] >= variables or second_j[e] >= variables:
            value = work.seconds[e, s]
            if value != 0.0:
                _variable_gradient(kernel, work, second_i[e], s, row)
                _variable_gradient(kernel, work, second_j[e], s, other)
                _add_outer(phi, value if second_i[e] != second_j[e] else 0.5 * value, row, other)
    for j in range(len(kinks)):
        tie = kinks[j, 3]
        for a in range(variables):
            row[a] = 0.5 * (gradients[tie + 1, a, s] - gradients[tie, a, s])
        _add_outer(phi, 0.5 * work.slack_weights[j, s], row, row)


@compiled
def _variable_gradient(kernel, work, variable, s, row):
    """Write the gradient by u of a variable or slack at instant s."""
    for a in range(len(row)):
        row[a] = 1.0 if a == variable else 0.0
    for j in range(len(kernel.kinks)):
        if kernel.kinks[j, 1] == variable:
            for a in range(len(row)):
                row[a] = work.slack_gradients[j, a, s]


@compiled
def _add_outer(phi, factor, row, other):
    """Add factor · (row otherᵀ + other rowᵀ)."""
    for a in range(len(row)):
        for b in range(len(row)):
            phi[a, b] += factor * (row[a] * other[b] + other[a] * row[b])


# Peaks of a motion: epigraph variables σ on the border of Newton's matrix; compiled
#
# A peak is the least σ with σ − piece ≥ 0 for every piece at every instant. The rows σ − piece are ordinary limited
# rows; in a point σ comes after the samples.


@compiled
def copy_peaks(kernel, work, x):
    """Copy the epigraph variables σ of a point into the functions' inputs."""
    samples, n = sample_count(kernel), x.shape[1]
    for k in range(len(kernel.peak_inputs)):
        work.inputs[kernel.peak_inputs[k]] = x[samples + k // n, k % n]


@compiled
def assemble_peaks(kernel, work, A, B, C):
    """Write the border's rows for σ, from stiffnesses in ``by_row``."""
    variables, samples = work.gradient_u.shape
    sums, size = len(work.objective_gradients), A.shape[0]
    for k in range(len(kernel.peak_inputs)):
        total, row = 0.0, kernel.stencil.border + k
        clear(work.gradient_u)
        for g in range(len(kernel.row_peaks)):
            if kernel.row_peaks[g] == k:
                for s in range(samples):
                    total += work.by_row[variables + g, s]
                for a in range(variables):
                    for s in range(samples):
                        work.gradient_u[a, s] += work.by_row[variables + g, s] * work.gradients[sums + g, a, s]
        C[row, row] = total
        clear(work.gradient_q)
        _add_by_positions(kernel, work, work.gradient_u, kernel.ones, work.gradient_q)
        project_gradient(kernel.stencil, work.gradient_q, work.tangent, work.projected)
        B[row] = work.projected[:size]
        for i in range(kernel.stencil.border):
            C[row, i] = C[i, row] = work.projected[size + i]


# The kernel of motions; compiled
#
# Row i of the limits is factors[i] · (value − bounds[i]) ≥ 0. Its value is that of row ``limited``[i, 0] at instant
# ``limited``[i, 1]; rows are the variables u at an instant, then the limited functions.


@implement(steps.dimensions, MotionKernel)
def dimensions(kernel, x):
    """Return the Newton matrix's (size, band, border), and the number of limits."""
    stencil, rows = kernel.stencil, len(kernel.curve.row_scales)
    band, peaks = stencil.coefficients.shape[2] * (x.shape[1] - rows), len(kernel.peak_inputs)
    return stencil.unknowns - stencil.border, band, stencil.border + peaks, len(kernel.factors)


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
    """Return a motion with the least σ of each peak, and measure kinks."""
    samples, n = x.shape
    point = np.zeros((samples + (len(kernel.peak_inputs) + n - 1) // n, n))
    point[:samples] = x / kernel.scales
    _write_states(kernel, work, point)
    copy_peaks(kernel, work, point)
    evaluate_functions(kernel, work)
    measure_kinks(kernel, work)
    sums = len(work.objective_gradients)  # functions were evaluated at σ = 0: the least σ is the largest piece
    for k in range(len(kernel.peak_inputs)):
        largest = -np.inf
        for g in range(len(kernel.row_peaks)):
            if kernel.row_peaks[g] == k:
                for s in range(len(kernel.ones)):
                    largest = max(largest, -work.values[sums + g, s])
        point[samples + k // n, k % n] = largest
    return point


@compiled
def _write_states(kernel, work, x):
    """Write the variables u of all instants at a point."""
    u, n = work.inputs[: len(work.gradient_spline)], len(kernel.scales)
    apply_stencil(kernel.stencil, x, u)
    if kernel.kinked:
        work.inputs[4 * n : 4 * n + len(u)] = u
    curve_states.project_instants(kernel.curve, work.curve, u)


@compiled
def _add_by_positions(kernel, work, gradient, scale, gradient_q):
    """Add the gradient by q that follows from one by u, times ``scale`` (instants,)."""
    curve_states.chain_gradient(work.curve, gradient[: len(work.gradient_u)], work.gradient_spline)
    add_transposed_stencil(kernel.stencil, work.gradient_spline, scale, gradient_q)


@implement(steps.remove_auxiliary, MotionKernel)
def remove_auxiliary(kernel, x):
    """Return the motion of a point."""
    return x[: sample_count(kernel)] * kernel.scales


@implement(steps.set_smoothing, MotionKernel)
def set_smoothing(kernel, work, mu):
    """Set the width of kinks; return whether there are any."""
    for j in range(len(kernel.kinks)):
        work.widths[j, 1] = work.widths[j, 0] * max(kernel.smoothing * mu, kernel.least_smoothing)
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
    evaluate_functions(kernel, work)
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
    """Prepare the tangent and gradients at x; return False at a singularity."""
    slopes, gradients = work.slopes, work.gradients
    slope_of, slope_by = kernel.slope_of, kernel.slope_by
    _write_states(kernel, work, x)
    if len(kernel.kinks):
        copy_peaks(kernel, work, x)
        evaluate_functions(kernel, work)
        linearise_kinks(kernel, work)
    samples, n = work.path_inputs.shape[1], x.shape[1]
    work.path_inputs[:n] = x[:samples].T
    run(kernel.track, work.path_inputs, work.tracked)
    curve_states.linearise_instants(kernel.curve, work.curve)
    if not tangent_frames(work.tracked, work.tangent, work.normal, work.triangle):
        return False
    if kernel.stops:
        tie_last_sample(work.tangent, work.normal)
    run(kernel.slope, work.inputs, work.slopes)
    functions = len(gradients)
    for f in range(functions if len(kernel.kinks) else 0):  # entries that are always 0
        clear(gradients[f])
    for e in range(len(slope_of)):
        gradients[slope_of[e], slope_by[e]] = slopes[functions + e]
    if len(kernel.kinks):
        chain_gradients(kernel, work)
    for k in range(len(work.objective_gradients)):
        gradient = work.objective_gradients[k]
        clear(gradient)
        _add_by_positions(kernel, work, work.gradients[k], kernel.quadrature, gradient)
    return True


@implement(steps.reduced_gradient, MotionKernel)
def reduced_gradient(kernel, work, weights, multipliers, out):
    """Write the Lagrangian's gradient by the unknowns and σ.

    The Lagrangian is weights · F − multipliers · c. The workspace gets its gradients by u and q, and the multipliers of
    variables and rows in their own units.
    """
    gradient_u, by_row, gradients = work.gradient_u, work.by_row, work.gradients
    limited, factors, row_peaks = kernel.limited, kernel.factors, kernel.row_peaks
    (variables, instants), sums = gradient_u.shape, len(work.objective_gradients)
    clear(work.gradient_q)
    clear(gradient_u)
    if len(multipliers):
        clear(by_row)
        for i in range(len(factors)):
            by_row[limited[i, 0], limited[i, 1]] -= factors[i] * multipliers[i]
        for a in range(variables):
            gradient_u[a] = by_row[a]
            for g in range(len(row_peaks)):
                for s in range(instants):
                    gradient_u[a, s] += by_row[variables + g, s] * gradients[sums + g, a, s]
        _add_by_positions(kernel, work, work.gradient_u, kernel.ones, work.gradient_q)
    for total in range(len(weights)):
        if weights[total] != 0.0 and kernel.totals[total] >= 0:
            add_scaled(work.gradient_q, weights[total], work.objective_gradients[kernel.totals[total]])
    project_gradient(kernel.stencil, work.gradient_q, work.tangent, out)
    for total in range(len(weights)):
        if kernel.totals[total] < 0:
            out[kernel.stencil.unknowns - 1 - kernel.totals[total]] += weights[total]
    for g in range(len(row_peaks) if len(multipliers) else 0):
        if row_peaks[g] >= 0:
            for s in range(instants):
                out[kernel.stencil.unknowns + row_peaks[g]] += by_row[variables + g, s]


@implement(steps.prepare_multipliers, MotionKernel)
def prepare_multipliers(kernel, work, weights):
    """Write multipliers (of path equations, sums, rows) as the Lagrangian Hessian's inputs."""
    first, variables, samples = kernel.multipliers, len(work.gradient_u), work.gradient_u.shape[1]
    inputs, by_row, quadrature = work.inputs, work.by_row, kernel.quadrature
    inputs[first[2] : first[2] + len(by_row) - variables] = by_row[variables:]
    for total in range(len(weights)):
        if kernel.totals[total] >= 0:
            inputs[first[1] + kernel.totals[total]] = weights[total] * quadrature
    if len(kernel.kinks):
        tie_multipliers(kernel, work, weights)
    rows = len(kernel.curve.row_scales)
    nu = work.path_inputs[first[0] : first[0] + rows]
    path_multipliers(work.gradient_q, work.normal, work.triangle, nu)
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
    """Return the residual's root mean square over time."""
    return np.sqrt(sample_count(kernel)) * norm(residual)


@implement(steps.assemble, MotionKernel)
def assemble(kernel, work, stiffness, A, B, C):
    """Write the Lagrangian's second derivatives plus the stiffness of limits."""
    (variables, samples), sums = work.gradient_u.shape, len(work.objective_gradients)
    states = len(work.gradient_spline)
    behind = 2 * states if kernel.curve.projects else variables  # the spline's u follow those of the curve
    local = np.zeros((behind, kernel.stencil.coefficients.shape[2] * work.tangent.shape[2]))
    phi, row, half = np.zeros((behind, behind)), np.empty(variables), np.zeros(local.shape)
    run(kernel.curvature, work.inputs, work.seconds)
    run(kernel.track_curvature, work.path_inputs, work.track_seconds)
    add_path_hessian(kernel.stencil, work.track_seconds, work.tangent, A, C)
    by_row, gradients, limited = work.by_row, work.gradients, kernel.limited
    clear(by_row)  # the stiffness of variables and rows, in their own units
    for i in range(len(limited)):
        by_row[limited[i, 0], limited[i, 1]] += stiffness[i] * kernel.factors[i] ** 2
    for s in range(samples):
        clear(phi)
        block = phi[:variables, :variables]  # the Hessian by u
        for e in range(len(kernel.second_i)):
            i, j = kernel.second_i[e], kernel.second_j[e]
            if i < variables and j < variables:
                block[i, j] = block[j, i] = work.seconds[e, s]
        for a in range(variables):
            block[a, a] += by_row[a, s]
        if len(kernel.kinks):
            add_kink_hessian(kernel, work, s, row, block)
        for g in range(len(kernel.row_peaks)):
            row[:] = gradients[sums + g, :variables, s]
            for a in range(variables):
                scaled = by_row[variables + g, s] * row[a]
                if scaled != 0.0:
                    for b in range(variables):
                        block[a, b] += scaled * row[b]
        curve_states.add_twist(work.curve, s, phi[states:, states:])
        add_hessian(kernel.stencil, s, phi, work.tangent, work.curve.chain, local, half, (A, B, C))
    assemble_peaks(kernel, work, A, B, C)
    largest = 0.0
    for i in range(A.shape[0]):
        largest = max(largest, abs(A[i, 0]))
    return largest


@implement(steps.expand_step, MotionKernel)
def expand_step(kernel, work, step, dx):
    """Write the change of q and σ; return q's largest change."""
    samples, n = sample_count(kernel), dx.shape[1]
    for k in range(len(kernel.peak_inputs)):
        dx[samples + k // n, k % n] = step[kernel.stencil.unknowns + k]
    return expand_motion_step(kernel.stencil, step, work.tangent, dx)


@implement(steps.directional_derivatives, MotionKernel)
def directional_derivatives(kernel, work, dx, dF, dc):
    """Write the derivatives of sums and limits along dx."""
    du, by_row, gradients = work.du, work.by_row, work.gradients
    limited, factors = kernel.limited, kernel.factors
    (variables, instants), n, samples = du.shape, dx.shape[1], sample_count(kernel)
    sums = len(work.objective_gradients)
    apply_stencil(kernel.stencil, dx, du)
    curve_states.chain_directions(work.curve, du)
    for total in range(len(dF)):
        k, peak = kernel.totals[total], -1 - kernel.totals[total]
        dF[total] = inner_product(work.objective_gradients[k], dx) if k >= 0 else dx[samples + peak // n, peak % n]
    by_row[:variables] = du
    for g in range(len(kernel.row_peaks)):
        peak = kernel.row_peaks[g]
        by_row[variables + g] = 0.0 if peak < 0 else dx[samples + peak // n, peak % n]
        for a in range(variables):
            for s in range(instants):
                by_row[variables + g, s] += gradients[sums + g, a, s] * du[a, s]
    for i in range(len(factors)):
        dc[i] = factors[i] * by_row[limited[i, 0], limited[i, 1]]


@implement(steps.row_width, MotionKernel)
def row_width(kernel, work):
    """Return the number of unknowns of an instant's neighbours."""
    return kernel.stencil.coefficients.shape[2] * work.tangent.shape[2]


@implement(steps.constraint_rows, MotionKernel)
def constraint_rows(kernel, work, columns, entries):
    """Write the limits' derivatives by the unknowns, for programs without kinks and peaks."""
    variables, instants = work.gradient_u.shape
    limited, gradients, sums = kernel.limited, work.gradients, len(work.objective_gradients)
    r, width = work.tangent.shape[2], entries.shape[1]
    local = np.zeros((instants, variables, width))
    for s in range(instants):
        local_basis(kernel.stencil, s, work.tangent, work.curve.chain, local[s])
    for i in range(len(limited)):
        row, s, factor = limited[i, 0], limited[i, 1], kernel.factors[i]
        for b in range(width):
            first = kernel.stencil.first_unknown[kernel.stencil.neighbours[s, b // r]]
            columns[i, b] = first + b % r if first >= 0 else 0
            entries[i, b] = factor * local[s, row, b] if row < variables and first >= 0 else 0.0
        if row >= variables:
            for a in range(variables):
                scaled = factor * gradients[sums + row - variables, a, s]
                if scaled != 0.0:
                    for b in range(width):
                        if kernel.stencil.first_unknown[kernel.stencil.neighbours[s, b // r]] >= 0:
                            entries[i, b] += scaled * local[s, a, b]


@implement(steps.retract, MotionKernel)
def retract(kernel, work, x, dx, length, trial):
    """Write the retracted motion after a step; return whether this succeeded."""
    samples = sample_count(kernel)
    trial[:] = x + length * dx
    if kernel.stops:
        trial[samples - 1] = trial[samples - 2]
    return retract_motion(kernel.track, work.path_inputs, trial, work.normal, work.triangle, work.tracked)
