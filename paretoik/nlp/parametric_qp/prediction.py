"""The optimum of a goal, predicted from another goal's optimum; compiled.

The prediction uses derivatives at that optimum.

    minimise    weights · F(d)                                 F(d): quadratic models, each with its own Hessian
    subject to  c(d) ≥ 0,  rows · F(d) ≤ upper                 c(d): linear models of the limits

The errors of the models' values at the predicted point are added to the models, which are then solved again: errors of
objectives fall from the third to the fourth power of the step. Source: Nocedal & Wright 2006, section 18.3,
second-order correction.
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
    remove_auxiliary,
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


class PredictionOptions(NamedTuple):
    """Settings of predictions; see ``pareto.continuation.ContinuationOptions``."""

    predictions: int
    predicted: float
    updates: int
    missed: float
    violation: float
    qp: QpOptions


@compiled(what="the prediction of optima", seconds=20)
def predict(kernel, x, multipliers, weights, rows, upper, options):
    """Return a goal's optimum, predicted by models at another's optimum.

    The result is (point, multipliers, whether it exists). Arguments are those of ``correct``. Values are taken at
    predicted points, derivatives only at x.
    """
    problem = refer(kernel)
    work = allocate_workspace(problem, x)
    point = add_auxiliary(problem, refer(work), x)
    model = allocate_model(problem, refer(work), x, len(weights))
    trial, y, exists = _predict(problem, refer(work), refer(model), point, multipliers, weights, rows, upper, options)
    keep(work)
    keep(model)
    return remove_auxiliary(problem, trial), y, exists


@compiled
def _predict(kernel, work, model, x, y, weights, rows, upper, options):
    """Return the predicted point, its multipliers, and whether it exists."""
    trial, dx, factors = x.copy(), np.zeros(x.shape), np.zeros(len(weights))
    if not to_first_order(kernel, work, x, model):
        return x, y, False
    weigh(weights, rows, y, factors)
    lagrangian_hessian(kernel, work, factors, y[: len(model.c)], model)
    objective_hessians(kernel, work, model)
    wish = _bounds_missed(model.objectives, rows, upper)
    objectives, c, moved_upper = np.zeros(len(weights)), np.zeros(len(model.c)), upper.copy()
    step = np.zeros(model.gradients.shape[1])
    for _ in range(options.updates + 1):
        y, solved, _ = lead_to_optimum(
            model, factors, step, y, weights, rows, moved_upper, options.predictions, options
        )
        far = not expand_step(kernel, work, step, dx) <= kernel.longest_step
        if not solved or far or not retract(kernel, work, x, dx, 1.0, trial):
            return x, y, False
        evaluate(kernel, work, trial, objectives, c)
        # shift the models to the values at a step: limits in place, objectives in their bounds
        predicted, gradients = model.objectives.copy(), model.gradients.copy()
        move_objectives(model, step, gradients, predicted)
        for e in range(len(rows)):
            moved_upper[e] = upper[e]
            for k in range(len(objectives)):
                moved_upper[e] -= rows[e, k] * (objectives[k] - predicted[k])
        for i in range(len(c)):
            model.c[i] = c[i] - limit_change(model, i, step)
    exceeded = _bounds_missed(objectives, rows, upper) > options.missed * wish + options.violation
    return trial, y, not exceeded and not _limits_missed(model, c, step, options)


@compiled
def _bounds_missed(objectives, rows, upper):
    """Return the largest excess of objectives over their bounds, at least 0."""
    largest = 0.0
    for e in range(len(rows)):
        excess = -upper[e]
        for k in range(len(objectives)):
            excess += rows[e, k] * objectives[k]
        largest = max(largest, excess)
    return largest


@compiled
def _limits_missed(model, c, step, options):
    """Return whether a limit is exceeded by too much.

    The allowed excess is a share of the limit's largest change.
    """
    worst, length = 0.0, norm(step)
    for i in range(len(c)):
        worst = max(worst, -c[i] - options.missed * length * norm(model.entries[i]))
    return worst > options.violation
