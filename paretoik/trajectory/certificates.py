"""What is known of a motion on a front: that it keeps its limits, that it is critical, how objectives trade there.

Everything follows from the motion alone, never from what a solver says of itself. Objectives are divided by ``ranges``,
the nadir less the ideal of the run; directions are measured as RMS over time. See ``criticality``.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.linalg import qr

from paretoik.front.certificates import Certificates
from paretoik.nlp.conic import Cone, Constraints
from paretoik.nlp.criticality import Criticality, criticality
from paretoik.pareto.exchange_rates import ACTIVE, COUNTS, exchange_intervals, exchange_rates, weight_ratios
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.linearisation import MotionLinearisation, linearise
from paretoik.trajectory.transcription import MotionProgram, motion_program

BETWEEN = 4  # times finer than the samples
CURVED = 1e-7  # second derivative along a direction of length one, in ranges, below which it is taken for none
CRITICAL = 1e-6  # χ up to which a point counts as critical, so that its curvature says something
STEPS = (1e-2, 1e-3, 1e-4)  # rad (RMS) along a direction of descent


def certify(
    task: MotionTask, q: Float[np.ndarray, "points time dof"], ranges: Float[np.ndarray, " n_obj"]
) -> Certificates:
    """Return the certificates of motions on the path.

    Raises InvalidInput, naming it, where an objective or a limit has no derivative.
    """
    program, motions = motion_program(task), task.motion(q)
    every = [_certified(program, motion, ranges) for motion in q]
    signs = np.array([o.sign for o in task.objectives])
    weights = np.array([found.weights for found, *_ in every]).reshape(len(q), len(ranges))
    ratios = np.array([ratio for *_, ratio in every]).reshape(len(q), len(ranges), len(ranges), 2)
    return Certificates(
        violation=np.maximum(task.violations(motions).max(axis=1, initial=0.0), 0.0),
        violation_between=violation_between(task, motions),
        kkt_residual=np.array([found.value for found, *_ in every]),
        weights=weights,
        exchange_rates=exchange_rates(weights, ranges, signs),
        exchange_intervals=exchange_intervals(ratios, ranges, signs),
        status=np.array([status for _, status, _ in every], dtype=np.str_),
    )


def violation_between(task: MotionTask, motions: Motion) -> Float[np.ndarray, " points"]:
    """Return the worst violation of the interpolated and projected motions on a grid four times finer."""
    fine = task.resample(BETWEEN * (len(task.times) - 1) + 1)
    between = fine.motion(motions.at(fine.times))
    return np.maximum(fine.violations(between).max(axis=1, initial=0.0), 0.0)


def _certified(program: MotionProgram, q: np.ndarray, ranges: np.ndarray) -> tuple[Criticality, str, np.ndarray]:
    at, count = linearise(program, q), len(ranges)
    radius = at.unit
    bounded = np.flatnonzero(np.isfinite(program.upper))
    constraints = Constraints(
        unknowns=at.unknowns,
        values=np.concatenate([at.inequalities, program.upper[bounded] - at.objectives[bounded]]),
        jacobian=sparse.csr_array(sparse.vstack([at.jacobian, sparse.csr_array(-at.gradients[bounded])])),
        cones=at.cones,
    )
    found = criticality(at.gradients[:count] / ranges[:, None], constraints, radius)
    critical = found.value <= CRITICAL
    ratios = weight_ratios(at.gradients[:count] / ranges[:, None], constraints, found.weights)
    return found, _status(at, found, constraints, ranges, radius) if critical else "undetermined", ratios


def _status(
    at: MotionLinearisation, found: Criticality, constraints: Constraints, ranges: np.ndarray, radius: float
) -> str:
    """Return whether the curvature on the critical cone says minimum or saddle."""
    count, limits = len(ranges), len(at.inequalities)
    counts = found.weights >= COUNTS
    strong = found.multipliers > COUNTS
    weak = ~strong & (constraints.values <= ACTIVE)
    factors = np.zeros(len(at.program.totals))
    factors[:count] = found.weights / ranges
    factors[np.isfinite(at.program.upper)] += found.multipliers[limits:]
    table = at.hessian(factors, found.multipliers[:limits], found.cone_multipliers).toarray()
    held = [at.gradients[:count][counts] / ranges[counts, None], constraints.jacobian[strong].toarray()]
    for cone, pull in zip(at.cones, found.cone_multipliers, strict=True):
        slope, bent = _length(cone, at.gradients.shape[1])
        held.append(slope)
        table += np.linalg.norm(pull) * bent
    rows = np.concatenate(held)
    free = _null_space(rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300))
    bent = free.T @ table @ free
    if _definite(bent, CURVED / radius**2):
        return "minimum"
    values, vectors = np.linalg.eigh(bent)
    if values[0] * radius**2 >= -CURVED:
        return "minimum"
    direction = free @ vectors[:, 0]
    for sign in (1.0, -1.0):
        fits = np.all(constraints.jacobian[weak] @ (sign * direction) >= -1e-9)
        falls = np.all(at.gradients[:count][~counts] @ (sign * direction) <= 1e-9)
        if fits and falls and _dominated(at, sign * direction * radius, count):
            return "saddle"
    return "undetermined"


def _null_space(rows: np.ndarray) -> np.ndarray:
    basis, triangle, _ = qr(rows.T, pivoting=True)
    sizes = np.abs(np.diagonal(triangle))
    kept: np.ndarray = basis[:, np.count_nonzero(sizes > 1e-9 * sizes.max(initial=0.0)) :]
    return kept


def _definite(table: np.ndarray, margin: float) -> bool:
    """Return whether no direction has a second derivative below −margin; quickly, by trying."""
    try:
        np.linalg.cholesky(table + margin * np.eye(len(table)))
    except np.linalg.LinAlgError:
        return False
    return True


def _length(cone: Cone, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what ties the column of a cone to its length, to first order, and the length's second derivatives."""
    size, rows = float(np.linalg.norm(cone.values)), cone.rows.toarray()
    top = np.zeros((1, columns))
    top[0, cone.column] = 1.0
    if size <= ACTIVE:  # a length of nothing cannot change but by growing
        return np.concatenate([top, rows]), np.zeros((columns, columns))
    slope = (cone.values / size)[None] @ rows
    return top - slope, (rows.T @ rows - slope.T @ slope) / size


def _dominated(at: MotionLinearisation, direction: np.ndarray, count: int) -> bool:
    """Return whether a step along a direction gives a motion within the limits that is better in every objective."""
    task = at.program.task
    for length in STEPS:
        moved = at.x + length * at.displacement(direction)
        if task.cyclic:
            moved[-1] = moved[0]
        motion = task.motion(task.motion(moved).at(task.times))
        values = np.array([float(o(motion)) * o.sign for o in task.objectives])
        if np.all(values < at.objectives[:count]) and task.violations(motion).max(initial=0.0) <= 1e-8:
            return True
    return False
