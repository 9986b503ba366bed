"""A primal–dual interior-point method for nonlinear programs of every kind, compiled.

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper

Every iterate meets h(x) = 0: steps are taken in the null space of ∂h/∂x and retracted. Inequalities are elastic: an
exact penalty, which grows until they hold, takes the place of a restoration phase (``elastic``). Steps are Newton's,
with exact second derivatives, made positive definite where they are not, and guarded by a merit function. What a
program is, and whether its Newton matrix is banded or dense, is up to its kernel (``kernel_steps``).

Source: Nocedal & Wright, Numerical Optimization, chapters 3, 15.3, 17 and 19; Wächter & Biegler 2006 for how the
barrier falls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation import compiled
from paretoik.nlp.compiled.array_loops import clear, dot, finite_indices
from paretoik.nlp.compiled.bordered_cholesky import factorise, solve
from paretoik.nlp.compiled.elastic import (
    barrier_terms,
    begin_slacks,
    central_multipliers,
    complementarity_and_violation,
    limit_implied_step,
    limit_step,
    merit_terms,
    newton_slacks,
    reset_slacks,
    step_multipliers,
    step_slacks,
)
from paretoik.nlp.compiled.kernel_steps import (
    allocate_workspace,
    assemble,
    dimensions,
    directional_derivatives,
    evaluate,
    expand_step,
    linearise,
    objective_scale,
    prepare_multipliers,
    reduced_gradient,
    residual_norm,
    restore,
    retract,
)
from paretoik.nlp.compiled.references import keep, refer
from paretoik.nlp.solutions import CONVERGED, ITERATION_LIMIT, NO_PROGRESS, NOT_FINITE, SINGULAR, VIOLATED


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


@compiled(what="the interior-point method", seconds=15)
def minimise(kernel, x, weights, rows, upper, options):
    """Minimise weights · F from x where rows · F ≤ upper, an infinite bound being none.

    Returns (x, status, iterations, F, multipliers of c, then of the finite bounds, stationarity, worst violation).
    """
    x, weights = x.copy(), weights.copy()
    problem = refer(kernel)
    size, band, border, inequalities = dimensions(problem, x)
    work = allocate_workspace(problem, x)
    it = _allocate(size, band, border, inequalities, len(weights), finite_indices(upper), options.iterations)
    scale = objective_scale(problem, weights)
    for k in range(len(weights)):
        weights[k] /= scale
    x, status, iteration, stationarity, violation = _iterate(
        problem, refer(work), refer(it), refer(options), x, weights, rows, upper, border
    )
    for i in range(len(it.z)):
        it.z[i] *= scale
    keep(kernel)
    keep(work)
    keep(options)
    return x, status, iteration, it.objectives, it.z, stationarity, violation


@compiled
def _iterate(kernel, work, it, options, x, weights, rows, upper, border):
    """Iterate from x; return (x, status, iterations, stationarity, worst violation)."""
    penalty = kernel.penalty * options.penalty
    barrier = Barrier(options.barrier, penalty, np.inf, penalty)
    trial, dx = x.copy(), np.zeros(x.shape)
    delta, flat, stalled, entries, restorations = 0.0, False, 0, 0, 0
    status, iteration, stationarity, violation, least = ITERATION_LIMIT, 0, np.inf, np.inf, np.inf
    error = restore(kernel, work, x)
    _evaluate(kernel, work, x, rows, upper, it.bounds, it.objectives, it.c)
    if not _all_finite(it.objectives, it.c):
        status = NOT_FINITE
    elif error > 0.0:
        status, violation = VIOLATED, error
    infeasible = options.filter_infeasible * max(1.0, _begin_slacks(kernel, barrier, it, options))
    for iteration in range(options.iterations + 1 if status == ITERATION_LIMIT else 0):
        if not linearise(kernel, work, x):
            status = SINGULAR
            break
        mean = _multiplier_scale(kernel, it.z)
        stationarity = _stationarity(kernel, work, weights, rows, it) / mean
        complementarity, violation = complementarity_and_violation(it.c, it.s, it.z, barrier.mu)
        complementarity /= mean
        solved = _subproblem_solved(barrier, stationarity, complementarity, flat, it, options)
        if solved and barrier.mu <= options.last_barrier and (flat or stationarity <= options.tolerance):
            status = _final_status(barrier, violation, options)
            break
        if iteration == options.iterations:
            break
        if solved:
            stalled = 0
            hopeless, barrier = _next_subproblem(kernel, barrier, stationarity, complementarity, violation, it, options)
            entries = 0
            if hopeless:
                status = VIOLATED
                break
        delta = _newton_step(kernel, work, weights, rows, barrier, border, delta, it)
        if not np.isfinite(delta):
            status = NO_PROGRESS
            break
        length, slope = _direction(kernel, work, weights, rows, barrier, options, dx, it)
        before = dot(weights, it.objectives) + merit_terms(it.s, it.t, barrier.mu, barrier.penalty)
        theta = _residual_sum(it.r, options)
        flat = theta == 0.0 and (
            -slope <= options.flat_decrease * (1 + abs(before)) or stalled >= options.stalled_steps
        )
        accepted, after, entries = _search(
            kernel, work, x, dx, length, slope, before, theta, infeasible, weights, rows, upper, barrier, entries,
            options, trial, it
        )  # fmt: skip
        if accepted:
            gained = after < before - options.merit_rounding * abs(before)
            stalled = 0 if gained or theta > 0.0 else stalled + 1
            step_multipliers(it.dz, it.trial_s, it.trial_t, barrier.mu, barrier.penalty, options, it.z)
            x, trial = trial, x
            _accept(it)
        elif kernel.implied_slacks or restorations >= options.restorations or (theta == 0.0 and entries == 0):
            if not flat:
                status = NO_PROGRESS
                break
        else:
            restorations, least, delta = (0, theta, 0.0) if theta < 0.5 * least else (restorations + 1, least, 0.0)
            if entries == 0:
                reset_slacks(it.c, barrier.mu, barrier.penalty, it.s, it.t, it.r)
                central_multipliers(it.s, barrier.mu, barrier.penalty, it.z)
            entries = 0
    return x, status, iteration, stationarity, violation


@compiled
def _allocate(size, band, border, inequalities, objectives, bounds, iterations):
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
def _all_finite(F, c):
    total = 0.0
    for k in range(len(F)):
        total += F[k]
    for i in range(len(c)):
        total += c[i]
    return np.isfinite(total)


@compiled
def _begin_slacks(kernel, barrier, it, options):
    """Write the first slacks and multipliers; return the sum of the residuals."""
    if kernel.implied_slacks:
        reset_slacks(it.c, barrier.mu, barrier.penalty, it.s, it.t, it.r)
    else:
        least = min(options.least_slack, np.sqrt(barrier.mu))
        begin_slacks(it.c, barrier.mu, barrier.penalty, least, it.s, it.t, it.r)
    central_multipliers(it.s, barrier.mu, barrier.penalty, it.z)
    return _residual_sum(it.r, options)


@compiled
def _residual_sum(r, options):
    """Return Σ |r|, 0 where it is below what counts."""
    total = 0.0
    for i in range(len(r)):
        total += abs(r[i])
    return 0.0 if total <= options.residual_tolerance else total - options.residual_tolerance


@compiled
def _multiplier_scale(kernel, z):
    """Return what errors are relative to: the mean of large multipliers (Wächter & Biegler 2006, Eq. 6)."""
    total = 0.0
    for i in range(len(z)):
        total += z[i]
    return max(1.0, total / (kernel.large_multiplier * max(1, len(z))))


@compiled
def _evaluate(kernel, work, x, rows, upper, bounds, F, c):
    """Write objectives and constraint values at x."""
    evaluate(kernel, work, x, F, c)
    inequalities = len(c) - len(bounds)
    for e in range(len(bounds)):
        value = 0.0
        for k in range(len(F)):
            value += rows[bounds[e], k] * F[k]
        c[inequalities + e] = upper[bounds[e]] - value


@compiled
def _accept(it):
    """Take the trial values."""
    for k in range(len(it.objectives)):
        it.objectives[k] = it.trial_objectives[k]
    for i in range(len(it.c)):
        it.c[i], it.s[i], it.t[i], it.r[i] = it.trial_c[i], it.trial_s[i], it.trial_t[i], it.trial_r[i]


@compiled
def _weigh_objectives(weights, rows, bounds, multipliers, out):
    """Write weights + rowsᵀ · multipliers of the bounds, the last of all multipliers."""
    inequalities = len(multipliers) - len(bounds)
    for k in range(len(weights)):
        out[k] = weights[k]
        for e in range(len(bounds)):
            out[k] += rows[bounds[e], k] * multipliers[inequalities + e]


@compiled
def _stationarity(kernel, work, weights, rows, it):
    """Return the length of the reduced gradient of the Lagrangian."""
    _weigh_objectives(weights, rows, it.bounds, it.z, it.objective_weights)
    reduced_gradient(kernel, work, it.objective_weights, it.z, it.residual)
    prepare_multipliers(kernel, work, it.objective_weights)
    return residual_norm(kernel, it.residual)


@compiled
def _subproblem_solved(barrier, stationarity, complementarity, flat, it, options):
    """Wächter & Biegler 2006, Eq. 5; where nothing more can be gained, rounding is all that is left."""
    tolerance, largest = options.barrier_tolerance * barrier.mu, 0.0
    for i in range(len(it.r)):
        largest = max(largest, abs(it.r[i]))
    feasible = largest <= max(tolerance, options.residual_tolerance)
    return (flat or stationarity <= max(tolerance, options.tolerance)) and complementarity <= tolerance and feasible


@compiled
def _soft_violation(barrier, options):
    """Return up to which a violation only says that the barrier is not yet low."""
    return options.soft_violation * barrier.mu / barrier.penalty


@compiled
def _final_status(barrier, violation, options):
    return CONVERGED if violation <= max(options.tolerance, _soft_violation(barrier, options)) else VIOLATED


@compiled
def _next_subproblem(kernel, barrier, stationarity, complementarity, violation, it, options):
    """Return whether the constraints cannot all hold, and the next subproblem: a higher penalty or a lower barrier."""
    mu, penalty, before, helpful = barrier
    if mu <= options.penalty_barrier and violation > _soft_violation(barrier, options):
        if violation <= 0.5 * before:
            before, helpful = violation, penalty
        elif penalty >= options.helpless_growth * helpful:
            return True, barrier
        penalty = options.penalty_factor * penalty
        reset_slacks(it.c, mu, penalty, it.s, it.t, it.r)
        central_multipliers(it.s, mu, penalty, it.z)
    else:
        mu = _next_barrier(mu, options)
        while mu > options.last_barrier and max(stationarity, complementarity) <= options.barrier_tolerance * mu:
            mu = _next_barrier(mu, options)
        if kernel.implied_slacks:
            reset_slacks(it.c, mu, penalty, it.s, it.t, it.r)
    return False, Barrier(mu, penalty, before, helpful)


@compiled
def _next_barrier(mu, options):
    """Wächter & Biegler 2006, Eq. 7."""
    return max(options.last_barrier, min(options.barrier_factor * mu, mu**options.barrier_power))


@compiled
def _newton_step(kernel, work, weights, rows, barrier, border, delta, it):
    """Write Newton's step; return what was added to the diagonal last, inf where no matrix serves."""
    unknowns, inequalities = len(it.residual), len(it.c) - len(it.bounds)
    barrier_terms(it.s, it.t, it.r, it.z, barrier.mu, barrier.penalty, it.stiffness, it.force)
    clear(it.A)
    clear(it.B)
    clear(it.C)
    largest = assemble(kernel, work, it.stiffness, it.A, it.B, it.C)
    size = it.A.shape[0]
    for e in range(len(it.bounds)):  # a bound stays an equation: its row of [rows ∂F, −1 / stiffness] is the border's
        reduced_gradient(kernel, work, rows[it.bounds[e]], it.force[:0], it.residual)
        for i in range(size):
            it.B[border + e, i] = it.residual[i]
        for i in range(border):
            it.C[border + e, i] = it.C[i, border + e] = it.residual[size + i]
        it.C[border + e, border + e] = -1.0 / it.stiffness[inequalities + e]
    _weigh_objectives(weights, rows, it.bounds, it.force, it.objective_weights)
    reduced_gradient(kernel, work, it.objective_weights, it.force, it.residual)
    delta = _factorise_definite(it.A, it.B, it.C, it.L, it.X, it.S, border, largest, delta)
    if np.isfinite(delta):
        for i in range(len(it.step)):
            it.step[i] = -it.residual[i] if i < unknowns else 0.0
        solve(it.L, it.B, it.X, it.S, it.step)
    return delta


@compiled
def _factorise_definite(A, B, C, L, X, S, border, largest, delta):
    """Factorise with the least of growing multiples of the identity that gives the right inertia; return that.

    Nocedal & Wright, algorithm 3.3. Infinity says that none does: the matrix is not finite.
    """
    added, most = 0.0, largest
    for i in range(A.shape[0]):
        most = max(most, abs(A[i, 0]))
    while not factorise(A, B, C, L, X, S, C.shape[0] - border):
        more = max(1e-9 * largest, delta / 4, 8 * added, 1e-300)
        if not more < 1e15 * most:
            return np.inf
        for i in range(A.shape[0]):
            A[i, 0] += more - added
        for i in range(border):
            C[i, i] += more - added
        added = more
    return added if added > 0 else delta / 16


@compiled
def _direction(kernel, work, weights, rows, barrier, options, dx, it):
    """Write the step in x and what changes along it; return how far it may go and the merit function's slope."""
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


@compiled
def _search(
    kernel, work, x, dx, length, slope, before, theta, infeasible, weights, rows, upper, barrier, entries, options,
    trial, it
):  # fmt: skip
    """Write the trial point of the longest step that the filter accepts; return (whether, merit, filter entries)."""
    after, mu, penalty = before, barrier.mu, barrier.penalty
    for _ in range(options.halvings):
        if retract(kernel, work, x, dx, length, trial):
            _evaluate(kernel, work, trial, rows, upper, it.bounds, it.trial_objectives, it.trial_c)
            if kernel.implied_slacks:
                reset_slacks(it.trial_c, mu, penalty, it.trial_s, it.trial_t, it.trial_r)
            else:
                step_slacks(it.trial_c, it.s, it.t, it.ds, it.dt, length, it.trial_s, it.trial_t, it.trial_r)
            after = dot(weights, it.trial_objectives) + merit_terms(it.trial_s, it.trial_t, mu, penalty)
            accepted, entries = _filter_accepts(
                theta, before, _residual_sum(it.trial_r, options), after, slope, length, infeasible, it.filter,
                entries, options
            )  # fmt: skip
            if accepted:
                return True, after, entries
        length *= 0.5
    return False, after, entries


@compiled
def _filter_accepts(theta, before, trial_theta, after, slope, length, infeasible, filter_, entries, options):
    """Return whether a step may be taken, and the number of filter entries (Wächter & Biegler 2006, section 2.3).

    Without residuals this is Armijo's condition.
    """
    margin, rounding = options.filter_margin, options.merit_rounding * abs(before)
    if not np.isfinite(after + trial_theta):
        return False, entries
    for i in range(entries):
        if trial_theta >= (1 - margin) * filter_[i, 0] and after >= filter_[i, 1] - margin * filter_[i, 0]:
            return False, entries
    if theta <= infeasible and length * (-slope) ** 2.3 >= theta**1.1 and slope <= 0.0:
        return after <= before + options.armijo * length * slope + rounding, entries
    if trial_theta <= (1 - margin) * theta or after <= before - margin * theta + rounding:
        filter_[entries, 0], filter_[entries, 1] = theta, before
        return True, entries + 1
    return False, entries
