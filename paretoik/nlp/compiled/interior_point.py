"""A primal–dual interior-point method over motions on the path, compiled.

The unknowns are steps in the self-motion of every sample: q moves along the null space of the tasks' Jacobian and is
then led back onto the path, so that every iterate follows it. What is left is a problem in (dof − task rows) numbers a
sample whose exact second derivatives, the path's curvature included, are banded in time. Steps are Newton's, made
positive definite where they are not; a merit function guards them; limits give way at a price that grows until they
hold. Source: Nocedal & Wright, Numerical Optimization, chapters 3, 17 and 19; Wächter & Biegler 2006 for how the
barrier falls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation import compiled
from paretoik.nlp.compiled.arrowhead import factorised, solved
from paretoik.nlp.compiled.elastic import central, descent, off_centre, prices, pushed, step_multipliers
from paretoik.nlp.compiled.samples import (
    add_curvature,
    follow,
    frames,
    gather,
    moved,
    path_multipliers,
    reduce,
    retracted,
    spread,
)
from paretoik.nlp.compiled.tables import add, clear, finite, length, product, put, weighed

CONVERGED, CAPPED, STUCK, SINGULAR, VIOLATED = 0, 1, 2, 3, 4
LONGEST = 0.4  # rad or m that a joint may move in one step: enough, and too little to reach another branch unseen
ARMIJO = 1e-4
FLAT = 1e-15  # share of the merit function below which what Newton's step promises is rounding
ROUNDING = 1e-14  # of the merit function
STILL = 5  # steps at the last barrier that changed no more than rounding: there is no more to be had
HALVINGS = 40
SOFT = 100.0  # times barrier over price: by less is a limit violated because the barrier is not yet low
FIRM = 3e-3  # barrier from which on a limit that is still violated costs more, or proves that all of them cannot hold
HOPELESS = 100.0  # by so much has the price risen without halving the violation, when it is given up


class Compiled(NamedTuple):
    """A MotionProgram as compiled code takes it; see there, and ``samples`` for window, weights and place."""

    value: tuple[np.ndarray, ...]
    slope: tuple[np.ndarray, ...]
    slope_of: np.ndarray
    slope_by: np.ndarray
    curvature: tuple[np.ndarray, ...]
    second_i: np.ndarray
    second_j: np.ndarray
    track: tuple[np.ndarray, ...]
    window: np.ndarray
    weights: np.ndarray
    place: np.ndarray
    unknowns: int
    seam: int  # so many unknowns, the last, belong to the border
    stops: bool  # the last sample is the nearest to the one before
    ones: np.ndarray
    quadrature: np.ndarray
    inputs: np.ndarray
    multipliers: np.ndarray
    limited: np.ndarray  # (limits, 2): variable or row, and sample
    sides: np.ndarray  # (limits,): 1 a lower limit, −1 an upper
    bounds: np.ndarray  # (limits,)


class Rules(NamedTuple):
    """How a search goes: first and last barrier, price of a violation, tolerance of stationarity, iterations.

    Where the search is by quadratic programming, ``radius`` is that of its first step [rad or m].
    """

    barrier: float = 0.1
    last_barrier: float = 1e-13
    penalty: float = 1.0
    tolerance: float = 1e-8
    iterations: int = 150
    radius: float = 0.3


@compiled(what="the planner", seconds=15)
def minimise(p, q, factors, caps, rules):
    """Minimise Σ factors · sums over motions from q (time, dof), which is on the path, sums kept below caps.

    ``p`` is Compiled. Returns (q, status, iterations, sums, multipliers of the limits, then of the finite caps,
    stationarity, worst violation).
    """
    q, given = q.copy(), p.inputs.copy()
    samples, n = q.shape
    U, K, width = p.weights.shape[0] * n, len(factors), p.weights.shape[2]
    rows = p.multipliers[1] - p.multipliers[0]
    G, r = len(p.inputs) - p.multipliers[2], n - rows
    capped = finite(caps)
    size, borders, limits = p.unknowns - p.seam, p.seam + len(capped), len(p.sides)

    tracked = np.empty((rows + rows * n, samples))
    normal, steep = np.zeros((samples, n, r)), np.zeros((samples, n, rows))
    triangle = np.zeros((samples, rows, rows))
    values, slopes = np.empty((K + G, samples)), np.empty((K + G + len(p.slope_of), samples))
    seconds = np.empty((len(p.second_i), samples))
    f, trial_f, df = np.zeros(K), np.zeros(K), np.zeros(K)
    gaps, trial_gaps, changes = (
        np.zeros(limits + len(capped)),
        np.zeros(limits + len(capped)),
        np.zeros(limits + len(capped)),
    )
    z, forces = np.zeros(limits + len(capped)), np.zeros(limits + len(capped))
    by_row = np.zeros((U + G, samples))
    A, L = np.zeros((size, width * r)), np.zeros((size, width * r))
    B, X = np.zeros((borders, size)), np.zeros((borders, size))
    C, S = np.zeros((borders, borders)), np.zeros((borders, borders))
    grads, total = np.zeros((K + G, U, samples)), np.zeros((K, samples, n))
    of_u, of_q, du = np.zeros((U, samples)), np.zeros((samples, n)), np.zeros((U, samples))
    residual, step = np.zeros(p.unknowns), np.zeros(size + borders)
    dq, trial = np.zeros((samples, n)), q.copy()
    mu, penalty, last_delta = rules.barrier, rules.penalty, 0.0
    violated, helpful, flat, still = np.inf, rules.penalty, False, 0
    status, done, stationarity, worst = CAPPED, 0, np.inf, np.inf

    _evaluate(p, given, q, values, f, caps, capped, gaps)
    central(gaps, mu, penalty, z)
    for done in range(rules.iterations + 1):
        put(given, q)
        run(p.track, given, tracked)
        if not frames(tracked, normal, steep, triangle):
            status = SINGULAR
            break
        if p.stops:
            follow(normal, steep)
        run(p.slope, given, slopes)
        _gradients(p, slopes, K + G, grads, total)

        # The gradient of the Lagrangian, the multipliers of the path, and how far all is from being optimal.
        for i in range(limits):
            forces[i] = -z[i]
        _push(p, forces, grads[K:], by_row, of_u)
        for g in range(G):
            for s in range(samples):
                given[p.multipliers[2] + g, s] = by_row[U + g, s]
        clear(of_q)
        gather(of_u, p.ones, p.window, p.weights, of_q)
        for k in range(K):
            df[k] = factors[k]
        for e in range(len(capped)):
            df[capped[e]] += z[limits + e]
        for k in range(K):
            add(of_q, df[k], total[k])
            for s in range(samples):
                given[p.multipliers[1] + k, s] = df[k] * p.quadrature[s]
        reduce(of_q, normal, p.place, residual)
        path_multipliers(of_q, steep, triangle, given[p.multipliers[0] : p.multipliers[1]])
        stationarity = np.sqrt(samples) * length(residual)
        apart, worst = off_centre(gaps, z, mu, penalty)
        settled = (flat or stationarity <= max(10 * mu, rules.tolerance)) and apart <= 10 * mu
        if mu <= rules.last_barrier and settled and (flat or stationarity <= rules.tolerance):
            status = CONVERGED if worst <= max(rules.tolerance, SOFT * mu / penalty) else VIOLATED
            break
        if done == rules.iterations:
            break
        if settled and mu <= FIRM and worst > SOFT * mu / penalty:
            if worst <= 0.5 * violated:
                violated, helpful = worst, penalty
            elif penalty >= HOPELESS * helpful:
                status = VIOLATED
                break
            penalty = 10 * penalty
            central(gaps, mu, penalty, z)
        elif settled:
            mu = max(rules.last_barrier, min(0.2 * mu, mu**1.5))
            while mu > rules.last_barrier and max(stationarity, apart) <= 10 * mu:
                mu = max(rules.last_barrier, min(0.2 * mu, mu**1.5))

        # Newton's system.
        run(p.curvature, given, seconds)
        clear(A)
        clear(B)
        clear(C)
        _curvature(p, seconds, gaps, z, mu, penalty, grads[K:], normal, by_row, A, B, C)
        for i in range(limits):
            forces[i] = -pushed(gaps[i], z[i], mu, penalty)[1]
        _push(p, forces, grads[K:], by_row, of_u)
        clear(of_q)
        gather(of_u, p.ones, p.window, p.weights, of_q)
        for k in range(K):
            add(of_q, factors[k], total[k])
        for e in range(len(capped)):
            stiffness, push = pushed(gaps[limits + e], z[limits + e], mu, penalty)
            add(of_q, push, total[capped[e]])
            reduce(total[capped[e]], normal, p.place, residual)
            for i in range(size):
                B[p.seam + e, i] = residual[i]
            for i in range(p.seam):
                C[p.seam + e, i] = C[i, p.seam + e] = residual[size + i]
            C[p.seam + e, p.seam + e] = -1.0 / stiffness
        reduce(of_q, normal, p.place, residual)
        last_delta = _made_definite(A, B, C, L, X, S, p.seam, last_delta)
        if not np.isfinite(last_delta):
            status = STUCK
            break
        for i in range(size + borders):
            step[i] = -residual[i] if i < p.unknowns else 0.0
        solved(L, B, X, S, step)

        # How far the step may go, and how steeply it descends.
        alpha = min(1.0, LONGEST / max(moved(step, normal, p.place, dq), 1e-300))
        spread(dq, p.window, p.weights, du)
        slope = 0.0
        for k in range(K):
            df[k] = product(total[k], dq)
            slope += factors[k] * df[k]
        _changed(p, du, grads[K:], by_row, changes)
        for e in range(len(capped)):
            changes[limits + e] = -df[capped[e]]
        push, alpha = descent(gaps, changes, mu, penalty, alpha)
        slope = min(slope + push, 0.0)
        before, accepted = weighed(factors, f) + prices(gaps, mu, penalty), False
        flat = -slope <= FLAT * (1 + abs(before)) or still >= STILL
        for _ in range(HALVINGS):
            for s in range(samples):
                for j in range(n):
                    trial[s, j] = q[s, j] + alpha * dq[s, j]
            if p.stops:
                for j in range(n):  # a loop: assigning a slice compiles 30 functions more
                    trial[-1, j] = trial[-2, j]
            if retracted(p.track, given, trial, steep, triangle, tracked):
                _evaluate(p, given, trial, values, trial_f, caps, capped, trial_gaps)
                after = weighed(factors, trial_f) + prices(trial_gaps, mu, penalty)
                if after <= before + ARMIJO * alpha * slope + ROUNDING * abs(before):
                    accepted = True
                    still = still + 1 if mu <= rules.last_barrier and after >= before - ROUNDING * abs(before) else 0
                    break
            alpha *= 0.5
        if not accepted:
            if flat:
                continue
            status = STUCK
            break
        step_multipliers(gaps, changes, trial_gaps, mu, penalty, z)
        q, trial = trial, q
        f, trial_f = trial_f, f
        gaps, trial_gaps = trial_gaps, gaps
    return q, status, done, f, z, stationarity, worst


@compiled
def _evaluate(p, given, q, values, f, caps, capped, gaps):
    """Write sums f and the gaps of all limits, then of caps, at q."""
    U, K, limits = p.weights.shape[0] * q.shape[1], len(f), len(p.sides)
    spread(q, p.window, p.weights, given[:U])
    run(p.value, given, values)
    for k in range(K):
        f[k] = 0.0
        for s in range(q.shape[0]):
            f[k] += values[k, s] * p.quadrature[s]
    for i in range(limits):
        row, s = p.limited[i, 0], p.limited[i, 1]
        gaps[i] = p.sides[i] * ((given[row, s] if row < U else values[K + row - U, s]) - p.bounds[i])
    for e in range(len(capped)):
        gaps[limits + e] = caps[capped[e]] - f[capped[e]]


@compiled
def _gradients(p, slopes, functions, grads, total):
    """Write gradients by u (functions, variables, time), and those of the sums by q (sums, time, dof)."""
    for e in range(len(p.slope_of)):
        for s in range(slopes.shape[1]):
            grads[p.slope_of[e], p.slope_by[e], s] = slopes[functions + e, s]
    for k in range(len(total)):
        clear(total[k])
        gather(grads[k], p.quadrature, p.window, p.weights, total[k])


@compiled
def _push(p, forces, limited, by_row, of_u):
    """Write the gradient by u of Σ forces · gaps, and the forces on every variable and limited row (rows, time).

    ``limited`` are the gradients of the limited rows (rows, variables, time).
    """
    U, samples = of_u.shape
    clear(by_row)
    for i in range(len(p.sides)):
        by_row[p.limited[i, 0], p.limited[i, 1]] += p.sides[i] * forces[i]
    for a in range(U):
        for s in range(samples):
            of_u[a, s] = by_row[a, s]
        for g in range(len(limited)):
            for s in range(samples):
                of_u[a, s] += by_row[U + g, s] * limited[g, a, s]


@compiled
def _changed(p, du, limited, by_row, changes):
    """Write the first-order changes of all gaps where the variables change by du."""
    U, samples = du.shape
    for a in range(U):
        for s in range(samples):
            by_row[a, s] = du[a, s]
    for g in range(len(limited)):
        for s in range(samples):
            by_row[U + g, s] = 0.0
        for a in range(U):
            for s in range(samples):
                by_row[U + g, s] += limited[g, a, s] * du[a, s]
    for i in range(len(p.sides)):
        changes[i] = p.sides[i] * by_row[p.limited[i, 0], p.limited[i, 1]]


@compiled
def _curvature(p, seconds, gaps, z, mu, penalty, limited, normal, by_row, A, B, C):
    """Add up the second derivatives of the Lagrangian and the stiffness of the limits."""
    U, samples, r = p.weights.shape[0] * normal.shape[1], seconds.shape[1], normal.shape[2]
    phi, row = np.empty((U, U)), np.empty(U)
    local, half = np.zeros((U, p.weights.shape[2] * r)), np.zeros((U, p.weights.shape[2] * r))
    clear(by_row)
    for i in range(len(p.sides)):
        by_row[p.limited[i, 0], p.limited[i, 1]] += pushed(gaps[i], z[i], mu, penalty)[0]
    for s in range(samples):
        clear(phi)
        for e in range(len(p.second_i)):
            phi[p.second_i[e], p.second_j[e]] = phi[p.second_j[e], p.second_i[e]] = seconds[e, s]
        for a in range(U):
            phi[a, a] += by_row[a, s]
        for g in range(len(limited)):
            for a in range(U):
                row[a] = limited[g, a, s]
            for a in range(U):
                scaled = by_row[U + g, s] * row[a]
                for b in range(U):
                    phi[a, b] += scaled * row[b]
        add_curvature(s, phi, p.window, p.weights, normal, p.place, local, half, A, B, C)


@compiled
def _made_definite(A, B, C, L, X, S, seam, last_delta):
    """Factorise, with so much added to the diagonal that the inertia is right; return where to begin next time.

    Infinity says that no number of use makes it right: the matrix is not made of numbers.
    """
    delta, largest = 0.0, 0.0
    for i in range(A.shape[0]):
        largest = max(largest, abs(A[i, 0]))
    while not factorised(A, B, C, L, X, S, C.shape[0] - seam):
        grown = max(1e-9 * largest, last_delta / 4, 8 * delta, 1e-300)
        if not grown < 1e15 * largest:
            return np.inf
        for i in range(A.shape[0]):
            A[i, 0] += grown - delta
        for i in range(seam):
            C[i, i] += grown - delta
        delta = grown
    return delta if delta > 0 else last_delta / 16
