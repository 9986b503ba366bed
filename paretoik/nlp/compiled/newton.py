"""Newton's step of the interior-point method, and the direction in which it leads; compiled."""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled
from paretoik.nlp.compiled.array_loops import clear, dot
from paretoik.nlp.compiled.bordered_cholesky import factorise, solve
from paretoik.nlp.compiled.elastic import barrier_terms, limit_implied_step, limit_step, newton_slacks
from paretoik.nlp.compiled.iteration import weigh_objectives
from paretoik.nlp.compiled.kernel_steps import assemble, directional_derivatives, expand_step, reduced_gradient


@compiled
def newton_step(kernel, work, weights, rows, barrier, options, border, delta, it):
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
    """Factorise with the least of growing multiples of the identity that gives the right inertia; return that.

    The first is a share ``least`` of the largest entry, or what was added before. Nocedal & Wright, algorithm 3.3.
    Infinity says that none does: the matrix is not finite.
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
