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

import numpy as np

from paretoik.compilation.array_tuples import keep, refer
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.banded.elastic import (
    approach_central_path,
    begin_slacks,
    central_multipliers,
    complementarity_and_violation,
    merit_terms,
    reset_slacks,
    step_multipliers,
    step_slacks,
)
from paretoik.nlp.banded.kernel import (
    add_auxiliary,
    allocate_workspace,
    dimensions,
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
from paretoik.nlp.banded.newton import (
    Barrier,
    accept_trial,
    all_finite,
    allocate_iteration,
    evaluate_all,
    newton_step,
    residual_sum,
    search_direction,
    weigh_objectives,
)
from paretoik.nlp.linear_algebra import dot, finite_indices
from paretoik.nlp.program import CONVERGED, INTERRUPTED, ITERATION_LIMIT, NO_PROGRESS, NOT_FINITE, SINGULAR, VIOLATED

# Filter line search, compiled.


@compiled
def search_line(
    kernel, work, x, dx, length, slope, before, theta, infeasible, weights, rows, upper, barrier, entries, options,
    trial, it
):  # fmt: skip
    """Write the trial point of the longest accepted step; return (whether one is, merit, filter entries).

    A step whose predicted decrease is rounding is tried at full length only.
    """
    after, mu, penalty = before, barrier.mu, barrier.penalty
    for _ in range(1 if theta == 0.0 and is_negligible(slope, before, options) else options.halvings):
        if retract(kernel, work, x, dx, length, trial):
            evaluate_all(kernel, work, trial, rows, upper, it.bounds, it.trial_objectives, it.trial_c)
            if kernel.implied_slacks:
                reset_slacks(it.trial_c, mu, penalty, it.trial_s, it.trial_t, it.trial_r)
            else:
                step_slacks(it.trial_c, it.s, it.t, it.ds, it.dt, length, it.trial_s, it.trial_t, it.trial_r)
            after = dot(weights, it.trial_objectives) + merit_terms(it.trial_s, it.trial_t, mu, penalty)
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
    """Return whether the predicted decrease of the merit function is rounding."""
    return -slope <= options.flat_decrease * (1 + abs(before))


@compiled
def _filter_accepts(theta, before, trial_theta, after, slope, length, infeasible, filter_, entries, options):
    """Return whether a step is accepted, and the number of filter entries (Wächter & Biegler 2006, section 2.3).

    If there are no residuals, this is Armijo's condition.
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
    """Minimise weights · F from x subject to rows · F ≤ upper, until ``stop[0]`` is not 0.

    An infinite bound is no bound. Returns (x, status, iterations, F, multipliers of c, then of the finite bounds,
    stationarity, worst violation).
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
        problem, refer(work), refer(it), refer(options), x, weights, rows, upper, border, stop
    )
    for i in range(len(it.z)):
        it.z[i] *= scale
    keep(work)
    return remove_auxiliary(problem, x), status, iteration, it.objectives, it.z, stationarity, violation


@compiled
def _iterate(kernel, work, it, options, x, weights, rows, upper, border, stop):
    """Iterate from x; return (x, status, iterations, stationarity, worst violation)."""
    penalty = kernel.penalty * options.penalty
    barrier = Barrier(options.barrier, penalty, np.inf, penalty)
    trial, dx = x.copy(), np.zeros(x.shape)
    delta, flat, stalled, entries, restorations = 0.0, False, 0, 0, 0
    iteration, stationarity, lowest = 0, np.inf, np.inf
    status, violation, infeasible = _begin(kernel, work, it, options, barrier, x, rows, upper)
    for iteration in range(options.iterations + 1 if status == ITERATION_LIMIT else 0):
        if stop[0] != 0:
            status = INTERRUPTED
            break
        if not linearise(kernel, work, x):
            status = SINGULAR
            break
        # errors and the test of convergence (Wächter & Biegler 2006, Eq. 5)
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
        if solved:  # the next barrier or penalty (Eq. 7)
            stalled, entries = 0, 0
            hopeless, barrier = _next_subproblem(kernel, barrier, stationarity, complementarity, violation, it, options)
            if hopeless:
                status = VIOLATED
                break
            _smooth(kernel, work, it, barrier, x, weights, rows, upper)
        # Newton's step and the filter line search along it
        delta = newton_step(kernel, work, weights, rows, barrier, options, border, delta, it)
        if not np.isfinite(delta):
            status = NO_PROGRESS
            break
        length, slope = search_direction(kernel, work, weights, rows, barrier, options, dx, it)
        before = dot(weights, it.objectives) + merit_terms(it.s, it.t, barrier.mu, barrier.penalty)
        theta = residual_sum(it.r, options)
        flat = theta == 0.0 and _is_flat(slope, before, barrier, stalled, options)
        accepted, after, entries = search_line(
            kernel, work, x, dx, length, slope, before, theta, infeasible, weights, rows, upper, barrier, entries,
            options, trial, it
        )  # fmt: skip
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
        else:  # in place of a restoration phase: clear the filter, or recentre the slacks
            restorations, lowest, delta = (0, theta, 0.0) if theta < 0.5 * lowest else (restorations + 1, lowest, 0.0)
            if entries == 0:
                _recentre(it, barrier.mu, barrier.penalty)
            entries = 0
    return x, status, iteration, stationarity, violation


@compiled
def _begin(kernel, work, it, options, barrier, x, rows, upper):
    """Restore and evaluate x; return (status, violation, largest residual for which only the merit decides)."""
    set_smoothing(kernel, work, barrier.mu)
    violation = restore(kernel, work, x)
    evaluate_all(kernel, work, x, rows, upper, it.bounds, it.objectives, it.c)
    # the first slacks and multipliers
    if kernel.implied_slacks:
        reset_slacks(it.c, barrier.mu, barrier.penalty, it.s, it.t, it.r)
    else:
        shortest = min(options.least_slack, np.sqrt(barrier.mu))
        begin_slacks(it.c, barrier.mu, barrier.penalty, shortest, it.s, it.t, it.r)
    central_multipliers(it.s, barrier.mu, barrier.penalty, it.z)
    residuals = residual_sum(it.r, options)
    infeasible = options.filter_infeasible * max(1.0, residuals)
    if not all_finite(it.objectives, it.c):
        return NOT_FINITE, np.inf, infeasible
    return (VIOLATED, violation, infeasible) if violation > 0.0 else (ITERATION_LIMIT, np.inf, infeasible)


@compiled
def _recentre(it, mu, penalty):
    """Write the best slacks and the multipliers on the central path."""
    reset_slacks(it.c, mu, penalty, it.s, it.t, it.r)
    central_multipliers(it.s, mu, penalty, it.z)


@compiled
def _smooth(kernel, work, it, barrier, x, weights, rows, upper):
    """Smooth kinks for the current barrier, then evaluate and linearise again; do nothing without kinks."""
    if set_smoothing(kernel, work, barrier.mu):
        evaluate_all(kernel, work, x, rows, upper, it.bounds, it.objectives, it.c)
        reset_slacks(it.c, barrier.mu, barrier.penalty, it.s, it.t, it.r)
        linearise(kernel, work, x)
        _stationarity(kernel, work, weights, rows, it)


@compiled
def _is_flat(slope, before, barrier, stalled, options):
    """Return whether a step's predicted decrease is small relative to rounding or μ, or several steps stalled."""
    negligible = is_negligible(slope, before, options) or -slope <= options.flat_barrier * barrier.mu
    return negligible or stalled >= options.stalled_steps


@compiled
def _multiplier_scale(kernel, z):
    """Return the scale of errors: the mean of large multipliers (Wächter & Biegler 2006, Eq. 6)."""
    total = 0.0
    for i in range(len(z)):
        total += z[i]
    return max(1.0, total / (kernel.large_multiplier * max(1, len(z))))


@compiled
def _stationarity(kernel, work, weights, rows, it):
    """Return the length of the reduced gradient of the Lagrangian."""
    weigh_objectives(weights, rows, it.bounds, it.z, it.objective_weights)
    reduced_gradient(kernel, work, it.objective_weights, it.z, it.residual)
    prepare_multipliers(kernel, work, it.objective_weights)
    return residual_norm(kernel, it.residual)


@compiled
def _subproblem_solved(barrier, stationarity, complementarity, flat, it, options):
    """Return whether errors are small (Wächter & Biegler 2006, Eq. 5), or only rounding is left to gain."""
    tolerance, largest = options.barrier_tolerance * barrier.mu, 0.0
    for i in range(len(it.r)):
        largest = max(largest, abs(it.r[i]))
    feasible = largest <= max(tolerance, options.residual_tolerance)
    return (flat or stationarity <= max(tolerance, options.tolerance)) and complementarity <= tolerance and feasible


@compiled
def _soft_violation(barrier, options):
    """Return the largest violation that a barrier which is not yet low explains."""
    return options.soft_violation * barrier.mu / barrier.penalty


@compiled
def _final_status(barrier, violation, options):
    return CONVERGED if violation <= max(options.tolerance, _soft_violation(barrier, options)) else VIOLATED


@compiled
def _next_subproblem(kernel, barrier, stationarity, complementarity, violation, it, options):
    """Return whether the constraints cannot all be satisfied, and the next subproblem (penalty up or barrier down)."""
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
        while mu > options.last_barrier and max(stationarity, complementarity) <= options.barrier_tolerance * mu:
            mu = _next_barrier(mu, options)
        if kernel.implied_slacks:
            reset_slacks(it.c, mu, penalty, it.s, it.t, it.r)
    return False, Barrier(mu, penalty, before, helpful)


@compiled
def _next_barrier(mu, options):
    """Return the next μ (Wächter & Biegler 2006, Eq. 7)."""
    return max(options.last_barrier, min(options.barrier_factor * mu, mu**options.barrier_power))
