"""What one iteration of the interior-point method works with, and how it is evaluated; compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation import compiled
from paretoik.nlp.compiled.kernel_steps import evaluate


class Iteration(NamedTuple):
    """What one iteration works with; bounds on objectives stand below the inequalities c of the kernel."""

    bounds: np.ndarray  # (bounds,) which rows have a finite bound
    objectives: np.ndarray  # (objectives,)
    trial_objectives: np.ndarray
    objective_changes: np.ndarray  # along the step
    c: np.ndarray  # (constraints,)
    trial_c: np.ndarray
    dc: np.ndarray
    s: np.ndarray  # slacks
    trial_s: np.ndarray
    ds: np.ndarray
    t: np.ndarray  # elastic slacks
    trial_t: np.ndarray
    dt: np.ndarray
    r: np.ndarray  # residuals c − s + t
    trial_r: np.ndarray
    z: np.ndarray  # multipliers of c
    dz: np.ndarray
    stiffness: np.ndarray  # of the constraints in Newton's system
    force: np.ndarray  # multipliers that its right side has in place of z
    objective_weights: np.ndarray
    residual: np.ndarray  # (unknowns,) reduced gradient of the Lagrangian
    step: np.ndarray  # (unknowns + bounds,)
    A: np.ndarray  # Newton's matrix, its factors below
    B: np.ndarray
    C: np.ndarray
    L: np.ndarray
    X: np.ndarray
    S: np.ndarray
    filter: np.ndarray  # (iterations + 1, 2) residuals and merits that no step may be worse than in both


class Barrier(NamedTuple):
    """The subproblem: barrier μ and penalty, and the violation at the penalty that last halved it."""

    mu: float
    penalty: float
    violation: float
    helpful_penalty: float


@compiled
def allocate_iteration(size, band, border, inequalities, objectives, bounds, iterations):
    """Return the arrays of an iteration; ``bounds`` are the rows that have a finite one."""
    constraints, borders = inequalities + len(bounds), border + len(bounds)
    by_objective, by_constraint = np.zeros((4, objectives)), np.zeros((16, constraints))
    F, trial_F, dF, objective_weights = by_objective[0], by_objective[1], by_objective[2], by_objective[3]
    c = by_constraint
    return Iteration(
        bounds, F, trial_F, dF, c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10], c[11], c[12],
        c[13], c[14], objective_weights,
        np.zeros(size + border),
        np.zeros(size + borders),
        np.zeros((size, band)),
        np.zeros((borders, size)),
        np.zeros((borders, borders)),
        np.zeros((size, band)),
        np.zeros((borders, size)),
        np.zeros((borders, borders)),
        np.zeros((iterations + 1, 2)),
    )  # fmt: skip


@compiled
def all_finite(F, c):
    """Return whether objectives and constraint values are finite."""
    total = 0.0
    for k in range(len(F)):
        total += F[k]
    for i in range(len(c)):
        total += c[i]
    return np.isfinite(total)


@compiled
def evaluate_all(kernel, work, x, rows, upper, bounds, F, c):
    """Write objectives and constraint values at x."""
    evaluate(kernel, work, x, F, c)
    inequalities = len(c) - len(bounds)
    for e in range(len(bounds)):
        value = 0.0
        for k in range(len(F)):
            value += rows[bounds[e], k] * F[k]
        c[inequalities + e] = upper[bounds[e]] - value


@compiled
def accept_trial(it):
    """Take the trial values."""
    for k in range(len(it.objectives)):
        it.objectives[k] = it.trial_objectives[k]
    for i in range(len(it.c)):
        it.c[i], it.s[i], it.t[i], it.r[i] = it.trial_c[i], it.trial_s[i], it.trial_t[i], it.trial_r[i]


@compiled
def weigh_objectives(weights, rows, bounds, multipliers, out):
    """Write weights + rowsᵀ · multipliers of the bounds, the last of all multipliers."""
    inequalities = len(multipliers) - len(bounds)
    for k in range(len(weights)):
        out[k] = weights[k]
        for e in range(len(bounds)):
            out[k] += rows[bounds[e], k] * multipliers[inequalities + e]


@compiled
def residual_sum(r, options):
    """Return Σ |r|, 0 where it is below what counts."""
    total = 0.0
    for i in range(len(r)):
        total += abs(r[i])
    return 0.0 if total <= options.residual_tolerance else total - options.residual_tolerance
