"""The optimum of a goal from a similar goal's optimum; compiled.

It is predicted, then corrected.

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper

The prediction is the optimum of quadratic models of all objectives, each with its own Hessian, and linear models of the
limits. Newton's method finds it to third order; each of its steps is a parametric quadratic program. Each correction is
one such program with the Hessian of the Lagrangian.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.array_tuples import keep, refer
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.banded.kernel import (
    add_auxiliary,
    allocate_workspace,
    expand_step,
    reduced_gradient,
    remove_auxiliary,
    residual_norm,
    retract,
)
from paretoik.nlp.parametric_qp.homotopy import QpOptions
from paretoik.nlp.parametric_qp.local_model import (
    allocate_model,
    lagrangian_hessian,
    lead_to_optimum,
    objective_hessians,
    to_first_order,
    weigh,
)


class CorrectionOptions(NamedTuple):
    """Tolerances and steps of corrections; see ``pareto.continuation.ContinuationOptions``."""

    residual: float
    violation: float
    corrections: int
    contraction: float
    predictions: int
    predicted: float
    qp: QpOptions


@compiled(what="the continuation of optima", seconds=20)
def correct(kernel, x, multipliers, weights, rows, upper, options):
    """Return the optimum of a goal near a guess.

    The result is (point, multipliers, F, corrections, changes, whether it was found).

    The goal: minimise weights · F subject to rows · F ≤ upper. Multipliers are those of c, then of these bounds.
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
    """Correct x in place.

    Returns multipliers, corrections, changes and whether the optimum was found.
    """
    trial, dx, factors, changes, last_length = x.copy(), np.zeros(x.shape), np.zeros(len(weights)), 0, np.inf
    if not to_first_order(kernel, work, x, model):
        return y, 0, changes, False
    for corrections in range(options.corrections + 1):
        weigh(weights, rows, y, factors)
        lagrangian_hessian(kernel, work, factors, y[: len(model.c)], model)
        predictions = options.predictions if corrections == 0 else 1
        if predictions > 1:
            objective_hessians(kernel, work, model)
        step = np.zeros(model.gradients.shape[1])
        y, solved, changed = lead_to_optimum(model, factors, step, y, weights, rows, upper, predictions, options)
        changes += changed
        step_length = 0.0
        for value in step:
            step_length = max(step_length, abs(value))
        if not solved or not step_length <= options.contraction * last_length:
            return y, corrections, changes, False
        last_length = step_length
        far = not expand_step(kernel, work, step, dx) <= kernel.longest_step
        if far or not retract(kernel, work, x, dx, 1.0, trial):
            return y, corrections, changes, False
        flat, other = trial.ravel(), x.reshape(-1)
        for i in range(len(flat)):
            other[i] = flat[i]
        if not to_first_order(kernel, work, x, model):
            return y, corrections, changes, False
        if _is_optimal(kernel, work, model, y, weights, rows, upper, factors, options):
            return y, corrections, changes, True
    return y, options.corrections, changes, False


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
