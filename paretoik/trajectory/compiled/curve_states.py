"""The state of a motion's curve at its instants, and how it changes with that of the spline; compiled.

A motion is its spline s projected onto the path (``task.joint_curve``). At an instant the projection moves along the
columns of D = W² J(s)ᵀ, where W are the joint scales, and D stands still:

    q = s + D λ,   q̇ = ṡ + D μ,   q̈ = s̈ + D ν,   so that g = ġ = g̈ = 0 for the path equations g(q, t).

With K = D (J D)⁻¹, Π = I − K J, B = ∂ġ/∂q and C = ∂g̈/∂q, the implicit function theorem gives

    δq = Π (δs + δD λ),   δq̇ = Π (δṡ + δD μ) − K B δq,   δq̈ = Π (δs̈ + δD ν) − K (C δq + 2 B δq̇).

Second derivatives are those of the Lagrangian with the equations' multipliers: −Kᵀ times the gradient, term by term.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.autodiff.interpreter import run
from paretoik.compilation import compiled
from paretoik.task.compiled import newton, project_rates, solve


class Curve(NamedTuple):
    """What projects the instants of a task's spline: evaluators, targets and scales."""

    projects: bool  # False for motions of finite differences, whose state is that of their samples
    errors: tuple[np.ndarray, ...]  # of the task errors and their Jacobian at s and targets
    rates: tuple[np.ndarray, ...]  # of J, ġ and g̈
    slopes: tuple[np.ndarray, ...]  # of J, B and C
    turns: tuple[np.ndarray, ...]  # of ∂(Jᵀ λ)/∂s at s and λ
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
    directions: np.ndarray  # (instants, dof, rows): D
    multipliers: np.ndarray  # (3, instants, rows): λ, μ and ν
    on_path: np.ndarray  # (instants,): where not, the state is that of the spline
    gains: np.ndarray  # (instants, dof, rows): K
    bends: np.ndarray  # (2, instants, rows, dof): B and C
    chain: np.ndarray  # (instants, variables, variables): derivatives of the curve's state by that of the spline


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
        np.zeros((instants, n, rows)),
        np.zeros((3, instants, rows)),
        np.zeros(instants, dtype=np.bool_),
        np.zeros((instants, n, rows)),
        np.zeros((2, instants, rows, n)),
        np.zeros((instants, variables, variables)),
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
    spline, state, directions = work.spline, work.state, work.directions
    instants, n, rows = directions.shape
    places, values = np.empty((n + curve.targets.shape[1], instants)), np.empty((rows * (n + 2), instants))
    for p in range(instants):
        places[:n, p], places[n:, p] = spline[0, p], curve.targets[p]
        state[0, p] = spline[0, p]
    run(curve.errors, places, values[: rows * (n + 1)])
    for p in range(instants):
        for i in range(rows):
            for j in range(n):
                slope = values[rows + i * n + j, p]
                directions[p, j, i] = slope * curve.scales[j] ** 2 / curve.row_scales[i]
    errors, same_sheet, none = np.empty(instants), np.empty(instants, dtype=np.bool_), directions[:0]
    newton(curve.errors, curve.targets, directions, curve.row_scales, curve.retraction, state[0], errors, same_sheet)
    project_rates(
        curve.rates, work.inputs, values, curve.scales, spline, directions, none, none, state, work.multipliers
    )
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
    instants, n, rows = work.directions.shape
    slopes, turns = np.empty((3 * rows * n, instants)), np.empty((n * n, 3 * instants))
    places, matrix, right = np.empty((n + rows, 3 * instants)), np.empty((rows, rows)), np.empty(rows)
    run(curve.slopes, work.inputs, slopes)
    for o in range(3):
        for p in range(instants):
            places[:n, o * instants + p] = work.spline[0, p]
            places[n:, o * instants + p] = work.multipliers[o, p] / curve.row_scales
    run(curve.turns, places, turns)
    square, free, blocks = np.empty((n, n)), np.empty((n, n)), np.empty((3, 3, n, n))
    jacobian, along = np.empty((rows, n)), np.empty((rows, n))
    for p in range(instants):
        if not work.on_path[p]:
            _keep_spline(work, p)
            continue
        velocity, acceleration = work.bends[0, p], work.bends[1, p]
        directions, gain = work.directions[p], work.gains[p]
        for i in range(rows):
            for j in range(n):
                jacobian[i, j] = slopes[i * n + j, p]
                velocity[i, j], acceleration[i, j] = slopes[(rows + i) * n + j, p], slopes[(2 * rows + i) * n + j, p]
        for c in range(rows):
            for i in range(rows):
                right[i] = 1.0 if i == c else 0.0
                for k in range(rows):
                    matrix[i, k] = _row_column(jacobian, directions, i, k)
            solve(matrix, right)
            for j in range(n):
                gain[j, c] = 0.0
                for k in range(rows):
                    gain[j, c] += directions[j, k] * right[k]
        for i in range(n):
            for j in range(n):
                free[i, j] = (1.0 if i == j else 0.0) - _row_column(gain, jacobian, i, j)
        blocks[:] = 0.0
        for o in range(3):
            for i in range(n):
                for j in range(n):
                    turn = curve.scales[i] ** 2 * turns[i * n + j, o * instants + p]
                    square[i, j] = turn + (1.0 if i == j and o == 0 else 0.0)
            _add_product(free, square, 1.0, blocks[o, 0])
        blocks[1, 1] = blocks[2, 2] = free
        _add_bend(gain, velocity, -1.0, blocks[0, 0], along, blocks[1, 0])
        _add_bend(gain, acceleration, -1.0, blocks[0, 0], along, blocks[2, 0])
        _add_bend(gain, velocity, -2.0, blocks[1, 0], along, blocks[2, 0])
        _add_bend(gain, velocity, -2.0, free, along, blocks[2, 1])
        _write_chain(curve, blocks, work.chain[p])


@compiled
def _keep_spline(work, p):
    """Write the derivatives of an instant whose state is that of the spline."""
    work.gains[p], work.bends[:, p] = 0.0, 0.0
    for a in range(work.chain.shape[1]):
        for b in range(work.chain.shape[1]):
            work.chain[p, a, b] = 1.0 if a == b else 0.0


@compiled
def _row_column(left, right, i, j):
    total = 0.0
    for k in range(left.shape[1]):
        total += left[i, k] * right[k, j]
    return total


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
def _write_chain(curve, blocks, chain):
    """Write the derivatives of one instant, joints divided by their scales; jerks are those of the spline."""
    n, variables = len(curve.scales), len(chain)
    for o in range(min(variables // n, 3)):
        for k in range(o + 1):
            for i in range(n):
                unit = 1.0 / curve.scales[i]
                for j in range(n):
                    chain[o * n + i, k * n + j] = blocks[o, k, i, j] * curve.scales[j] * unit
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
def add_curve_multipliers(curve, work, gradient, multipliers):
    """Add the multipliers (3 · rows, instants) of g, ġ and g̈ that belong to a gradient by the curve's state.

    They leave no gradient along the directions D.
    """
    instants, n, rows = work.directions.shape
    orders, along, found = gradient.shape[0] // n, np.empty(n), np.zeros((3, rows))
    for p in range(instants):
        velocity, acceleration = work.bends[0, p], work.bends[1, p]
        found[:] = 0.0
        for o in range(min(orders, 3) - 1, -1, -1):
            for j in range(n):
                along[j] = gradient[o * n + j, p] / curve.scales[j]
                for i in range(rows):
                    if o == 1:
                        along[j] += 2 * velocity[i, j] * found[2, i]
                    elif o == 0:
                        along[j] += velocity[i, j] * found[1, i] + acceleration[i, j] * found[2, i]
            for i in range(rows):
                for j in range(n):
                    found[o, i] -= work.gains[p, j, i] * along[j]
                multipliers[o * rows + i, p] += found[o, i]
