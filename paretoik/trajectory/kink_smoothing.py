"""Kinks of a motion's functions, smoothed according to the barrier, compiled.

A slack v is max(a, b), or min(a, b) with sign −1; its ties are v − a and v − b, times the sign. It is eliminated by
v = (a + b)/2 ± √(E² + ν²) with E = (a − b)/2, and its width ν decreases with the barrier. So every function of v is a
smooth function of u and still banded in time. The derivative λ = E / √(E² + ν²) solves λ √(E² + ν²) = E. Newton's
method iterates E and λ together: its Hessian has (1 − λ λ̂) / √(E² + ν²) instead of the second derivative
(1 − λ²) / √(E² + ν²), and λ̂ is the λ predicted in the last step. With λ² steps would be very small if ν is small. If
λ̂ moves to its bounds slowly, a kink stays stiff after it is crossed, so that steps do not oscillate; with λ̂ = 0 the
iteration is lagged diffusivity, which never oscillates. Source: Chan, Golub & Mulet 1999, section 4; Vogel & Oman
1996 for lagged diffusivity.

With weight w in the objective and a barrier μ on each tie, a slack would be 2 μ / w above a kink of size 0. The sizes
of all kinks add up to the size of the objective, 1. Therefore the width of each, in its own size, is μ times the number
of kinks.
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation.numba_cache import compiled


@compiled
def evaluate_functions(kernel, work):
    """Write the functions of all samples, with smoothed slacks v."""
    inputs, values, kinks, arguments = work.inputs, work.values, kernel.kinks, work.arguments
    for j in range(len(kinks)):
        for s in range(values.shape[1]):
            inputs[kinks[j, 0], s] = 0.0
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
    """Write the size of each kink's argument from evaluated functions.

    The size is the mean over time.
    """
    samples, largest = work.arguments.shape[1], 0.0
    for j in range(len(kernel.kinks)):
        work.widths[j, 0] = 0.0
        for s in range(samples):
            work.widths[j, 0] += abs(work.arguments[j, s]) / samples
        largest = max(largest, work.widths[j, 0])
    for j in range(len(kernel.kinks)):
        work.widths[j, 0] = max(work.widths[j, 0], 1e-3 * largest, 1e-300)


@compiled
def set_widths(kernel, work, mu):
    """Write the widths ν for a barrier."""
    for j in range(len(kernel.kinks)):
        work.widths[j, 1] = work.widths[j, 0] * max(kernel.smoothing * mu, kernel.least_smoothing)


@compiled
def linearise_kinks(kernel, work):
    """Write slopes and second derivatives of all kinks, and predicted duals.

    They are taken at the arguments of the kinks. A dual moves at most a share of the way to its bounds ±1, so that a
    crossed kink stays stiff for some steps.
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
    """Add the part by v to all gradients by u."""
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
    """Write the multipliers of ties and the kinks' second-derivative weights.

    The multipliers are inputs of the Lagrangian's Hessian.
    """
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
    """Add derivatives by v to sample s's Hessian by u.

    They are the entries by v and the second derivatives of kinks; the Hessian is (U, U).
    """
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
    """Write the gradient by u of a variable of sample s.

    The variable is one of u, or a slack.
    """
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
