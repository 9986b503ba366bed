"""The optimum of a goal predicted from that of another one: derivatives are taken there alone; compiled.

By the quadratic models of all objectives, each with its own Hessian, and the linear ones of the limits. What they miss
of the values at the point that they predict is added to them, and they are solved anew: so objectives err by the fourth
power of the step, where the models alone err by the third. Source: Nocedal & Wright 2006, section 18.3, second-order
correction.
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
from paretoik.nlp.parametric_qp.solution import QpOptions


class PredictionOptions(NamedTuple):
    """How an optimum is predicted; see ``pareto.continuation.ContinuationOptions``."""

    predictions: int
    predicted: float
    updates: int
    missed: float
    violation: float
    qp: QpOptions


@compiled(what="the prediction of optima", seconds=20)
def predict(kernel, x, multipliers, weights, rows, upper, options):
    """Return (point, multipliers, whether there is one): the optimum of a goal by the models at that of another one.

    Arguments are those of ``correct``. Values are taken at what is predicted, derivatives at x alone.
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
    """Return the point that is predicted, the multipliers there, and whether there is such a point."""
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
        _update_values(model, step, objectives, c, rows, upper, moved_upper)
    exceeded = _bounds_missed(objectives, rows, upper) > options.missed * wish + options.violation
    return trial, y, not exceeded and not _limits_missed(model, c, step, options)


@compiled
def _update_values(model, step, objectives, c, rows, upper, moved_upper):
    """Give the models at a step the values there: those of limits in place, those of objectives in their bounds."""
    predicted, gradients = model.objectives.copy(), model.gradients.copy()
    move_objectives(model, step, gradients, predicted)
    for e in range(len(rows)):
        moved_upper[e] = upper[e]
        for k in range(len(objectives)):
            moved_upper[e] -= rows[e, k] * (objectives[k] - predicted[k])
    for i in range(len(c)):
        model.c[i] = c[i] - limit_change(model, i, step)


@compiled
def _bounds_missed(objectives, rows, upper):
    """Return by how much objectives exceed their bounds at most; 0 where they do not."""
    largest = 0.0
    for e in range(len(rows)):
        excess = -upper[e]
        for k in range(len(objectives)):
            excess += rows[e, k] * objectives[k]
        largest = max(largest, excess)
    return largest


@compiled
def _limits_missed(model, c, step, options):
    """Return whether a limit is exceeded by more than a share of what so long a step could change it by."""
    worst, length = 0.0, norm(step)
    for i in range(len(c)):
        worst = max(worst, -c[i] - options.missed * length * norm(model.entries[i]))
    return worst > options.violation
