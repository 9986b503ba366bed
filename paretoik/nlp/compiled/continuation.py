"""The optimum of a goal near that of another one: predicted to third order, then corrected; compiled.

Predicted by the quadratic models of all objectives, each with its own Hessian, and the linear ones of the limits: their
optimum by Newton's method, each step of which is a parametric quadratic program. Corrected by one such program with the
Hessian of the Lagrangian a time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation import compiled
from paretoik.compilation_references import keep, refer
from paretoik.nlp.compiled.array_loops import norm
from paretoik.nlp.compiled.kernel_steps import (
    add_auxiliary,
    allocate_workspace,
    expand_step,
    reduced_gradient,
    remove_auxiliary,
    residual_norm,
    retract,
)
from paretoik.nlp.compiled.local_model import (
    add_product,
    allocate_model,
    lagrangian_hessian,
    objective_hessians,
    to_first_order,
)
from paretoik.nlp.compiled.parametric_qp import QpOptions, solve_from


class CorrectionOptions(NamedTuple):
    """What counts as an optimum, and how it is sought; see ``pareto.continuation.ContinuationOptions``."""

    residual: float
    violation: float
    corrections: int
    contraction: float
    predictions: int
    predicted: float
    qp: QpOptions


@compiled(what="the continuation of optima", seconds=15)
def correct(kernel, x, multipliers, weights, rows, upper, options):
    """Return (point, multipliers, F, corrections, changes, whether the optimum was found) of a goal near a guess.

    The goal is to minimise weights · F where rows · F ≤ upper; multipliers are those of c, then of these bounds.
    """
    problem = refer(kernel)
    work = allocate_workspace(problem, x)
    point = add_auxiliary(problem, refer(work), x)
    model = allocate_model(problem, refer(work), x, len(weights))
    y, corrections, changes, converged = _correct(
        problem, refer(work), refer(model), point, multipliers.copy(), weights, rows, upper, options
    )
    keep(work)
    return remove_auxiliary(problem, point), y, model.objectives, corrections, changes, converged


@compiled
def _correct(kernel, work, model, x, y, weights, rows, upper, options):
    """Correct x in place; return the multipliers, corrections, changes, and whether the optimum was found."""
    trial, dx, factors, changes, last_length = x.copy(), np.zeros(x.shape), np.zeros(len(weights)), 0, np.inf
    if not to_first_order(kernel, work, x, model):
        return y, 0, changes, False
    for corrections in range(options.corrections + 1):
        _weigh(weights, rows, y, factors)
        lagrangian_hessian(kernel, work, factors, y[: len(model.c)], model)
        predictions = options.predictions if corrections == 0 else 1
        if predictions > 1:
            objective_hessians(kernel, work, model)
        step, y, solved, changed = _step(model, y, weights, rows, upper, predictions, options)
        changes += changed
        step_length = _largest(step)
        if not solved or not step_length <= options.contraction * last_length:
            return y, corrections, changes, False
        last_length = step_length
        far = not expand_step(kernel, work, step, dx) <= kernel.longest_step
        if far or not retract(kernel, work, x, dx, 1.0, trial):
            return y, corrections, changes, False
        _copy(trial, x)
        if not to_first_order(kernel, work, x, model):
            return y, corrections, changes, False
        if _is_optimal(kernel, work, model, y, weights, rows, upper, factors, options):
            return y, corrections, changes, True
    return y, options.corrections, changes, False


@compiled
def _copy(source, target):
    flat, other = source.ravel(), target.reshape(-1)
    for i in range(len(flat)):
        other[i] = flat[i]


@compiled
def _largest(step):
    largest = 0.0
    for value in step:
        largest = max(largest, abs(value))
    return largest


@compiled
def _weigh(weights, rows, y, factors):
    """Write weights + rowsᵀ y: what the Lagrangian multiplies the objectives with."""
    limits = len(y) - len(rows)
    for k in range(len(weights)):
        factors[k] = weights[k]
        for e in range(len(rows)):
            factors[k] += rows[e, k] * y[limits + e]


@compiled
def _step(model, y, weights, rows, upper, predictions, options):
    """Return the step to the optimum of the model, its multipliers, whether there is one, and changes.

    The first of so many ``predictions``, steps of Newton's method, is by the Hessian of the Lagrangian alone.
    """
    n, limits = model.gradients.shape[1], len(model.c)
    step, changes, last_multipliers = np.zeros(n), 0, y.copy()
    gradients, values, gradient = model.gradients.copy(), np.zeros(limits + len(rows)), np.zeros(n)
    A, B, C = model.A[0].copy(), model.B[0].copy(), model.C[0].copy()
    weighed, initial = np.zeros(len(weights)), np.zeros(len(weights))
    _weigh(weights, rows, y, initial)
    dense = np.zeros((len(rows), n))
    for attempt in range(predictions):
        _move_model(model, step, weights, rows, upper, initial, gradients, values, gradient)
        for e in range(len(rows)):
            for j in range(n):
                dense[e, j] = 0.0
                for k in range(len(weights)):
                    dense[e, j] -= rows[e, k] * gradients[k, j]
        increment, y, share, changed = solve_from(
            A, B, C, gradient, model.columns, model.entries, dense, values, y, options.qp
        )
        changes += changed
        if share < 1.0:
            return step, (last_multipliers if attempt else y), attempt > 0, changes
        for j in range(n):
            step[j] += increment[j]
        last_multipliers = y
        if attempt + 1 == predictions or norm(increment) <= options.predicted * norm(step):
            break
        _weigh(weights, rows, y, weighed)
        for i in range(A.shape[0]):
            for d in range(A.shape[1]):
                A[i, d] = _entry(model.A[:, i, d], weighed, initial)
        for e in range(C.shape[0]):
            for i in range(A.shape[0]):
                B[e, i] = _entry(model.B[:, e, i], weighed, initial)
            for f in range(C.shape[0]):
                C[e, f] = _entry(model.C[:, e, f], weighed, initial)
    return step, y, True, changes


@compiled
def _entry(entries, weighed, initial):
    """Return an entry of the Lagrangian's Hessian where its weights have changed."""
    total = entries[0]
    for k in range(len(weighed)):
        total += (weighed[k] - initial[k]) * entries[1 + k]
    return total


@compiled
def _move_model(model, step, weights, rows, upper, initial, gradients, values, gradient):
    """Write gradients of objectives, the gradient of the goal, limits and bounds of the model at a step.

    The curvature of limits, that of the Lagrangian beyond the objectives', is in the gradient of the goal.
    """
    n, limits = len(step), len(model.c)
    objectives, moved = model.objectives.copy(), norm(step) > 0.0
    for j in range(n):
        gradient[j] = 0.0
    for k in range(len(weights)):
        for j in range(n):
            gradients[k, j] = model.gradients[k, j]
        if moved:
            add_product(model, 1 + k, 1.0, step, gradients[k])
            for j in range(n):
                objectives[k] += 0.5 * (model.gradients[k, j] + gradients[k, j]) * step[j]
            add_product(model, 1 + k, -initial[k], step, gradient)
        for j in range(n):
            gradient[j] += weights[k] * gradients[k, j]
    if moved:
        add_product(model, 0, 1.0, step, gradient)
    for i in range(limits):
        values[i] = model.c[i]
        for b in range(model.entries.shape[1]):
            values[i] += model.entries[i, b] * step[model.columns[i, b]]
    for e in range(len(rows)):
        values[limits + e] = upper[e]
        for k in range(len(weights)):
            values[limits + e] -= rows[e, k] * objectives[k]


@compiled
def _is_optimal(kernel, work, model, y, weights, rows, upper, factors, options):
    """Return whether stationarity, complementarity and constraints hold."""
    limits, total, worst = len(model.c), 0.0, 0.0
    _weigh(weights, rows, y, factors)
    for k in range(len(factors)):
        total += abs(factors[k])
    reduced_gradient(kernel, work, factors, y[:limits], model.reduced)
    if not residual_norm(kernel, model.reduced) <= options.residual * max(1.0, total):
        return False
    for i in range(len(y)):
        value = model.c[i] if i < limits else upper[i - limits]
        for k in range(len(weights) if i >= limits else 0):
            value -= rows[i - limits, k] * model.objectives[k]
        worst = max(worst, -value, abs(value) if y[i] > 0.0 else 0.0)
    return worst <= options.violation
