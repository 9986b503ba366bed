"""The state of a motion's curve and its derivatives; compiled.

The derivatives are by the state of the motion's spline.

A motion is its spline s projected onto the path (``task.joint_curve``) along the columns of D = W² J(s)ᵀ, W the joint
scales: q = s + D λ, so that the path equations g(q, t), ġ and g̈ are 0. With G = (J D)⁻¹, K = D G, Π = I − K J,
B = ∂ġ/∂q and C = ∂g̈/∂q the implicit function theorem gives the following changes δ. Those with index 0 are changes
with the multiplier of the same order fixed.

    δq₀ = δs + δD λ,                     δq = Π δq₀,                       δλ = −G J δq₀,
    δq̇₀ = δṡ + δ(D λ)˙ + Ḋ δλ,           δq̇ = Π δq̇₀ − K B δq,              δλ̇ = −G (J δq̇₀ + B δq),
    δq̈₀ = δs̈ + δ(D λ)¨ + D̈ δλ + 2 Ḋ δλ̇,  δq̈ = Π δq̈₀ − K (C δq + 2 B δq̇).

The derivatives by s, ṡ and s̈ follow from those of a function of s and t, differentiated by time: ∂q̇/∂ṡ = ∂q/∂s, etc.

Second derivatives are those of the Lagrangian. Its multipliers of g, ġ and g̈ make its gradient by λ, λ̇ and λ̈ 0. If r
is its gradient by q, q̇ and q̈, the directions D add the term P = Σ r · (D λ)⁽ᵒ⁾, whose mixed derivatives ∂²P/∂s∂λ δλ
count twice. Second derivatives by s only are left out: they are proportional to λ, the spline's distance from the path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation.numba_cache import compiled
from paretoik.task.retraction_kernel import newton, project_rates, solve, write_directions


class Curve(NamedTuple):
    """Evaluators, targets and scales that project the instants of a task's spline."""

    projects: bool  # whether instants are projected; finite differences have only samples, which are on the path
    errors: tuple[np.ndarray, ...]  # evaluator of the task errors and their Jacobian at s and targets
    normals: tuple[np.ndarray, ...]  # evaluator of J, J̇ and J̈ at s, ṡ and s̈
    rates: tuple[np.ndarray, ...]  # evaluator of J, ġ and g̈
    slopes: tuple[np.ndarray, ...]  # evaluator of J, B and C
    turns: tuple[np.ndarray, ...]  # evaluator of the gradients of Jᵀ λ, (Jᵀ λ)˙ and (Jᵀ λ)¨ by s
    twists: tuple[np.ndarray, ...]  # evaluator of the gradients of J ρ, (J ρ)˙ and (J ρ)¨ by s
    targets: np.ndarray  # (instants, numbers)
    inputs: np.ndarray  # (3 dof + 3 numbers, instants): space for the state, then targets and their derivatives
    row_scales: np.ndarray  # (rows,)
    scales: np.ndarray  # (dof,)
    retraction: tuple[float, float, int]  # settings of Newton's method
    on_path: float  # largest task error at which a projected instant is on the path


class CurveWork(NamedTuple):
    """The state of a curve at its instants, and its derivatives."""

    inputs: np.ndarray  # inputs of the curve
    spline: np.ndarray  # (3, instants, dof)
    state: np.ndarray  # (3, instants, dof)
    directions: np.ndarray  # (3, instants, dof, rows): D, Ḋ and D̈
    multipliers: np.ndarray  # (3, instants, rows): λ, λ̇ and λ̈
    on_path: np.ndarray  # (instants,): whether the state is the projected one, else that of the spline
    inverse: np.ndarray  # (rows, rows, instants): G
    gains: np.ndarray  # (3, dof, rows, instants): K = D G, Ḋ G and D̈ G
    bends: np.ndarray  # (3, rows, dof, instants): J, B and C
    held: np.ndarray  # (3, dof, dof, instants): derivatives of s + D λ with λ and its rates fixed
    rates: np.ndarray  # (3, dof, dof, instants): derivatives of q, q̇ and q̈ by s
    moves: np.ndarray  # (3, rows, dof, instants): derivatives of λ, λ̇ and λ̈ by s
    chain: np.ndarray  # (variables, variables, instants): derivatives of the curve's state by that of the spline
    left: np.ndarray  # (3, dof, instants): gradient r of the Lagrangian by q, q̇ and q̈
    twist: np.ndarray  # (3, dof, dof, instants): Q₀, Q₁ and Q₂ of the mixed derivatives by the spline's state


@compiled
def allocate_curve(curve, variables):
    """Return the workspace for states with a number of variables each."""
    instants, rows, n = curve.inputs.shape[1] if curve.projects else 0, len(curve.row_scales), len(curve.scales)
    spline = np.zeros((3, instants, n))
    spline[0] = np.nan  # nothing is projected yet
    return CurveWork(
        curve.inputs.copy(),
        spline,
        np.zeros((3, instants, n)),
        np.zeros((3, instants, n, rows)),
        np.zeros((3, instants, rows)),
        np.zeros(instants, dtype=np.bool_),
        np.zeros((rows, rows, instants)),
        np.zeros((3, n, rows, instants)),
        np.zeros((3, rows, n, instants)),
        np.zeros((3, n, n, instants)),
        np.zeros((3, n, n, instants)),
        np.zeros((3, rows, n, instants)),
        np.zeros((variables, variables, instants)),
        np.zeros((3, n, instants)),
        np.zeros((3, n, n, instants)),
    )


@compiled
def project_instants(curve, work, u):
    """Project the spline's state u (variables, instants) onto its path, in place.

    Instants that are too far from the path stay as they are.
    """
    if not curve.projects:
        return
    n, instants, orders = len(curve.scales), u.shape[1], u.shape[0] // len(curve.scales)
    spline, state = work.spline, work.state
    same = True
    for o in range(min(orders, 3)):
        for p in range(instants):
            for j in range(n):
                same &= spline[o, p, j] == u[o * n + j, p] * curve.scales[j]
                spline[o, p, j] = u[o * n + j, p] * curve.scales[j]
    if not same:
        # the projected state, and which instants are on the path
        write_directions(curve.normals, spline, curve.scales, work.directions)
        state[0] = spline[0]
        errors, same_sheet = np.empty(instants), np.empty(instants, dtype=np.bool_)
        normal, scales = work.directions[0], curve.row_scales
        newton(curve.errors, curve.targets, normal, scales, curve.retraction, state[0], errors, same_sheet)
        project_rates(curve.rates, work.inputs, curve.scales, spline, work.directions, state, work.multipliers)
        for p in range(instants):
            total = 0.0
            for o in range(3):
                for j in range(n):
                    total += state[o, p, j]
            work.on_path[p] = same_sheet[p] and errors[p] <= curve.on_path and np.isfinite(total)
    for p in range(instants):
        for o in range(min(orders, 3) if work.on_path[p] else 0):
            for j in range(n):
                u[o * n + j, p] = state[o, p, j] / curve.scales[j]


@compiled
def linearise_instants(curve, work):
    """Write the derivatives of the last projected states; instants are the last axis."""
    if not curve.projects:
        return
    _, instants, n, rows = work.directions.shape
    held, rates, moves, gains, inverse = work.held, work.rates, work.moves, work.gains, work.inverse
    places = np.empty((3 * (n + rows), instants))
    free, along = np.zeros((n, n, instants)), np.empty((rows, n, instants))
    run(curve.slopes, work.inputs, work.bends.reshape((3 * rows * n, instants)))
    jacobian, velocity, acceleration = work.bends[0], work.bends[1], work.bends[2]
    turn, bend = work.directions[1].transpose((1, 2, 0)), work.directions[2].transpose((1, 2, 0))
    _write_gains(jacobian, work.directions, inverse, gains)
    # δ(s + D λ), δ(ṡ + (D λ)˙) and δ(s̈ + (D λ)¨) with multipliers fixed
    for o in range(3):
        for p in range(instants):
            places[o * n : (o + 1) * n, p] = work.spline[o, p]
            places[3 * n + o * rows : 3 * n + (o + 1) * rows, p] = work.multipliers[o, p]
    run(curve.turns, places, held.reshape((3 * n * n, instants)))
    for o in range(3):
        for i in range(n):
            held[o, i] *= curve.scales[i] ** 2
    for i in range(n):
        held[0, i, i] += 1.0
        free[i, i] = 1.0
    # δq = Π δq₀, δλ = −G J δq₀
    rates[:], moves[:] = 0.0, 0.0
    _add_product(gains[0], jacobian, -1.0, free)
    _add_product(free, held[0], 1.0, rates[0])
    _add_bend(inverse, jacobian, -1.0, held[0], along, moves[0])
    # δq̇₀ gets Ḋ δλ; δq̇ = Π δq̇₀ − K B δq, δλ̇ = −G (J δq̇₀ + B δq)
    _add_product(turn, moves[0], 1.0, held[1])
    _add_product(free, held[1], 1.0, rates[1])
    _add_bend(gains[0], velocity, -1.0, rates[0], along, rates[1])
    _add_bend(inverse, jacobian, -1.0, held[1], along, moves[1])
    _add_bend(inverse, velocity, -1.0, rates[0], along, moves[1])
    # δq̈₀ gets D̈ δλ + 2 Ḋ δλ̇; δq̈ = Π δq̈₀ − K (C δq + 2 B δq̇), δλ̈ = −G (J δq̈₀ + C δq + 2 B δq̇)
    _add_product(bend, moves[0], 1.0, held[2])
    _add_product(turn, moves[1], 2.0, held[2])
    _add_product(free, held[2], 1.0, rates[2])
    _add_bend(gains[0], acceleration, -1.0, rates[0], along, rates[2])
    _add_bend(gains[0], velocity, -2.0, rates[1], along, rates[2])
    _add_bend(inverse, jacobian, -1.0, held[2], along, moves[2])
    _add_bend(inverse, acceleration, -1.0, rates[0], along, moves[2])
    _add_bend(inverse, velocity, -2.0, rates[1], along, moves[2])
    # the derivatives of states from ∂q/∂s, ∂q̇/∂s and ∂q̈/∂s, joints divided by their scales; jerks are the spline's
    variables = len(work.chain)
    for o in range(min(variables // n, 3)):
        for k in range(o + 1):
            for i in range(n):
                factor = (2.0 if o == 2 and k == 1 else 1.0) / curve.scales[i]
                for j in range(n):
                    work.chain[o * n + i, k * n + j] = rates[o - k, i, j] * (factor * curve.scales[j])
    for a in range(3 * n, variables):
        work.chain[a, a] = 1.0
    for p in range(instants):
        if not work.on_path[p]:
            # the state of this instant is that of the spline
            work.gains[..., p], work.bends[..., p], work.moves[..., p], work.chain[..., p] = 0.0, 0.0, 0.0, 0.0
            for a in range(len(work.chain)):
                work.chain[a, a, p] = 1.0


@compiled
def _write_gains(jacobian, directions, inverse, gains):
    """Write G = (J D)⁻¹, D G, Ḋ G and D̈ G."""
    _, instants, n, rows = directions.shape
    matrix, right = np.empty((rows, rows)), np.empty(rows)
    for p in range(instants):
        for c in range(rows):
            for i in range(rows):
                for k in range(rows):
                    matrix[i, k] = 0.0
                    for j in range(n):
                        matrix[i, k] += jacobian[i, j, p] * directions[0, p, j, k]
                right[i] = 1.0 if i == c else 0.0
            solve(matrix, right)
            for i in range(rows):
                inverse[i, c, p] = right[i]
        for o in range(3):
            for j in range(n):
                for c in range(rows):
                    gains[o, j, c, p] = 0.0
                    for i in range(rows):
                        gains[o, j, c, p] += directions[o, p, j, i] * inverse[i, c, p]


@compiled
def _add_product(left, right, factor, out):
    """Add factor · left right at every instant."""
    for i in range(left.shape[0]):
        for k in range(left.shape[1]):
            for j in range(right.shape[1]):
                for p in range(out.shape[2]):
                    out[i, j, p] += factor * left[i, k, p] * right[k, j, p]


@compiled
def _add_bend(gain, bend, factor, moves, along, out):
    """Add factor · gain bend moves; ``along`` is workspace for bend moves."""
    along[:] = 0.0
    _add_product(bend, moves, 1.0, along)
    _add_product(gain, along, factor, out)


@compiled
def chain_directions(work, du):
    """Overwrite directions (states, instants) of the spline's state with the curve's.

    Rows after the states, if any, get the spline's.
    """
    states, _, instants = work.chain.shape
    if not instants:
        return
    by_spline = du[:states].copy()
    if len(du) > states:
        du[states:] = by_spline
    du[:states] = 0.0
    for a in range(states):
        for b in range(states):
            for p in range(instants):
                du[a, p] += work.chain[a, b, p] * by_spline[b, p]


@compiled
def chain_gradient(work, gradient, out):
    """Write the gradient by the spline's state.

    ``gradient`` is by the curve's state and, in further rows, by the spline's own state.
    """
    chain = work.chain
    if not chain.shape[2]:
        out[:] = gradient
        return
    out[:] = 0.0
    if len(gradient) > len(out):
        out[:] = gradient[len(out) :]
    for a in range(len(out)):
        for b in range(len(out)):
            for p in range(chain.shape[2]):
                out[b, p] += chain[a, b, p] * gradient[a, p]


@compiled
def curve_multipliers(curve, work, gradient, multipliers):
    """Write the multipliers (orders · rows, instants) of g, ġ and g̈.

    With them the gradient by λ, λ̇ and λ̈ is 0; the given gradient is by the curve's state.
    """
    _, instants, n, rows = work.directions.shape
    orders, left = min(gradient.shape[0] // n, 3), work.left
    for o in range(orders - 1, -1, -1):
        found = multipliers[o * rows : (o + 1) * rows]
        for j in range(n):  # the gradient without the part of g of this order
            for p in range(instants):
                left[o, j, p] = gradient[o * n + j, p] / curve.scales[j]
            for higher in range(o + 1, orders):
                factor = 2.0 if o == 1 else 1.0
                for i in range(rows):
                    for p in range(instants):
                        left[o, j, p] += factor * work.bends[higher - o, i, j, p] * multipliers[higher * rows + i, p]
        found[:] = 0.0
        for higher in range(o, orders):
            factor = -2.0 if o == 1 and higher == 2 else -1.0
            for j in range(n):
                for i in range(rows):
                    for p in range(instants):
                        found[i, p] += factor * work.gains[higher - o, j, i, p] * left[higher, j, p]
        for j in range(n):
            for i in range(rows):
                for p in range(instants):
                    left[o, j, p] += work.bends[0, i, j, p] * found[i, p]
    _write_twist(curve, work)


@compiled
def _write_twist(curve, work):
    """Write the mixed derivatives of P by the spline's state and λ, times ∂λ by this state.

    P is the second derivative by time of ρᵀ W² Jᵀ λ, if ρ, ρ̇ and ρ̈ are r₂, r₁ / 2 and r₀. With L = ∂λ/∂s and
    U = ∂(J ρ)/∂s, the result is the symmetric part of (2 Uᵀ L)⁽ᵒ⁾.
    """
    _, instants, n, rows = work.directions.shape
    places, slopes = np.empty((6 * n, instants)), np.empty((3, rows, n, instants))
    for o in range(3):
        for j in range(n):
            weight = curve.scales[j] ** 2 * (0.5 if o == 1 else 1.0)
            places[o * n + j] = work.spline[o, :, j]
            places[(3 + o) * n + j] = weight * work.left[2 - o, j]
    run(curve.twists, places, slopes.reshape((3 * rows * n, instants)))
    half = np.empty((n, n, instants))
    for o in range(3):
        half[:] = 0.0
        for k in range(o + 1):
            factor = 2.0 if o == 2 and k == 1 else 1.0
            for i in range(rows):
                for a in range(n):
                    for b in range(n):
                        for p in range(instants):
                            half[a, b, p] += factor * slopes[o - k, i, a, p] * work.moves[k, i, b, p]
        for a in range(n):
            for b in range(n):
                work.twist[o, a, b] = (half[a, b] + half[b, a]) * (curve.scales[a] * curve.scales[b])


@compiled
def add_twist(work, p, phi):
    """Add the terms of changing directions D to second derivatives by the spline's state."""
    n = work.twist.shape[1]
    for o in range(min(len(phi) // n, 3)):
        for k in range(min(len(phi) // n, 3 - o)):
            factor = 2.0 if o == 1 or k == 1 else 1.0
            for a in range(n):
                for b in range(n):
                    phi[o * n + a, k * n + b] += factor * work.twist[2 - o - k, a, b, p]
