"""A program to second order at a point, along h(x) = 0, as a kernel has it; compiled.

    F(d) ≈ F + ∂F d + ½ dᵀ Fₖ'' d for every objective by itself,  c(d) ≈ c + ∂c d

The second derivatives of an objective have the curvature of h(x) = 0 in them, that of its own multipliers, so that they
are those of F at the point that a step leads to.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation import compiled
from paretoik.compilation_references import keep, refer
from paretoik.nlp.compiled.array_loops import clear
from paretoik.nlp.compiled.kernel_steps import (
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


class LocalModel(NamedTuple):
    """The program at a point; of each matrix [[A, Bᵀ], [B, C]] A is banded (``bordered_cholesky``)."""

    objectives: np.ndarray  # (objectives,)
    gradients: np.ndarray  # (objectives, unknowns)
    c: np.ndarray  # (inequalities,)
    columns: np.ndarray  # (inequalities, width)
    entries: np.ndarray
    A: np.ndarray  # (1 + objectives, size, band): the Hessian of the Lagrangian, then those of the objectives
    B: np.ndarray
    C: np.ndarray
    stiffness: np.ndarray  # (inequalities,): 0
    unit: np.ndarray  # (objectives,): 0
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
    """Write values and first derivatives at x; return whether they are finite and h has full rank."""
    evaluate(kernel, work, x, model.objectives, model.c)
    if not linearise(kernel, work, x):
        return False
    constraint_rows(kernel, work, model.columns, model.entries)
    total = 0.0
    for k in range(len(model.objectives)):
        _choose(model.unit, k)
        reduced_gradient(kernel, work, model.unit, model.stiffness[:0], model.reduced)
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
def lagrangian_hessian(kernel, work, weights, multipliers, model):
    """Write the Hessian of weights · F − multipliers · c where x was linearised."""
    _hessian(kernel, work, weights, multipliers, 0, model)


@compiled
def objective_hessians(kernel, work, model):
    """Write the Hessian of every objective by itself."""
    for k in range(len(model.objectives)):
        _choose(model.unit, k)
        _hessian(kernel, work, model.unit, model.stiffness, 1 + k, model)


@compiled
def _choose(unit, k):
    for i in range(len(unit)):
        unit[i] = 1.0 if i == k else 0.0


@compiled
def _hessian(kernel, work, weights, multipliers, which, model):
    A, B, C = model.A[which], model.B[which], model.C[which]
    clear(A)
    clear(B)
    clear(C)
    reduced_gradient(kernel, work, weights, multipliers, model.reduced)
    prepare_multipliers(kernel, work, weights)
    assemble(kernel, work, model.stiffness, A, B, C)


@compiled
def add_product(model, which, factor, vector, out):
    """Add a multiple of a matrix of the model times a vector."""
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
    """Return (F, ∂F, c, columns and entries of the rows of ∂c, whether they are finite and h has full rank) at x."""
    problem = refer(kernel)
    work = allocate_workspace(problem, x)
    point = add_auxiliary(problem, refer(work), x)
    model = allocate_model(problem, refer(work), x, objectives)
    regular = to_first_order(problem, refer(work), point, refer(model))
    keep(work)
    return model.objectives, model.gradients, model.c, model.columns, model.entries, regular
