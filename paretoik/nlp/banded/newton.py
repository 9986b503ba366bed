"""One iteration of the interior-point method: its arrays, evaluation and Newton step; compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.banded.cholesky import factorise, solve
from paretoik.nlp.banded.elastic import barrier_terms, limit_implied_step, limit_step, newton_slacks
from paretoik.nlp.banded.kernel import assemble, directional_derivatives, evaluate, expand_step, reduced_gradient
from paretoik.nlp.linear_algebra import clear, dot


class Iteration(NamedTuple):
    """Arrays of one iteration; bounds on objectives follow the kernel's inequalities c."""

    bounds: np.ndarray  # (bounds,) rows with a finite bound
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
    force: np.ndarray  # multipliers that replace z on its right side
    objective_weights: np.ndarray
    residual: np.ndarray  # (unknowns,) reduced gradient of the Lagrangian
    step: np.ndarray  # (unknowns + bounds,)
    A: np.ndarray  # Newton's matrix, its factors below
    B: np.ndarray
    C: np.ndarray
    L: np.ndarray
    X: np.ndarray
    S: np.ndarray
    filter: np.ndarray  # (iterations + 1, 2) residual and merit pairs: a step must be better in one of the two


class Barrier(NamedTuple):
    """The subproblem: barrier μ and penalty; the violation when last halved, and the penalty that halved it."""

    mu: float
    penalty: float
    violation: float
    helpful_penalty: float


@compiled
def allocate_iteration(size, band, border, inequalities, objectives, bounds, iterations):
    """Return the arrays of an iteration; ``bounds`` are the rows with a finite bound."""
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
    """Copy the trial values to the iterate."""
    for k in range(len(it.objectives)):
        it.objectives[k] = it.trial_objectives[k]
    for i in range(len(it.c)):
        it.c[i], it.s[i], it.t[i], it.r[i] = it.trial_c[i], it.trial_s[i], it.trial_t[i], it.trial_r[i]


@compiled
def weigh_objectives(weights, rows, bounds, multipliers, out):
    """Write weights + rowsᵀ · (multipliers of the bounds, which are the last multipliers)."""
    inequalities = len(multipliers) - len(bounds)
    for k in range(len(weights)):
        out[k] = weights[k]
        for e in range(len(bounds)):
            out[k] += rows[bounds[e], k] * multipliers[inequalities + e]


@compiled
def residual_sum(r, options):
    """Return Σ |r| less its tolerance, at least 0."""
    total = 0.0
    for i in range(len(r)):
        total += abs(r[i])
    return 0.0 if total <= options.residual_tolerance else total - options.residual_tolerance


# Newton's step of the interior-point method, slacks eliminated, along the null space Z; compiled.
#
#     [Zᵀ(∇²L + ∂cᵀ Σ ∂c) Z + δ I,  (rows ∂F Z)ᵀ] [d]       [Zᵀ ∇L]    Σ: stiffness of c, Σ_b: of the bounds,
#     [rows ∂F Z,                   −1 / Σ_b    ] [y]  =  − [0    ]    ∇L with ``force`` in place of z


@compiled
def newton_step(kernel, work, weights, rows, barrier, options, border, delta, it):
    """Write Newton's step; return the next regularisation δ, inf if no matrix has the right inertia."""
    unknowns, inequalities = len(it.residual), len(it.c) - len(it.bounds)
    barrier_terms(it.s, it.t, it.r, it.z, barrier.mu, barrier.penalty, it.stiffness, it.force)
    clear(it.A)
    clear(it.B)
    clear(it.C)
    largest = assemble(kernel, work, it.stiffness, it.A, it.B, it.C)
    size = it.A.shape[0]
    for e in range(len(it.bounds)):  # a bound stays an equation, a row [rows ∂F, −1 / stiffness] of the border
        reduced_gradient(kernel, work, rows[it.bounds[e]], it.force[:0], it.residual)
        for i in range(size):
            it.B[border + e, i] = it.residual[i]
        for i in range(border):
            it.C[border + e, i] = it.C[i, border + e] = it.residual[size + i]
        it.C[border + e, border + e] = -1.0 / it.stiffness[inequalities + e]
    weigh_objectives(weights, rows, it.bounds, it.force, it.objective_weights)
    reduced_gradient(kernel, work, it.objective_weights, it.force, it.residual)
    delta = _factorise_definite(it.A, it.B, it.C, it.L, it.X, it.S, border, largest, options.regularisation, delta)
    if np.isfinite(delta):
        for i in range(len(it.step)):
            it.step[i] = -it.residual[i] if i < unknowns else 0.0
        solve(it.L, it.B, it.X, it.S, it.step)
    return delta


@compiled
def _factorise_definite(A, B, C, L, X, S, border, largest, least, delta):
    """Factorise with the first of growing multiples δ of the identity that gives the right inertia; return δ.

    The first δ is a share ``least`` of ``largest``, or a quarter of the last one (Nocedal & Wright, algorithm 3.3).
    Returns a 16th of the last δ if none is needed, inf if none serves: the matrix is not finite.
    """
    added, largest_entry = 0.0, largest
    for i in range(A.shape[0]):
        largest_entry = max(largest_entry, abs(A[i, 0]))
    while not factorise(A, B, C, L, X, S, C.shape[0] - border):
        more = max(least * largest, delta / 4, 8 * added, 1e-300)
        if not more < 1e15 * largest_entry:
            return np.inf
        for i in range(A.shape[0]):
            A[i, 0] += more - added
        for i in range(border):
            C[i, i] += more - added
        added = more
    return added if added > 0 else delta / 16


@compiled
def search_direction(kernel, work, weights, rows, barrier, options, dx, it):
    """Write the step in x and the changes along it; return its largest length and the merit's slope."""
    largest = expand_step(kernel, work, it.step, dx)
    length = min(1.0, kernel.longest_step / max(largest, 1e-300))
    directional_derivatives(kernel, work, dx, it.objective_changes, it.dc)
    inequalities = len(it.c) - len(it.bounds)
    for e in range(len(it.bounds)):
        change = 0.0
        for k in range(len(it.objective_changes)):
            change += rows[it.bounds[e], k] * it.objective_changes[k]
        it.dc[inequalities + e] = -change
    for i in range(len(it.dz)):
        it.dz[i] = it.force[i] - it.z[i] - it.stiffness[i] * it.dc[i]
    mu, penalty, fraction = barrier.mu, barrier.penalty, options.boundary_fraction
    if kernel.implied_slacks:
        slope, length = limit_implied_step(it.c, it.s, it.dc, mu, length, fraction)
    else:
        newton_slacks(it.s, it.t, it.r, it.z, it.dz, it.dc, mu, penalty, it.ds, it.dt)
        slope, length = limit_step(it.s, it.t, it.ds, it.dt, mu, penalty, length, fraction)
    slope += dot(weights, it.objective_changes)
    return length, min(slope, 0.0) if kernel.implied_slacks else slope
