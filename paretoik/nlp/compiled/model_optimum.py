"""The optimum of the quadratic models of objectives and the linear ones of limits at a point; compiled.

By Newton's method, each step of which is a parametric quadratic program.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled
from paretoik.nlp.compiled.array_loops import norm
from paretoik.nlp.compiled.local_model import add_product
from paretoik.nlp.compiled.parametric_qp import solve_from


@compiled
def lead_to_optimum(model, initial, step, y, weights, rows, upper, predictions, options):
    """Lead a step to the optimum of the model, in place; return its multipliers, whether there is one, and changes.

    The Hessian of the Lagrangian is that of objectives with ``initial`` weights. With them, the first of so many
    ``predictions``, steps of Newton's method, is by it alone.
    """
    n, limits = model.gradients.shape[1], len(model.c)
    changes, last_multipliers = 0, y
    gradients, values, gradient = model.gradients.copy(), np.zeros(limits + len(rows)), np.zeros(n)
    A, B, C = model.A[0].copy(), model.B[0].copy(), model.C[0].copy()
    weighed, dense = initial.copy(), np.zeros((len(rows), n))
    for attempt in range(predictions):
        weigh(weights, rows, y, weighed)
        _weigh_hessian(model, weighed, initial, A, B, C)
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
            return (last_multipliers if attempt else y), attempt > 0, changes
        for j in range(n):
            step[j] += increment[j]
        last_multipliers = y
        if norm(increment) <= options.predicted * norm(step):
            break
    return y, True, changes


@compiled
def weigh(weights, rows, y, factors):
    """Write weights + rowsᵀ y: what the Lagrangian multiplies the objectives with."""
    limits = len(y) - len(rows)
    for k in range(len(weights)):
        factors[k] = weights[k]
        for e in range(len(rows)):
            factors[k] += rows[e, k] * y[limits + e]


@compiled
def _weigh_hessian(model, weighed, initial, A, B, C):
    """Write the Hessian of the Lagrangian with other weights of objectives; nothing where they have not changed."""
    if norm(weighed - initial) == 0.0:
        return
    for i in range(A.shape[0]):
        for d in range(A.shape[1]):
            A[i, d] = _entry(model.A[:, i, d], weighed, initial)
    for e in range(C.shape[0]):
        for i in range(A.shape[0]):
            B[e, i] = _entry(model.B[:, e, i], weighed, initial)
        for f in range(C.shape[0]):
            C[e, f] = _entry(model.C[:, e, f], weighed, initial)


@compiled
def _entry(entries, weighed, initial):
    """Return an entry of the Lagrangian's Hessian with other weights."""
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
    move_objectives(model, step, gradients, objectives)
    for j in range(n):
        gradient[j] = 0.0
    for k in range(len(weights)):
        if moved:
            add_product(model, 1 + k, -initial[k], step, gradient)
        for j in range(n):
            gradient[j] += weights[k] * gradients[k, j]
    if moved:
        add_product(model, 0, 1.0, step, gradient)
    for i in range(limits):
        values[i] = model.c[i] + limit_change(model, i, step)
    for e in range(len(rows)):
        values[limits + e] = upper[e]
        for k in range(len(weights)):
            values[limits + e] -= rows[e, k] * objectives[k]


@compiled
def move_objectives(model, step, gradients, objectives):
    """Write gradients and values of the objectives' models at a step; values are those at 0 before."""
    moved = norm(step) > 0.0
    for k in range(len(objectives)):
        for j in range(len(step)):
            gradients[k, j] = model.gradients[k, j]
        if moved:
            add_product(model, 1 + k, 1.0, step, gradients[k])
            for j in range(len(step)):
                objectives[k] += 0.5 * (model.gradients[k, j] + gradients[k, j]) * step[j]


@compiled
def limit_change(model, i, step):
    """Return ∂c step of a limit."""
    total = 0.0
    for b in range(model.entries.shape[1]):
        total += model.entries[i, b] * step[model.columns[i, b]]
    return total
