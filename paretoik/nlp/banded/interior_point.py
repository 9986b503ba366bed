"""A primal–dual interior-point method for general nonlinear programs, compiled.

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper

Every iterate satisfies h(x) = 0: steps are taken in the null space of ∂h/∂x and retracted. Inequalities are elastic:
an exact penalty, which grows until they are satisfied, replaces a restoration phase (``elastic``). Steps are Newton
steps with exact second derivatives; the Hessian is made positive definite if it is not, and a filter with a merit
function accepts the steps. The program's kernel defines its functions and a banded or dense Newton matrix (``kernel``).

Source: Nocedal & Wright, Numerical Optimization, chapters 3, 15.3, 17 and 19; Wächter & Biegler 2006 for the barrier
schedule.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.array_tuples import keep, refer
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.banded.cholesky import BorderedMatrix, allocate_matrix, clear_matrix, factorise, solve
from paretoik.nlp.banded.elastic import (
    approach_central_path,
    barrier_terms,
    begin_slacks,
    central_multipliers,
    limit_implied_step,
    limit_step,
    merit_terms,
    newton_slacks,
    reset_slacks,
    step_multipliers,
    step_slacks,
)
from paretoik.nlp.banded.kernel import (
    add_auxiliary,
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
    remove_auxiliary,
    residual_norm,
    restore,
    retract,
    set_smoothing,
)
from paretoik.nlp.linear_algebra import dot, finite_indices
from paretoik.nlp.program import CONVERGED, INTERRUPTED, ITERATION_LIMIT, NO_PROGRESS, NOT_FINITE, SINGULAR, VIOLATED

# One iteration: its arrays, evaluation and Newton step, compiled.


class Iteration(NamedTuple):
    """Arrays of one iteration; bounds on objectives follow the kernel's inequalities c."""

    bounds: np.ndarray  # (bounds,) rows with a finite bound
    objectives: np.ndarray  # (objectives,)
    trial_objectives: np.ndarray
    objective_changes: np.ndarray  # changes of the objectives along the step
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
    stiffness: np.ndarray  # stiffness of the constraints in Newton's system
    force: np.ndarray  # multipliers that replace z on the right side of Newton's system
    objective_weights: np.ndarray
    residual: np.ndarray  # (unknowns,) reduced gradient of the Lagrangian
    step: np.ndarray  # (unknowns + bounds,)
    matrix: BorderedMatrix  # Newton's matrix
    filter: np.ndarray  # (iterations + 1, 2): pairs of residual and merit; a step must be better in one of the two


class GoalArrays(NamedTuple):
    """The goal: minimise weights · F with rows · F ≤ upper."""

    weights: np.ndarray
    rows: np.ndarray
    upper: np.ndarray


class Line(NamedTuple):
    """A line to search.

    length: largest step
    slope: derivative of the merit function at the start
    merit: merit function at the start
    residual: residual θ at the start
    large_residual: largest θ at which only the merit decides
    """

    length: float
    slope: float
    merit: float
    residual: float
    large_residual: float


class Barrier(NamedTuple):
    """The subproblem of a barrier and a penalty.

    mu: barrier μ
    violation: violation of the constraints when that was last halved
    helpful_penalty: penalty then
    """

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
        allocate_matrix(size, band, borders),
        np.zeros((iterations + 1, 2)),
    )  # fmt: skip


@compiled
def evaluate_all(kernel, work, x, goal, bounds, F, c):
    """Write objectives and constraint values at x."""
    evaluate(kernel, work, x, F, c)
    inequalities = len(c) - len(bounds)
    for e in range(len(bounds)):
        value = 0.0
        for k in range(len(F)):
            value += goal.rows[bounds[e], k] * F[k]
        c[inequalities + e] = goal.upper[bounds[e]] - value


@compiled
def accept_trial(it):
    """Copy the trial values to the iterate."""
    for k in range(len(it.objectives)):
        it.objectives[k] = it.trial_objectives[k]
    for i in range(len(it.c)):
        it.c[i], it.s[i], it.t[i], it.r[i] = it.trial_c[i], it.trial_s[i], it.trial_t[i], it.trial_r[i]


@compiled
def weigh_objectives(goal, bounds, multipliers, out):
    """Write weights + rowsᵀ · (multipliers of the bounds, which come last)."""
    inequalities = len(multipliers) - len(bounds)
    for k in range(len(goal.weights)):
        out[k] = goal.weights[k]
        for e in range(len(bounds)):
            out[k] += goal.rows[bounds[e], k] * multipliers[inequalities + e]


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
def newton_step(kernel, work, it, options, goal, barrier, border, delta):
    """Write Newton's step; return the next regularisation δ, inf if no matrix has the right inertia."""
    unknowns, inequalities = len(it.residual), len(it.c) - len(it.bounds)
    barrier_terms(it.s, it.t, it.r, it.z, barrier.mu, barrier.penalty, it.stiffness, it.force)
    matrix = it.matrix
    clear_matrix(matrix)
    largest = assemble(kernel, work, it.stiffness, matrix.A, matrix.B, matrix.C)
    size = len(matrix.A)
    for e in range(len(it.bounds)):  # a bound stays an equation: a row [rows ∂F, −1 / stiffness] of the border
        reduced_gradient(kernel, work, goal.rows[it.bounds[e]], it.force[:0], it.residual)
        for i in range(size):
            matrix.B[border + e, i] = it.residual[i]
        for i in range(border):
            matrix.C[border + e, i] = matrix.C[i, border + e] = it.residual[size + i]
        matrix.C[border + e, border + e] = -1.0 / it.stiffness[inequalities + e]
    weigh_objectives(goal, it.bounds, it.force, it.objective_weights)
    reduced_gradient(kernel, work, it.objective_weights, it.force, it.residual)
    delta = _factorise_definite(matrix, border, largest, options.regularisation, delta)
    if np.isfinite(delta):
        for i in range(len(it.step)):
            it.step[i] = -it.residual[i] if i < unknowns else 0.0
        solve(matrix, it.step)
    return delta


@compiled
def _factorise_definite(matrix, border, largest, least, delta):
    """Factorise with the smallest tried δ I that gives the right inertia, and return δ.

    The first δ is a share ``least`` of ``largest``, or a quarter of the last one (Nocedal & Wright, algorithm 3.3).
    Returns a 16th of the last δ if none is needed, inf if none suffices, because the matrix is not finite.
    """
    A, C, added, largest_entry = matrix.A, matrix.C, 0.0, largest
    for i in range(A.shape[0]):
        largest_entry = max(largest_entry, abs(A[i, 0]))
    while not factorise(matrix, C.shape[0] - border):
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
def search_direction(kernel, work, it, options, goal, barrier, dx, infeasible):
    """Write the step in x and the changes along it; return the line to search."""
    largest = expand_step(kernel, work, it.step, dx)
    length = min(1.0, kernel.longest_step / max(largest, 1e-300))
    directional_derivatives(kernel, work, dx, it.objective_changes, it.dc)
    inequalities = len(it.c) - len(it.bounds)
    for e in range(len(it.bounds)):
        change = 0.0
        for k in range(len(it.objective_changes)):
            change += goal.rows[it.bounds[e], k] * it.objective_changes[k]
        it.dc[inequalities + e] = -change
    for i in range(len(it.dz)):
        it.dz[i] = it.force[i] - it.z[i] - it.stiffness[i] * it.dc[i]
    mu, penalty, fraction = barrier.mu, barrier.penalty, options.boundary_fraction
    if kernel.implied_slacks:
        slope, length = limit_implied_step(it.c, it.s, it.dc, mu, length, fraction)
    else:
        newton_slacks(it.s, it.t, it.r, it.z, it.dz, it.dc, mu, penalty, it.ds, it.dt)
        slope, length = limit_step(it.s, it.t, it.ds, it.dt, mu, penalty, length, fraction)
    slope += dot(goal.weights, it.objective_changes)
    slope = min(slope, 0.0) if kernel.implied_slacks else slope
    before = dot(goal.weights, it.objectives) + merit_terms(it.s, it.t, mu, penalty)
    return Line(length, slope, before, residual_sum(it.r, options), infeasible)


# Filter line search, compiled.


@compiled
def search_line(kernel, work, it, options, goal, barrier, points, dx, line, entries):
    """Write the trial point of the longest accepted step; return (whether there is one, merit, filter entries).

    ``points`` are x and the trial point. If the predicted decrease is only rounding, only the full step is tried.
    """
    (x, trial), (length, slope, before, theta, infeasible) = points, line
    after, mu, penalty = before, barrier.mu, barrier.penalty
    for _ in range(1 if theta == 0.0 and is_negligible(slope, before, options) else options.halvings):
        if retract(kernel, work, x, dx, length, trial):
            evaluate_all(kernel, work, trial, goal, it.bounds, it.trial_objectives, it.trial_c)
            if kernel.implied_slacks:
                reset_slacks(it.trial_c, mu, penalty, it.trial_s, it.trial_t, it.trial_r)
            else:
                step_slacks(it.trial_c, it.s, it.t, it.ds, it.dt, length, it.trial_s, it.trial_t, it.trial_r)
            after = dot(goal.weights, it.trial_objectives) + merit_terms(it.trial_s, it.trial_t, mu, penalty)
            accepted, entries = _filter_accepts(
                theta, before, residual_sum(it.trial_r, options), after, slope, length, infeasible, it.filter,
                entries, options
            )  # fmt: skip
            if accepted:
                return True, after, entries
        length *= 0.5
    return False, after, entries


@compiled
def is_negligible(slope, before, options):
    """Return whether the predicted decrease of the merit function is only rounding."""
    return -slope <= options.flat_decrease * (1 + abs(before))


@compiled
def _filter_accepts(theta, before, trial_theta, after, slope, length, infeasible, filter_, entries, options):
    """Return whether a step is accepted, and the number of filter entries.

    Source: Wächter & Biegler 2006, section 2.3. Without residuals, this is Armijo's condition.
    """
    margin, rounding = options.filter_margin, options.merit_rounding * abs(before)
    if not np.isfinite(after + trial_theta):
        return False, entries
    for i in range(entries):
        if trial_theta >= (1 - margin) * filter_[i, 0] and after >= filter_[i, 1] - margin * filter_[i, 0]:
            return False, entries
    # Eq. 19, the switching condition, then Armijo's (Eq. 20); else Eq. 18: a decrease of residual or merit
    if theta <= infeasible and length * (-slope) ** 2.3 >= theta**1.1 and slope <= 0.0:
        return after <= before + options.armijo * length * slope + rounding, entries
    if trial_theta <= (1 - margin) * theta or after <= before - margin * theta + rounding:
        filter_[entries, 0], filter_[entries, 1] = theta, before
        return True, entries + 1
    return False, entries


# The iterations of the interior-point method.


@compiled(what="the interior-point method", seconds=25)
def minimise(kernel, x, weights, rows, upper, options, stop):
    """Minimise weights · F from x with rows · F ≤ upper, until ``stop[0]`` is not 0; inf is no bound.

    Returns (x, status, iterations, F, multipliers of c, then of the finite bounds, stationarity, worst violation).
    """
    weights, problem = weights.copy(), refer(kernel)
    size, band, border, inequalities = dimensions(problem, x)
    work = allocate_workspace(problem, x)
    x = add_auxiliary(problem, refer(work), x)
    it = allocate_iteration(size, band, border, inequalities, len(weights), finite_indices(upper), options.iterations)
    scale = objective_scale(problem, weights)
    for k in range(len(weights)):
        weights[k] /= scale
    x, status, iteration, stationarity, violation = _iterate(
        problem, refer(work), refer(it), refer(options), GoalArrays(weights, rows, upper), x, border, stop
    )
    for i in range(len(it.z)):
        it.z[i] *= scale
    keep(work)
    return remove_auxiliary(problem, x), status, iteration, it.objectives, it.z, stationarity, violation


@compiled
def _iterate(kernel, work, it, options, goal, x, border, stop):
    """Iterate from x; return (x, status, iterations, stationarity, worst violation)."""
    penalty = kernel.penalty * options.penalty
    barrier = Barrier(options.barrier, penalty, np.inf, penalty)
    trial, dx = x.copy(), np.zeros(x.shape)
    delta, flat, stalled, entries, restorations = 0.0, False, 0, 0, 0
    iteration, stationarity, lowest = 0, np.inf, np.inf
    status, violation, infeasible = _begin(kernel, work, it, options, goal, barrier, x)
    for iteration in range(options.iterations + 1 if status == ITERATION_LIMIT else 0):
        if stop[0] != 0:
            status = INTERRUPTED
            break
        if not linearise(kernel, work, x):
            status = SINGULAR
            break
        # errors and the test of convergence (Wächter & Biegler 2006, Eq. 5)
        stationarity, complementarity, violation = _errors(kernel, work, it, goal, barrier.mu)
        solved = _subproblem_solved(barrier, stationarity, complementarity, flat, it, options)
        if solved and barrier.mu <= options.last_barrier and (flat or stationarity <= options.tolerance):
            largest = max(options.tolerance, _soft_violation(barrier, options))
            status = CONVERGED if violation <= largest else VIOLATED
            break
        if iteration == options.iterations:
            break
        if solved:  # the next barrier or penalty (Eq. 7)
            stalled, entries = 0, 0
            worst = max(stationarity, complementarity)
            hopeless, barrier = _next_subproblem(kernel, work, it, options, goal, barrier, x, worst, violation)
            if hopeless:
                status = VIOLATED
                break
        # Newton's step and the filter line search along it
        delta = newton_step(kernel, work, it, options, goal, barrier, border, delta)
        if not np.isfinite(delta):
            status = NO_PROGRESS
            break
        line = search_direction(kernel, work, it, options, goal, barrier, dx, infeasible)
        slope, before, theta = line.slope, line.merit, line.residual
        # flat: the predicted decrease is only rounding or tiny relative to μ, or several steps stalled
        flat = is_negligible(slope, before, options) or -slope <= options.flat_barrier * barrier.mu
        flat = theta == 0.0 and (flat or stalled >= options.stalled_steps)
        accepted, after, entries = search_line(kernel, work, it, options, goal, barrier, (x, trial), dx, line, entries)
        if accepted:
            gained = after < before - options.stalled_decrease * abs(before)
            stalled = 0 if gained or theta > 0.0 else stalled + 1
            step_multipliers(it.dz, it.trial_s, it.trial_t, barrier.mu, barrier.penalty, options, it.z)
            x, trial = trial, x
            accept_trial(it)
        elif kernel.implied_slacks or restorations >= options.restorations or (theta == 0.0 and entries == 0):
            if not flat:
                status = NO_PROGRESS
                break
            approach_central_path(it.s, barrier.mu, barrier.penalty, options.barrier_tolerance, it.z)
        else:  # instead of a restoration phase: clear the filter, or recentre the slacks
            restorations, lowest, delta = (0, theta, 0.0) if theta < 0.5 * lowest else (restorations + 1, lowest, 0.0)
            if entries == 0:
                _recentre(it, barrier.mu, barrier.penalty)
            entries = 0
    return x, status, iteration, stationarity, violation


@compiled
def _begin(kernel, work, it, options, goal, barrier, x):
    """Restore and evaluate x; return (status, violation, largest residual at which only the merit decides)."""
    set_smoothing(kernel, work, barrier.mu)
    violation = restore(kernel, work, x)
    evaluate_all(kernel, work, x, goal, it.bounds, it.objectives, it.c)
    # the first slacks and multipliers
    if kernel.implied_slacks:
        reset_slacks(it.c, barrier.mu, barrier.penalty, it.s, it.t, it.r)
    else:
        shortest = min(options.least_slack, np.sqrt(barrier.mu))
        begin_slacks(it.c, barrier.mu, barrier.penalty, shortest, it.s, it.t, it.r)
    central_multipliers(it.s, barrier.mu, barrier.penalty, it.z)
    residuals = residual_sum(it.r, options)
    infeasible = options.filter_infeasible * max(1.0, residuals)
    total = 0.0
    for value in it.objectives:
        total += value
    for value in it.c:
        total += value
    if not np.isfinite(total):
        return NOT_FINITE, np.inf, infeasible
    return (VIOLATED, violation, infeasible) if violation > 0.0 else (ITERATION_LIMIT, np.inf, infeasible)


@compiled
def _recentre(it, mu, penalty):
    """Write the best slacks and the multipliers on the central path."""
    reset_slacks(it.c, mu, penalty, it.s, it.t, it.r)
    central_multipliers(it.s, mu, penalty, it.z)


@compiled
def _errors(kernel, work, it, goal, mu):
    """Return (stationarity, largest |s z − μ|, worst violation) at the linearised x.

    The first two are divided by the mean of large multipliers. Source: Wächter & Biegler 2006, Eq. 5 and 6.
    """
    total, complementarity, violation = 0.0, 0.0, 0.0
    for i in range(len(it.z)):
        total += it.z[i]
        complementarity = max(complementarity, abs(it.s[i] * it.z[i] - mu))
        violation = max(violation, -it.c[i])
    mean = max(1.0, total / (kernel.large_multiplier * max(1, len(it.z))))
    return _stationarity(kernel, work, it, goal) / mean, complementarity / mean, violation


@compiled
def _stationarity(kernel, work, it, goal):
    """Return the length of the reduced gradient of the Lagrangian."""
    weigh_objectives(goal, it.bounds, it.z, it.objective_weights)
    reduced_gradient(kernel, work, it.objective_weights, it.z, it.residual)
    prepare_multipliers(kernel, work, it.objective_weights)
    return residual_norm(kernel, it.residual)


@compiled
def _subproblem_solved(barrier, stationarity, complementarity, flat, it, options):
    """Return whether the errors of the barrier subproblem are within tolerances.

    Stationarity does not count if the merit is ``flat``, that is, cannot decrease much any more. Source: Wächter &
    Biegler 2006, Eq. 5.
    """
    tolerance, largest = options.barrier_tolerance * barrier.mu, 0.0
    for i in range(len(it.r)):
        largest = max(largest, abs(it.r[i]))
    feasible = largest <= max(tolerance, options.residual_tolerance)
    return (flat or stationarity <= max(tolerance, options.tolerance)) and complementarity <= tolerance and feasible


@compiled
def _soft_violation(barrier, options):
    """Return the largest violation due to the barrier: it is proportional to μ."""
    return options.soft_violation * barrier.mu / barrier.penalty


@compiled
def _next_subproblem(kernel, work, it, options, goal, barrier, x, worst, violation):
    """Return whether constraints are infeasible, and the next subproblem.

    The penalty grows, or the barrier falls until the ``worst`` error exceeds the tolerance.
    """
    mu, penalty, before, helpful = barrier
    if mu <= options.penalty_barrier and violation > _soft_violation(barrier, options):
        if violation <= 0.5 * before:
            before, helpful = violation, penalty
        elif penalty >= options.helpless_growth * helpful:
            return True, barrier
        penalty = options.penalty_factor * penalty
        _recentre(it, mu, penalty)
    else:
        mu = _next_barrier(mu, options)
        while mu > options.last_barrier and worst <= options.barrier_tolerance * mu:
            mu = _next_barrier(mu, options)
        if kernel.implied_slacks:
            reset_slacks(it.c, mu, penalty, it.s, it.t, it.r)
    if set_smoothing(kernel, work, mu):  # evaluate and linearise again with kinks smoothed for this barrier
        evaluate_all(kernel, work, x, goal, it.bounds, it.objectives, it.c)
        reset_slacks(it.c, mu, penalty, it.s, it.t, it.r)
        linearise(kernel, work, x)
        _stationarity(kernel, work, it, goal)
    return False, Barrier(mu, penalty, before, helpful)


@compiled
def _next_barrier(mu, options):
    """Return the next μ (Wächter & Biegler 2006, Eq. 7)."""
    return max(options.last_barrier, min(options.barrier_factor * mu, mu**options.barrier_power))
