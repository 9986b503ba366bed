"""Sequential quadratic programming over motions on the path: any objectives and limits, kinks included.

A step solves a convex model by Clarabel: exact second derivatives of the Lagrangian, made positive definite where they
are not; limits to first order, which give way at a price; kinks and peaks as what they are, the largest of smooth
pieces. A merit function of the true values decides on it; where it fails for the limits' curvature, a second-order
correction is tried. Source: Nocedal & Wright, Numerical Optimization, section 18.5; Fletcher 1982 for kinks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import SolverFailed
from paretoik.nlp.compiled.interior_point import CAPPED, CONVERGED, STUCK, VIOLATED
from paretoik.nlp.conic import Constraints
from paretoik.nlp.criticality import criticality
from paretoik.nlp.subproblem import Step, solve_subproblem
from paretoik.task.retraction import retract, row_space_basis
from paretoik.trajectory.linearisation import Linearised, Values, evaluated, linearised
from paretoik.trajectory.transcription import MotionProgram

PRICE, DEAREST = 100.0, 1e7  # of a violation, as a share of its range: at first, and when it is given up
ACCEPTED, GOOD = 1e-4, 0.75  # of the promised gain
MORE = 1.3  # times the promised gain
SHORTEST = 1e-10  # rad or m
LONGEST = 0.4  # rad or m that a joint may move in one step: too little to reach another branch unseen
SETTLED = 1e-15  # gain, as a share of the merit function, that is none
CRITICAL = 5e-7  # first-order gain where a model's rounding may end a search


class Found(NamedTuple):
    """What became of a start; see ``Polished``."""

    q: Float[np.ndarray, "time dof"]
    status: int
    iterations: int
    totals: Float[np.ndarray, " totals"]
    stationarity: float
    violation: float


@dataclass(frozen=True, kw_only=True, eq=False)
class _Point:
    """A motion on the path, its values, and how much its worst limit or cap is violated, as a share of its range."""

    q: Float[np.ndarray, "time dof"]
    values: Values
    gaps: Float[np.ndarray, " limits"]

    @property
    def violation(self) -> float:
        return max(0.0, -float(self.gaps.min(initial=np.inf)))


def sequential(
    program: MotionProgram,
    q: Float[np.ndarray, "time dof"],
    factors: Float[np.ndarray, " totals"],
    caps: Float[np.ndarray, " totals"],
    *,
    radius: float,
    iterations: int,
    tolerance: float,
) -> Found:
    """Minimise Σ factors · totals from a motion on the path, the totals kept below caps.

    ``radius`` [rad or m] is that of the first step.
    """
    at, price, multipliers = _point(program, q, caps), PRICE, None
    length, share, status, done, residual = radius, 1.0, CAPPED, 0, np.inf
    while done < iterations:
        done += 1
        local = linearised(program, at.q, at.values)
        model = _model(program, local, at, caps)
        hessian = share * _curvature(program, local, model, factors, multipliers)
        gradient = factors @ local.gradients
        accepted = False
        while not accepted and length > SHORTEST:
            try:
                taken = solve_subproblem(
                    gradient, hessian, model.constraints, elastic=model.yielding, radius=length, penalty=price
                )
            except SolverFailed:
                length /= 4
                continue
            before = float(factors @ at.values.totals) + price * at.violation
            curved = 0.5 * float(taken.step @ (hessian @ taken.step))
            promised = price * (at.violation - taken.violation) - float(gradient @ taken.step) - curved
            residual = float(np.linalg.norm((hessian @ taken.step)[: local.unknowns])) * np.sqrt(len(q))
            moved = float(np.abs(taken.step[: local.unknowns]).max(initial=0.0))
            if promised <= SETTLED * (1 + abs(before)) and moved < length * 0.99:
                status = CONVERGED
                break
            trial = _moved(program, local, at, taken.step, caps)
            gained = before - _worth(factors, price, trial)
            if gained < GOOD * promised and trial is not None:
                bent = _bent(program, local, model, at, trial, taken)
                again = _again(gradient, hessian, bent, model.yielding, length, price)
                corrected = None if again is None else _moved(program, local, at, again.step, caps)
                if again is not None and before - _worth(factors, price, corrected) > max(gained, 0.0):
                    trial, taken = corrected, again
                    gained = before - _worth(factors, price, corrected)
            accepted = trial is not None and gained >= ACCEPTED * promised
            if not accepted:
                length = min(length, moved) / 4
        if status == CONVERGED or not accepted:
            critical = status == CONVERGED or _critical(local, model, gradient)
            if at.violation > tolerance and price < DEAREST:
                price, length, status = 10 * price, max(radius, length), CAPPED
                continue
            status = (CONVERGED if critical else STUCK) if at.violation <= tolerance else VIOLATED
            break
        assert trial is not None
        at, multipliers = trial, taken
        if gained > MORE * promised:  # flattened concavity and kinks: the model is too stiff
            share = max(share / 4, 1e-6)
        elif gained < GOOD * promised:
            share = min(4 * share, 1.0)
        if gained >= GOOD * promised and moved > 0.9 * length:
            length = min(2 * length, LONGEST)
    return Found(at.q, status, done, at.values.totals, residual, at.violation)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Model:
    """The constraints of a step; the first ``yielding`` are limits and caps, in units of their ranges."""

    constraints: Constraints
    yielding: int
    capped: np.ndarray
    scales: Float[np.ndarray, " limits"]


def _point(program: MotionProgram, q: np.ndarray, caps: np.ndarray) -> _Point:
    values = evaluated(program, q)
    limits = len(program.sides) - program.kinks
    capped = np.flatnonzero(np.isfinite(caps))
    gaps = np.concatenate([values.gaps[:limits] / program.ranges[:limits], caps[capped] - values.totals[capped]])
    return _Point(q=q, values=values, gaps=gaps)


def _model(program: MotionProgram, local: Linearised, at: _Point, caps: np.ndarray) -> _Model:
    limits, capped = len(program.sides) - program.kinks, np.flatnonzero(np.isfinite(caps))
    scales, slopes = program.ranges[:limits], local.slopes.copy()
    shares = np.append(1.0 / scales, np.ones(slopes.shape[0] - limits))
    slopes.data *= np.repeat(shares, np.diff(slopes.indptr))
    if len(capped):
        between = sparse.csr_array(-local.gradients[capped])
        slopes = sparse.csr_array(sparse.vstack([slopes[:limits], between, slopes[limits:]]))
    constraints = Constraints(
        unknowns=local.unknowns,
        values=np.concatenate([at.gaps, np.maximum(local.gaps[limits:], 0.0)]),
        jacobian=slopes,
        cones=local.cones,
    )
    return _Model(constraints=constraints, yielding=limits + len(capped), capped=capped, scales=scales)


def _curvature(
    program: MotionProgram, local: Linearised, model: _Model, factors: np.ndarray, last: Step | None
) -> sparse.csr_array:
    """Return the second derivatives of the Lagrangian, concave directions made flat: the box bounds steps along them.

    Turning them round, or stiffening across the limits that bind, took two to five times as many steps where curvature
    comes from kinks.
    """
    weights, limits = factors.copy(), len(model.scales)
    forces = np.zeros(len(local.gaps))
    pulls: tuple[np.ndarray, ...] = ()
    if last is not None:
        weights[model.capped] += last.multipliers[limits : model.yielding]
        forces = np.concatenate([last.multipliers[:limits] / model.scales, last.multipliers[model.yielding :]])
        pulls = last.cone_multipliers
    plain = local.curvature(weights, forces, pulls)
    table = plain.toarray()
    used = np.flatnonzero(np.any(table != 0, axis=1) | (np.arange(len(table)) < local.unknowns))
    inner = table[np.ix_(used, used)]
    least = 1e-10 * max(float(np.abs(inner).max(initial=0.0)), 1e-12)
    if _definite(inner, least):
        return plain
    bent, directions = np.linalg.eigh(inner)
    return _embedded((directions * np.maximum(bent, 100 * least)) @ directions.T, used, len(table))


def _definite(table: np.ndarray, least: float) -> bool:
    try:
        np.linalg.cholesky(table + least * np.eye(len(table)))
    except np.linalg.LinAlgError:
        return False
    return True


def _embedded(inner: np.ndarray, used: np.ndarray, size: int) -> sparse.csr_array:
    rows, columns = np.nonzero(inner)
    return sparse.csr_array(sparse.coo_array((inner[rows, columns], (used[rows], used[columns])), shape=(size, size)))


def _moved(program: MotionProgram, local: Linearised, at: _Point, step: np.ndarray, caps: np.ndarray) -> _Point | None:
    """Return where a step leads, back on the path; None where it leaves the sheet of the self-motion manifold."""
    task, n = program.task, at.q.shape[1]
    q = at.q + local.displacement(step)
    if task.cyclic:
        q[-1] = q[0]
    if task.ends_at_rest:
        q[-1] = q[-2]
    targets = task.targets.copy()
    if task.cyclic:
        targets[-1] = targets[0]
    directions = row_space_basis(np.moveaxis(local.jacobian, 0, -1))
    found = retract(task.arm, task.tasks, q, targets, directions)
    if not found.on_path.all():
        return None
    q = found.q.reshape(-1, n)
    if task.start is not None:
        q[0] = task.start
    if task.cyclic:
        q[-1] = q[0]
    point = _point(program, q, caps)
    return point if np.isfinite(point.values.totals).all() else None


def _bent(
    program: MotionProgram, local: Linearised, model: _Model, at: _Point, trial: _Point, taken: Step
) -> Constraints:
    """Return the constraints with the curvature along a step made up for: the second-order correction.

    Limits, kinks and tops are what they are where the step led, slacks and tops being what the model took them for.
    """
    known, u, samples = model.constraints, local.unknowns, len(at.q)
    orders, limits = len(program.stencil.weights), len(model.scales)
    own, inputs = program.variables[orders * at.q.shape[1] :], trial.values.inputs.copy()
    inputs[own[: program.slacks]] = at.values.inputs[own[: program.slacks]] + taken.step[
        u : u + program.slacks * samples
    ].reshape(program.slacks, samples)
    tops = u + program.slacks * samples
    inputs[own[program.slacks :]] = (
        at.values.inputs[own[program.slacks :]] + taken.step[tops : tops + program.peaks, None]
    )
    every = np.concatenate([inputs[program.variables], program.value(inputs)[program.sums :]])
    which, sample = program.limited.T
    gaps = program.sides * (every[which, sample] - program.bounds)
    found, column = [gaps[:limits] / model.scales, trial.gaps[limits:], gaps[limits:]], tops + program.peaks
    for each, before, after in zip(program.wholes, at.values.parts, trial.values.parts, strict=True):
        for span in each.spans if len(each.groups) else ():
            if span.stop - span.start > 1:
                found.append(before[span].max() + taken.step[column] - after[span])
                column += 1
        column += not len(each.groups)
    return replace(known, values=np.concatenate(found) - known.jacobian @ taken.step)


def _again(
    gradient: np.ndarray, hessian: sparse.csr_array, bent: Constraints, yielding: int, length: float, price: float
) -> Step | None:
    try:
        return solve_subproblem(gradient, hessian, bent, elastic=yielding, radius=length, penalty=price)
    except SolverFailed:
        return None


def _critical(local: Linearised, model: _Model, gradient: np.ndarray) -> bool:
    """Return whether no direction gains more than rounding, to first order."""
    radius = np.sqrt(local.unknowns / local.normal.shape[2])
    return criticality(gradient[None], model.constraints, radius).value <= CRITICAL


def _worth(factors: np.ndarray, price: float, point: _Point | None) -> float:
    return np.inf if point is None else float(factors @ point.values.totals) + price * point.violation
