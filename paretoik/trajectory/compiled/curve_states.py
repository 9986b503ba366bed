"""The state of a motion's curve at its instants, and how it changes with that of the spline; compiled.

A motion is its spline s projected onto the path (``task.joint_curve``), along the columns of D = W² J(s)ᵀ where W are
the joint scales: q = s + D λ, so that the path equations g(q, t), ġ and g̈ vanish. With G = (J D)⁻¹, K = D G,
Π = I − K J, B = ∂ġ/∂q and C = ∂g̈/∂q the implicit function theorem gives, if multipliers are held first,

    δq₀ = δs + δD λ,                     δq = Π δq₀,                       δλ = −G J δq₀,
    δq̇₀ = δṡ + δ(D λ)˙ + Ḋ δλ,           δq̇ = Π δq̇₀ − K B δq,              δλ̇ = −G (J δq̇₀ + B δq),
    δq̈₀ = δs̈ + δ(D λ)¨ + D̈ δλ + 2 Ḋ δλ̇,  δq̈ = Π δq̈₀ − K (C δq + 2 B δq̇).

The derivatives by s, ṡ and s̈ are those of a function of s and t, differentiated by time: ∂q̇/∂ṡ = ∂q/∂s, and so on.

Second derivatives are those of the Lagrangian with multipliers of g, ġ and g̈ that leave no gradient by λ, λ̇ and λ̈.
If r is its gradient by q, q̇ and q̈, what turns with s is P = Σ r · (D λ)⁽ᵒ⁾: it adds the mixed derivatives
∂²P/∂s∂λ δλ twice. Those by s alone are left out: they count times λ, the spline's distance from the path.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation import compiled
from paretoik.task.compiled import newton, project_rates, solve, write_directions


class Curve(NamedTuple):
    """What projects the instants of a task's spline: evaluators, targets and scales."""

    projects: bool  # False for motions of finite differences, whose state is that of their samples
    errors: tuple[np.ndarray, ...]  # of the task errors and their Jacobian at s and targets
    normals: tuple[np.ndarray, ...]  # of J, J̇ and J̈ at s, ṡ and s̈
    rates: tuple[np.ndarray, ...]  # of J, ġ and g̈
    slopes: tuple[np.ndarray, ...]  # of J, B and C
    turns: tuple[np.ndarray, ...]  # of the slopes of Jᵀ λ, (Jᵀ λ)˙ and (Jᵀ λ)¨ by s
    twists: tuple[np.ndarray, ...]  # of the slopes of J ρ, (J ρ)˙ and (J ρ)¨ by s
    targets: np.ndarray  # (instants, numbers)
    inputs: np.ndarray  # (3 dof + 3 numbers, instants): targets and their derivatives, below room for the state
    row_scales: np.ndarray  # (rows,)
    scales: np.ndarray  # (dof,)
    retraction: tuple[float, float, int]  # settings of Newton's method
    on_path: float  # largest task error of a projected instant


class CurveWork(NamedTuple):
    """The state of a curve at its instants, and its derivatives."""

    inputs: np.ndarray  # as those of the curve
    spline: np.ndarray  # (3, instants, dof)
    state: np.ndarray  # (3, instants, dof)
    directions: np.ndarray  # (3, instants, dof, rows): D, Ḋ and D̈
    multipliers: np.ndarray  # (3, instants, rows): λ, λ̇ and λ̈
    on_path: np.ndarray  # (instants,): where not, the state is that of the spline
    gains: np.ndarray  # (3, instants, dof, rows): K = D G, Ḋ G and D̈ G
    bends: np.ndarray  # (3, instants, rows, dof): J, B and C
    chain: np.ndarray  # (instants, variables, variables): derivatives of the curve's state by that of the spline
    moves: np.ndarray  # (3, instants, rows, dof): derivatives of λ, λ̇ and λ̈ by s
    left: np.ndarray  # (3, instants, dof): gradient r of the Lagrangian by q, q̇ and q̈
    twist: np.ndarray  # (3, instants, dof, dof): Q₀, Q₁ and Q₂ of the mixed derivatives by the spline's state


@compiled
def allocate_curve(curve, variables):
    """Return the workspace for states of so many variables each."""
    instants, rows, n = curve.inputs.shape[1] if curve.projects else 0, len(curve.row_scales), len(curve.scales)
    spline = np.zeros((3, instants, n))
    spline[0] = np.nan  # none has been projected
    return CurveWork(
        curve.inputs.copy(),
        spline,
        np.zeros((3, instants, n)),
        np.zeros((3, instants, n, rows)),
        np.zeros((3, instants, rows)),
        np.zeros(instants, dtype=np.bool_),
        np.zeros((3, instants, n, rows)),
        np.zeros((3, instants, rows, n)),
        np.zeros((instants, variables, variables)),
        np.zeros((3, instants, rows, n)),
        np.zeros((3, instants, n)),
        np.zeros((3, instants, n, n)),
    )


@compiled
def project_instants(curve, work, u):
    """Overwrite the spline's state u (variables, instants) by the curve's, if the spline is near its path there."""
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
        _project(curve, work)
    for p in range(instants):
        for o in range(min(orders, 3) if work.on_path[p] else 0):
            for j in range(n):
                u[o * n + j, p] = state[o, p, j] / curve.scales[j]


@compiled
def _project(curve, work):
    """Write the state, and which instants are on the path, from the spline's state."""
    spline, state = work.spline, work.state
    _, instants, n = spline.shape
    write_directions(curve.normals, spline, curve.scales, work.directions)
    state[0] = spline[0]
    errors, same_sheet = np.empty(instants), np.empty(instants, dtype=np.bool_)
    newton(
        curve.errors,
        curve.targets,
        work.directions[0],
        curve.row_scales,
        curve.retraction,
        state[0],
        errors,
        same_sheet,
    )
    project_rates(curve.rates, work.inputs, curve.scales, spline, work.directions, state, work.multipliers)
    for p in range(instants):
        total = 0.0
        for o in range(3):
            for j in range(n):
                total += state[o, p, j]
        work.on_path[p] = same_sheet[p] and errors[p] <= curve.on_path and np.isfinite(total)


@compiled
def linearise_instants(curve, work):
    """Write the derivatives of the states that were last projected."""
    if not curve.projects:
        return
    _, instants, n, rows = work.directions.shape
    slopes, turns = np.empty((3 * rows * n, instants)), np.empty((3 * n * n, instants))
    places, inverse = np.empty((3 * (n + rows), instants)), np.empty((rows, rows))
    run(curve.slopes, work.inputs, slopes)
    for o in range(3):
        for p in range(instants):
            places[o * n : (o + 1) * n, p] = work.spline[o, p]
            places[3 * n + o * rows : 3 * n + (o + 1) * rows, p] = work.multipliers[o, p]
    run(curve.turns, places, turns)
    free, held, along = np.empty((n, n)), np.empty((3, n, n)), np.empty((rows, n))
    rates = np.empty((3, n, n))
    for p in range(instants):
        if not work.on_path[p]:
            _keep_spline(work, p)
            continue
        jacobian, velocity, acceleration = work.bends[0, p], work.bends[1, p], work.bends[2, p]
        gain, turn, bend, moves = work.gains[0, p], work.directions[1, p], work.directions[2, p], work.moves[:, p]
        for o in range(3):
            for i in range(rows):
                for j in range(n):
                    work.bends[o, p, i, j] = slopes[(o * rows + i) * n + j, p]
        _invert(jacobian, work.directions[0, p], inverse)
        work.gains[:, p] = 0.0
        for o in range(3):
            _add_product(work.directions[o, p], inverse, 1.0, work.gains[o, p])
        free[:] = 0.0
        _add_product(gain, jacobian, -1.0, free)
        rates[:], moves[:] = 0.0, 0.0
        for i in range(n):
            free[i, i] += 1.0
            for j in range(n):
                for o in range(3):
                    held[o, i, j] = curve.scales[i] ** 2 * turns[(o * n + i) * n + j, p]
            held[0, i, i] += 1.0
        _add_product(free, held[0], 1.0, rates[0])
        _move(inverse, jacobian, held[0], along, moves[0])
        _add_product(turn, moves[0], 1.0, held[1])
        _add_product(free, held[1], 1.0, rates[1])
        _add_bend(gain, velocity, -1.0, rates[0], along, rates[1])
        _move(inverse, jacobian, held[1], along, moves[1])
        _add_bend(inverse, velocity, -1.0, rates[0], along, moves[1])
        _add_product(bend, moves[0], 1.0, held[2])
        _add_product(turn, moves[1], 2.0, held[2])
        _add_product(free, held[2], 1.0, rates[2])
        _add_bend(gain, acceleration, -1.0, rates[0], along, rates[2])
        _add_bend(gain, velocity, -2.0, rates[1], along, rates[2])
        _move(inverse, jacobian, held[2], along, moves[2])
        _add_bend(inverse, acceleration, -1.0, rates[0], along, moves[2])
        _add_bend(inverse, velocity, -2.0, rates[1], along, moves[2])
        _write_chain(curve, rates, work.chain[p])


@compiled
def _invert(jacobian, directions, inverse):
    """Write G = (J D)⁻¹."""
    rows = len(inverse)
    matrix, right = np.empty((rows, rows)), np.empty(rows)
    for c in range(rows):
        matrix[:] = 0.0
        _add_product(jacobian, directions, 1.0, matrix)
        right[:] = 0.0
        right[c] = 1.0
        solve(matrix, right)
        inverse[:, c] = right


@compiled
def _move(inverse, jacobian, held, along, moved):
    """Write −G J times what the state changes by if multipliers are held."""
    along[:] = 0.0
    _add_product(jacobian, held, 1.0, along)
    _add_product(inverse, along, -1.0, moved)


@compiled
def _keep_spline(work, p):
    """Write the derivatives of an instant whose state is that of the spline."""
    work.gains[:, p], work.bends[:, p], work.moves[:, p] = 0.0, 0.0, 0.0
    for a in range(work.chain.shape[1]):
        for b in range(work.chain.shape[1]):
            work.chain[p, a, b] = 1.0 if a == b else 0.0


@compiled
def _add_product(left, right, factor, out):
    for i in range(left.shape[0]):
        for k in range(left.shape[1]):
            for j in range(right.shape[1]):
                out[i, j] += factor * left[i, k] * right[k, j]


@compiled
def _add_bend(gain, bend, factor, moves, along, out):
    """Add factor · gain bend moves; ``along`` is room for bend moves."""
    along[:] = 0.0
    _add_product(bend, moves, 1.0, along)
    _add_product(gain, along, factor, out)


@compiled
def _write_chain(curve, rates, chain):
    """Write the derivatives of one instant from ∂q/∂s, ∂q̇/∂s and ∂q̈/∂s, joints divided by their scales.

    Jerks are those of the spline.
    """
    n, variables = len(curve.scales), len(chain)
    for o in range(min(variables // n, 3)):
        for k in range(o + 1):
            factor = 2.0 if o == 2 and k == 1 else 1.0
            for i in range(n):
                unit = factor / curve.scales[i]
                for j in range(n):
                    chain[o * n + i, k * n + j] = rates[o - k, i, j] * curve.scales[j] * unit
    for a in range(3 * n, variables):
        chain[a, a] = 1.0


@compiled
def chain_directions(work, du):
    """Overwrite directions (states, instants) of the spline's state by those of the curve's; those behind keep them."""
    chain = work.chain
    states = chain.shape[1]
    column = np.empty(states)
    if len(du) > states:
        du[states:] = du[:states]
    for p in range(len(chain)):
        column[:] = du[:states, p]
        for a in range(len(column)):
            total = 0.0
            for b in range(len(column)):
                total += chain[p, a, b] * column[b]
            du[a, p] = total


@compiled
def chain_gradient(work, gradient, out):
    """Write a gradient by the spline's state, from one by the curve's and, behind it, by the spline's own."""
    chain = work.chain
    if not len(chain):
        out[:] = gradient
        return
    for p in range(len(chain)):
        for b in range(len(out)):
            out[b, p] = gradient[len(out) + b, p] if len(gradient) > len(out) else 0.0
        for a in range(len(out)):
            slope = gradient[a, p]
            if slope != 0.0:
                for b in range(len(out)):
                    out[b, p] += chain[p, a, b] * slope


@compiled
def curve_multipliers(curve, work, gradient, multipliers):
    """Write the multipliers (orders · rows, instants) of g, ġ and g̈ that belong to a gradient by the curve's state.

    They leave no gradient by λ, λ̇ and λ̈.
    """
    _, instants, n, rows = work.directions.shape
    orders, found = min(gradient.shape[0] // n, 3), np.zeros((3, rows))
    for p in range(instants):
        left = work.left[:, p]
        for o in range(orders - 1, -1, -1):
            for j in range(n):  # before g of this order has its part
                left[o, j] = gradient[o * n + j, p] / curve.scales[j]
                for higher in range(o + 1, orders):
                    factor = 2.0 if o == 1 else 1.0
                    for i in range(rows):
                        left[o, j] += factor * work.bends[higher - o, p, i, j] * found[higher, i]
            for i in range(rows):
                found[o, i] = 0.0
                for higher in range(o, orders):
                    factor = -2.0 if o == 1 and higher == 2 else -1.0
                    for j in range(n):
                        found[o, i] += factor * work.gains[higher - o, p, j, i] * left[higher, j]
                multipliers[o * rows + i, p] = found[o, i]
            for j in range(n):
                for i in range(rows):
                    left[o, j] += work.bends[0, p, i, j] * found[o, i]
    _write_twist(curve, work)


@compiled
def _write_twist(curve, work):
    """Write the mixed derivatives of P by the spline's state and multipliers, times how the latter move.

    P is the second derivative by time of ρᵀ W² Jᵀ λ, if ρ, ρ̇ and ρ̈ are r₂, r₁ / 2 and r₀. With L = ∂λ/∂s and
    U = ∂(J ρ)/∂s, it is the symmetric part of (2 Uᵀ L)⁽ᵒ⁾.
    """
    _, instants, n, rows = work.directions.shape
    places, slopes = np.empty((6 * n, instants)), np.empty((3 * rows * n, instants))
    for o in range(3):
        for p in range(instants):
            places[o * n : (o + 1) * n, p] = work.spline[o, p]
            for j in range(n):
                weight = curve.scales[j] ** 2 * (0.5 if o == 1 else 1.0)
                places[(3 + o) * n + j, p] = weight * work.left[2 - o, p, j]
    run(curve.twists, places, slopes)
    half = np.empty((n, n))
    for p in range(instants):
        for o in range(3):
            half[:] = 0.0
            for k in range(o + 1):
                factor = 2.0 if o == 2 and k == 1 else 1.0
                for i in range(rows):
                    for a in range(n):
                        slope = factor * slopes[((o - k) * rows + i) * n + a, p]
                        for b in range(n):
                            half[a, b] += slope * work.moves[k, p, i, b]
            for a in range(n):
                for b in range(n):
                    work.twist[o, p, a, b] = (half[a, b] + half[b, a]) * curve.scales[a] * curve.scales[b]


@compiled
def add_twist(work, p, phi):
    """Add to second derivatives by the spline's state what the turning of the directions adds at an instant."""
    n = work.twist.shape[2]
    for o in range(min(len(phi) // n, 3)):
        for k in range(min(len(phi) // n, 3 - o)):
            factor = 2.0 if o == 1 or k == 1 else 1.0
            for a in range(n):
                for b in range(n):
                    phi[o * n + a, k * n + b] += factor * work.twist[2 - o - k, p, a, b]
