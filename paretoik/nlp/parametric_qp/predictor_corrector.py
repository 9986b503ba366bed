"""The optimum of a goal from a similar goal's optimum, predicted or corrected; compiled.

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper

A step is the optimum of quadratic models of all objectives, each with its own Hessian, and linear models of the limits.
A prediction takes derivatives only at its first point. The models' errors at the predicted point are added to them, and
they are solved again, so that errors of objectives fall from the third to the fourth power of the step (second-order
correction: Nocedal & Wright 2006, section 18.3). A correction takes derivatives at every point, but after its first
step only the Hessian of the Lagrangian.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.array_tuples import keep, refer
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.banded.kernel import (
    add_auxiliary,
    allocate_workspace,
    evaluate,
    expand_step,
    reduced_gradient,
    remove_auxiliary,
    residual_norm,
    retract,
)
from paretoik.nlp.linear_algebra import norm
from paretoik.nlp.parametric_qp.homotopy import QpOptions
from paretoik.nlp.parametric_qp.local_model import (
    allocate_model,
    lagrangian_hessian,
    lead_to_optimum,
    limit_change,
    move_objectives,
    objective_hessians,
    to_first_order,
    weigh,
)


class StepOptions(NamedTuple):
    """Settings of predictions and corrections; see ``pareto.continuation.ContinuationOptions``."""

    residual: float
    violation: float
    corrections: int
    contraction: float
    predictions: int
    predicted: float
    updates: int
    missed: float
    qp: QpOptions


@compiled(what="the continuation of optima", seconds=25)
def move_optimum(kernel, x, multipliers, weights, rows, upper, options, predicts):
    """Return a goal's optimum, predicted from another goal's optimum or corrected from a guess.

    The result is (point, multipliers, corrections, whether it was found). Multipliers are those of c, then of
    rows · F ≤ upper. One function does both, because most of the compile time is that of the kernel's steps.
    """
    problem = refer(kernel)
    arrays = allocate_workspace(problem, x)
    work = refer(arrays)
    point = add_auxiliary(problem, work, x)
    models = allocate_model(problem, work, x, len(weights))
    model = refer(models)
    trial, corrections = point.copy(), 0
    if predicts:
        y, found = _predict(problem, work, model, point, trial, multipliers, weights, rows, upper, options)
        point = trial
    else:
        y, corrections, found = _correct(problem, work, model, point, trial, multipliers, weights, rows, upper, options)
    keep(arrays)
    keep(models)
    return remove_auxiliary(problem, point), y, corrections, found


@compiled
def _correct(problem, work, model, point, trial, multipliers, weights, rows, upper, options):
    """Move a guess to the optimum, in place; return (multipliers, corrections, whether it was found)."""
    dx, factors, y = np.zeros(point.shape), np.zeros(len(weights)), multipliers.copy()
    corrections, last_length, converged = 0, np.inf, False
    for corrections in range(options.corrections + 1 if to_first_order(problem, work, point, model) else 0):
        weigh(weights, rows, y, factors)
        lagrangian_hessian(problem, work, factors, y[: len(model.c)], model, 0)
        predictions = options.predictions if corrections == 0 else 1
        if predictions > 1:
            objective_hessians(problem, work, model)
        step = np.zeros(model.gradients.shape[1])
        y, solved = lead_to_optimum(model, factors, step, y, weights, rows, upper, predictions, options)
        step_length = 0.0
        for value in step:
            step_length = max(step_length, abs(value))
        if not solved or not step_length <= options.contraction * last_length:
            break
        last_length = step_length
        far = not expand_step(problem, work, step, dx) <= problem.longest_step
        if far or not retract(problem, work, point, dx, 1.0, trial):
            break
        flat, other = trial.ravel(), point.reshape(-1)
        for i in range(len(flat)):
            other[i] = flat[i]
        if not to_first_order(problem, work, point, model):
            break
        if _is_optimal(problem, work, model, y, weights, rows, upper, factors, options):
            converged = True
            break
    return y, corrections, converged


@compiled
def _is_optimal(kernel, work, model, y, weights, rows, upper, factors, options):
    """Return whether stationarity, complementarity and constraints are satisfied."""
    limits, total, worst = len(model.c), 0.0, 0.0
    weigh(weights, rows, y, factors)
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


@compiled
def _predict(problem, work, model, point, trial, multipliers, weights, rows, upper, options):
    """Write the optimum predicted by models at the point into ``trial``; return (multipliers, whether it exists)."""
    dx, factors, y = np.zeros(point.shape), np.zeros(len(weights)), multipliers
    exists = to_first_order(problem, work, point, model)
    if exists:
        weigh(weights, rows, y, factors)
        lagrangian_hessian(problem, work, factors, y[: len(model.c)], model, 0)
        objective_hessians(problem, work, model)
    excess = _largest_excess(model.objectives, rows, upper)
    objectives, c, moved_upper = np.zeros(len(weights)), np.zeros(len(model.c)), upper.copy()
    step = np.zeros(model.gradients.shape[1])
    for _ in range(options.updates + 1 if exists else 0):
        y, solved = lead_to_optimum(model, factors, step, y, weights, rows, moved_upper, options.predictions, options)
        far = not expand_step(problem, work, step, dx) <= problem.longest_step
        if not solved or far or not retract(problem, work, point, dx, 1.0, trial):
            exists = False
            break
        evaluate(problem, work, trial, objectives, c)
        # shift the models to the values at a step: c ← c(trial) − ∂c d, upper ← upper − rows · (F(trial) − F(d))
        predicted, gradients = model.objectives.copy(), model.gradients.copy()
        move_objectives(model, step, gradients, predicted)
        for e in range(len(rows)):
            moved_upper[e] = upper[e]
            for k in range(len(objectives)):
                moved_upper[e] -= rows[e, k] * (objectives[k] - predicted[k])
        for i in range(len(c)):
            model.c[i] = c[i] - limit_change(model, i, step)
    # the allowed excess over a bound is a share of the first excess, over a limit a share of its largest change
    if exists:
        exists = not _largest_excess(objectives, rows, upper) > options.missed * excess + options.violation
        for i in range(len(c)):
            exists &= not -c[i] - options.missed * norm(step) * norm(model.entries[i]) > options.violation
    return y, exists


@compiled
def _largest_excess(objectives, rows, upper):
    """Return the largest excess of objectives over their bounds, at least 0."""
    largest = 0.0
    for e in range(len(rows)):
        excess = -upper[e]
        for k in range(len(objectives)):
            excess += rows[e, k] * objectives[k]
        largest = max(largest, excess)
    return largest
