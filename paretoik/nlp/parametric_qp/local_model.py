"""A second-order model of a kernel's program, along h(x) = 0; compiled.

    Fₖ(d) ≈ Fₖ + ∂Fₖ d + ½ dᵀ Fₖ'' d for every objective k,  c(d) ≈ c + ∂c d

The second derivatives of an objective include the curvature of h(x) = 0, with the objective's own multipliers. They
are therefore those of F at the retracted point after a step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.array_tuples import keep, refer
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.banded.kernel import (
    add_auxiliary,
    allocate_workspace,
    assemble,
    constraint_rows,
    dimensions,
    evaluate,
    linearise,
    prepare_multipliers,
    reduced_gradient,
    row_width,
)
from paretoik.nlp.linear_algebra import clear, norm
from paretoik.nlp.parametric_qp.homotopy import solve_from


class LocalModel(NamedTuple):
    """The program at a point; in each matrix [[A, Bᵀ], [B, C]], A is banded (``banded.cholesky``)."""

    objectives: np.ndarray  # (objectives,)
    gradients: np.ndarray  # (objectives, unknowns)
    c: np.ndarray  # (inequalities,)
    columns: np.ndarray  # (inequalities, width)
    entries: np.ndarray
    A: np.ndarray  # (1 + objectives, size, band): the Hessian of the Lagrangian, then those of the objectives
    B: np.ndarray
    C: np.ndarray
    stiffness: np.ndarray  # (inequalities,): zeros
    unit: np.ndarray  # (objectives,): zeros, for a moment a 1
    reduced: np.ndarray  # (unknowns,)


@compiled
def allocate_model(kernel, work, x, objectives):
    """Return the arrays of a model."""
    size, band, border, inequalities = dimensions(kernel, x)
    width, n = row_width(kernel, work), size + border
    return LocalModel(
        np.zeros(objectives),
        np.zeros((objectives, n)),
        np.zeros(inequalities),
        np.zeros((inequalities, width), dtype=np.int64),
        np.zeros((inequalities, width)),
        np.zeros((1 + objectives, size, band)),
        np.zeros((1 + objectives, border, size)),
        np.zeros((1 + objectives, border, border)),
        np.zeros(inequalities),
        np.zeros(objectives),
        np.zeros(n),
    )


@compiled
def to_first_order(kernel, work, x, model):
    """Write values and first derivatives at x; return whether they are finite and ∂h has full rank."""
    evaluate(kernel, work, x, model.objectives, model.c)
    if not linearise(kernel, work, x):
        return False
    constraint_rows(kernel, work, model.columns, model.entries)
    total = 0.0
    for k in range(len(model.objectives)):
        model.unit[k] = 1.0
        reduced_gradient(kernel, work, model.unit, model.stiffness[:0], model.reduced)
        model.unit[k] = 0.0
        for j in range(len(model.reduced)):
            model.gradients[k, j] = model.reduced[j]
            total += model.reduced[j]
        total += model.objectives[k]
    for i in range(len(model.c)):
        total += model.c[i]
        for j in range(model.entries.shape[1]):
            total += model.entries[i, j]
    return np.isfinite(total)


@compiled
def lagrangian_hessian(kernel, work, weights, multipliers, model, which):
    """Write the Hessian of weights · F − multipliers · c at the linearised x as the model's matrix ``which``."""
    A, B, C = model.A[which], model.B[which], model.C[which]
    clear(A)
    clear(B)
    clear(C)
    reduced_gradient(kernel, work, weights, multipliers, model.reduced)
    prepare_multipliers(kernel, work, weights)
    assemble(kernel, work, model.stiffness, A, B, C)


@compiled
def objective_hessians(kernel, work, model):
    """Write the Hessian of every objective."""
    for k in range(len(model.objectives)):
        model.unit[k] = 1.0
        lagrangian_hessian(kernel, work, model.unit, model.stiffness, model, 1 + k)
        model.unit[k] = 0.0


@compiled
def add_product(model, which, factor, vector, out):
    """Add factor · matrix · vector to ``out`` for one of the model's matrices."""
    A, B, C = model.A[which], model.B[which], model.C[which]
    (size, band), border = A.shape, len(C)
    for i in range(size):
        total = A[i, 0] * vector[i]
        for d in range(1, min(band, i + 1)):
            total += A[i, d] * vector[i - d]
            out[i - d] += factor * A[i, d] * vector[i]
        out[i] += factor * total
    for e in range(border):
        for i in range(size):
            out[size + e] += factor * B[e, i] * vector[i]
            out[i] += factor * B[e, i] * vector[size + e]
        for f in range(border):
            out[size + e] += factor * C[e, f] * vector[size + f]


@compiled(what="the derivatives of a program", seconds=10)
def first_order(kernel, x, objectives):
    """Return (F, ∂F, c, columns and entries of ∂c, whether they are finite and ∂h has full rank) at x."""
    problem = refer(kernel)
    arrays = allocate_workspace(problem, x)
    work = refer(arrays)
    point = add_auxiliary(problem, work, x)
    model = allocate_model(problem, work, x, objectives)
    regular = to_first_order(problem, work, point, refer(model))
    keep(arrays)
    return model.objectives, model.gradients, model.c, model.columns, model.entries, regular


# The optimum of quadratic models of objectives and linear models of limits; compiled.
#
#     minimise    weights · F(d)                                 F(d), c(d): the models at a point
#     subject to  c(d) ≥ 0,  rows · F(d) ≤ upper
#
# Newton's method: each step p is a parametric quadratic program with the Lagrangian's Hessian H and the models at d:
#
#     minimise    ½ pᵀH p + gᵀp
#     subject to  c(d) + ∂c p ≥ 0,  upper − rows · (F(d) + ∂F p) ≥ 0


@compiled
def lead_to_optimum(model, initial, step, y, weights, rows, upper, predictions, options):
    """Move a step to the optimum of the model, in place; return (multipliers, whether there is one).

    ``model`` has the Hessian of the Lagrangian for ``initial`` weights of the objectives. If the weights stay the same,
    Newton's first step uses only this Hessian. ``predictions`` is the largest number of Newton steps.
    """
    n, limits = model.gradients.shape[1], len(model.c)
    last_multipliers = y
    gradients, values, gradient = model.gradients.copy(), np.zeros(limits + len(rows)), np.zeros(n)
    A, B, C = model.A[0].copy(), model.B[0].copy(), model.C[0].copy()
    weighed, dense = initial.copy(), np.zeros((len(rows), n))
    for attempt in range(predictions):
        weigh(weights, rows, y, weighed)
        # the Lagrangian's Hessian for other weights of objectives, if they have changed
        if norm(weighed - initial) != 0.0:
            for i in range(A.shape[0]):
                for d in range(A.shape[1]):
                    A[i, d] = _entry(model.A[:, i, d], weighed, initial)
            for e in range(C.shape[0]):
                for i in range(A.shape[0]):
                    B[e, i] = _entry(model.B[:, e, i], weighed, initial)
                for f in range(C.shape[0]):
                    C[e, f] = _entry(model.C[:, e, f], weighed, initial)
        # the models' gradients, limits and bounds at a step. The goal's gradient g also has the curvature of limits:
        # the Lagrangian's Hessian less the objectives' Hessians
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
            for j in range(n):
                dense[e, j] = 0.0
                for k in range(len(weights)):
                    dense[e, j] -= rows[e, k] * gradients[k, j]
        increment, y, share, _ = solve_from(
            A, B, C, gradient, model.columns, model.entries, dense, values, y, options.qp
        )
        if share < 1.0:
            return (last_multipliers if attempt else y), attempt > 0
        for j in range(n):
            step[j] += increment[j]
        last_multipliers = y
        if norm(increment) <= options.predicted * norm(step):
            break
    return y, True


@compiled
def weigh(weights, rows, y, factors):
    """Write the Lagrangian's weights of objectives, weights + rowsᵀ y."""
    limits = len(y) - len(rows)
    for k in range(len(weights)):
        factors[k] = weights[k]
        for e in range(len(rows)):
            factors[k] += rows[e, k] * y[limits + e]


@compiled
def _entry(entries, weighed, initial):
    """Return an entry of the Lagrangian's Hessian with other weights."""
    total = entries[0]
    for k in range(len(weighed)):
        total += (weighed[k] - initial[k]) * entries[1 + k]
    return total


@compiled
def move_objectives(model, step, gradients, objectives):
    """Write gradients and values of the objectives' models at a step; ``objectives`` has the values at step 0."""
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
    """Return the change ∂c · step of a limit."""
    total = 0.0
    for b in range(model.entries.shape[1]):
        total += model.entries[i, b] * step[model.columns[i, b]]
    return total
