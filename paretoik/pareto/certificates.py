"""Certificates of points of a front: that each keeps its limits, that it is critical, how objectives trade there.

Everything follows from the point alone, never from what a solver says of itself. Objectives are divided by ``ranges``,
the nadir less the ideal of the run; the length of a direction is its RMS. See ``nlp.criticality``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import qr

from paretoik.arrays import Points
from paretoik.errors import EvaluationFailed, SolverFailed
from paretoik.front.certificates import Certificates
from paretoik.nlp.conic import Cone, Constraints
from paretoik.nlp.criticality import Criticality, criticality
from paretoik.nlp.program import Goal, Linearisation, Program, bounded
from paretoik.nlp.sqp import SqpOptions, minimise
from paretoik.pareto.exchange_rates import exchange_intervals, exchange_rates, weight_ratios
from paretoik.pareto.scalarisation import Observe


@dataclass(frozen=True, kw_only=True)
class CertificateOptions:
    """Tolerances of certificates, all without unit: objectives and limits are divided by their ranges.

    ``critical`` is χ up to which a point counts as critical, so that its curvature says something; ``curvature`` the
    second derivative along a direction of length one, below which it is taken for none; ``multiplier`` the share of all
    multipliers from which on one counts; ``active`` the slack up to which a limit is active; ``violation`` what counts
    as none; ``descent_steps`` the lengths that are tried along a direction of negative curvature. From the first,
    at most so many iterations of SQP lead back within all limits as ``restorations`` says.
    """

    critical: float = 1e-6
    curvature: float = 1e-7
    multiplier: float = 1e-6
    active: float = 1e-7
    violation: float = 1e-8
    descent_steps: tuple[float, ...] = (1e-2, 1e-3, 1e-4)
    restorations: int = 30


OPTIONS = CertificateOptions()


def certify(
    program: Program,
    x: Points,
    *,
    ranges: Float[np.ndarray, " n_obj"],
    signs: Float[np.ndarray, " n_obj"],
    violation_between: Float[np.ndarray, " points"],
    observe: Observe | None = None,
) -> Certificates:
    """Return the certificates of points of a program whose first objectives are those of the front.

    ``signs`` are −1 for objectives that are maximised. ``violation_between`` is that of limits where the program does
    not look, between samples. ``observe`` is called with what is done and with all.
    """
    count, n_obj = len(x), len(ranges)
    violation, residual, statuses = np.zeros(count), np.zeros(count), list[str]()
    weights, ratios = np.zeros((count, n_obj)), np.zeros((count, n_obj, n_obj, 2))
    for i, one in enumerate(x):
        at = program.linearise(one)
        gradients, constraints = at.gradients[:n_obj] / ranges[:, None], _constraints(program, at)
        result = criticality(gradients, constraints, at.unit)
        critical = result.value <= OPTIONS.critical
        statuses.append(_status(program, at, result, constraints, ranges) if critical else "undetermined")
        violation[i], residual[i], weights[i] = violation_at(program, at), result.value, result.weights
        ratios[i] = weight_ratios(gradients, constraints, result.weights)
        if observe is not None:
            observe(i + 1, count)
    return Certificates(
        violation=violation,
        violation_between=np.maximum(violation, violation_between),
        kkt_residual=residual,
        weights=weights,
        exchange_rates=exchange_rates(weights, ranges, signs),
        exchange_intervals=exchange_intervals(ratios, ranges, signs),
        status=np.array(statuses, dtype=np.str_),
    )


def criticality_at(program: Program, at: Linearisation, ranges: Float[np.ndarray, " n_obj"]) -> Criticality:
    """Return the criticality of a point, objectives divided by ``ranges``."""
    return criticality(at.gradients[: len(ranges)] / ranges[:, None], _constraints(program, at), at.unit)


def violation_at(program: Program, at: Linearisation) -> float:
    """Return the worst violation of equalities, limits and bounds at a point, as a share of their ranges."""
    return _violation(program, at.objectives, at.equalities, at.inequalities[: at.elastic])


def _violation(program: Program, objectives: np.ndarray, equalities: np.ndarray, inequalities: np.ndarray) -> float:
    bounds = float((objectives - program.upper).max(initial=-np.inf))
    return max(0.0, float(np.abs(equalities).max(initial=0.0)), -float(inequalities.min(initial=0.0)), bounds)


def _constraints(program: Program, at: Linearisation) -> Constraints:
    """Return all inequalities to first order, the program's own bounds on F among them."""
    size = len(program.upper)
    return bounded(at, Goal(weights=np.zeros(size), rows=np.eye(size), upper=program.upper))[0]


def _status(
    program: Program, at: Linearisation, result: Criticality, constraints: Constraints, ranges: np.ndarray
) -> str:
    """Return whether the Hessian of the Lagrangian on the critical cone says minimum or saddle."""
    gradients = at.gradients[: len(ranges)] / ranges[:, None]
    counts, strong = result.weights >= OPTIONS.multiplier, result.multipliers > OPTIONS.multiplier
    weak = ~strong & (constraints.values <= OPTIONS.active)
    hessian, cone_rows = _lagrangian(program, at, result, ranges)
    tangent = null_space(np.concatenate([gradients[counts], constraints.jacobian[strong].toarray(), *cone_rows]))
    projected = tangent.T @ hessian @ tangent
    if is_positive_definite(projected + OPTIONS.curvature / at.unit**2 * np.eye(len(projected))):
        return "minimum"
    values, vectors = np.linalg.eigh(projected)
    if values[0] * at.unit**2 >= -OPTIONS.curvature:
        return "minimum"
    direction = tangent @ vectors[:, 0]
    for sign in (1.0, -1.0):
        feasible = np.all(constraints.jacobian[weak] @ (sign * direction) >= -1e-9)
        descends = np.all(gradients[~counts] @ (sign * direction) <= 1e-9)
        if feasible and descends and _is_dominated(program, at, sign * at.unit * direction, len(ranges)):
            return "saddle"
    return "undetermined"


def _lagrangian(
    program: Program, at: Linearisation, result: Criticality, ranges: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the Hessian (columns, columns) of the Lagrangian, lengths of cones included, and the rows that fix these.

    On the critical cone the column of a cone changes as its length does.
    """
    count, finite = len(ranges), np.isfinite(program.upper)
    elastic, bounds, ties = np.split(result.multipliers, [at.elastic, at.elastic + np.count_nonzero(finite)])
    weights = np.zeros(len(program.upper))
    weights[:count] = result.weights / ranges
    weights[finite] += bounds
    hessian = at.hessian(weights, np.concatenate([elastic, ties]), result.cone_multipliers).toarray()
    rows = list[np.ndarray]()
    for cone, multiplier in zip(at.cones, result.cone_multipliers, strict=True):
        row, second = _length(cone, at.columns)
        rows.append(row)
        hessian += np.linalg.norm(multiplier) * second
    return hessian, rows


def null_space(rows: Float[np.ndarray, "rows columns"]) -> Float[np.ndarray, "columns free"]:
    """Return an orthonormal basis of the directions that no row looks along; rows count by direction, not length."""
    unit = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
    basis, triangle, _ = qr(unit.T, pivoting=True)
    sizes = np.abs(np.diagonal(triangle))
    free: np.ndarray = basis[:, np.count_nonzero(sizes > 1e-9 * sizes.max(initial=0.0)) :]
    return free


def is_positive_definite(matrix: Float[np.ndarray, "size size"]) -> bool:
    """Return whether a symmetric matrix is positive definite, by Cholesky's factorisation."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True


def _length(cone: Cone, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the row that ties the column of a cone to its length, and the length's second derivatives."""
    size, rows = float(np.linalg.norm(cone.values)), cone.rows.toarray()
    top = np.zeros((1, columns))
    top[0, cone.column] = 1.0
    if size <= OPTIONS.active:  # a length of zero can only grow
        return np.concatenate([top, rows]), np.zeros((columns, columns))
    slope = (cone.values / size)[None] @ rows
    return top - slope, (rows.T @ rows - slope.T @ slope) / size


def _is_dominated(program: Program, at: Linearisation, direction: np.ndarray, n_obj: int) -> bool:
    """Return whether a step along a direction leads to a feasible point that is better in every objective."""
    values, steps = at.objectives[:n_obj], [at.retract(length * direction) for length in OPTIONS.descent_steps]
    if any(x is not None and _is_better(program, x, values) for x in steps):
        return True
    if steps[0] is None:
        return False
    weights, upper = np.zeros(len(program.upper)), np.full(len(program.upper), np.inf)
    weights[:n_obj], upper[:n_obj] = 1.0, values
    goal = Goal(weights=weights, rows=np.eye(len(upper)), upper=upper)
    settings = SqpOptions(iterations=OPTIONS.restorations, radius=OPTIONS.descent_steps[0], corrections=3)
    try:
        x = minimise(program, steps[0], goal, settings).x
    except (SolverFailed, EvaluationFailed):
        return False
    return _is_better(program, x, values)


def _is_better(program: Program, x: np.ndarray, values: np.ndarray) -> bool:
    objectives, equalities, inequalities = program.evaluate(x)
    violation = _violation(program, objectives, equalities, inequalities)
    return bool(np.all(objectives[: len(values)] < values) and violation <= OPTIONS.violation)
