"""Certificates of front points: violation, criticality, and exchange rates of objectives.

A certificate follows only from the point, never from a solver's report. Objectives are divided by ``ranges``, the run's
nadir less its ideal; the length of a direction is its RMS. See ``nlp.criticality``. If a computation fails, only that
point is undetermined, with the reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy import sparse

from paretoik.arrays import Point, Points
from paretoik.errors import EvaluationFailed, SolverFailed
from paretoik.front.certificates import Certificates
from paretoik.nlp.convex_subproblem import is_positive_definite
from paretoik.nlp.criticality import (
    Criticality,
    active_set_criticality,
    criticality,
    eliminate,
    factorise_rows,
    quick_criticality,
    share_ranges,
    unit_rows,
)
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import (
    FEASIBLE,
    Constraints,
    Goal,
    InteriorPointOptions,
    Linearisation,
    Program,
    bounded,
    program_key,
    violation_at,
    violation_of,
)
from paretoik.pareto.scalarisation import Observe
from paretoik.runs.distribution import Lost, compute_each
from paretoik.runs.journal import Values
from paretoik.stop_flag import Interrupted, check_interruption


@dataclass(frozen=True, kw_only=True)
class CertificateOptions:
    """Tolerances without unit: objectives and limits are divided by their ranges."""

    critical: float = 1e-6  # largest χ of a critical point: only then do curvature and multipliers count
    resolved: float = 1e-3  # largest error of discretisation, as a share of a value, or of its range if that is more
    weight: float = 1e-6  # least weight that counts, as a share of all objectives' weights
    active: float = 1e-7  # largest slack of an active limit, as a share of its range
    unique: float = 1e-3  # largest relative width of an interval that one exchange rate represents
    # options of the second-order test:
    curvature: float = 1e-7  # least negative second derivative that counts, along a direction of length one
    multiplier: float = 1e-6  # least multiplier that counts, as a share of all multipliers
    tie_share: float = 1e-3  # the same for a row with an auxiliary variable, as a share of all rows with the variable
    least_multiplier: float = 1e-9  # least multiplier that counts at all
    descent_steps: tuple[float, ...] = (1e-2, 1e-3, 1e-4)  # lengths tried along a direction of negative curvature
    descents: tuple[InteriorPointOptions, ...] = (  # tried after the first step, until one finds a better point
        InteriorPointOptions(barrier=1e-6, radius=0.02),
        InteriorPointOptions(barrier=1e-4, radius=0.02),
    )
    met: float = 1e-4  # RMS length of a step; a direction ends if a limit or kink is within it
    slope: float = 1e-9  # largest fall of a weakly active limit, or rise of a weightless objective, that counts as 0
    dependent: float = 1e-9  # largest length that counts as 0, for rows scaled to length one
    names: int = 3  # largest number of limits and kinks that a reason names


OPTIONS = CertificateOptions()

# Second-order test of a critical point: the Hessian of the Lagrangian on the critical cone.
#
# The cone: ∇fᵢ·d = 0 if λᵢ > 0, ≤ 0 if λᵢ = 0; ∇c·d = 0 if a limit is strongly active, ≥ 0 if it is weakly active.
# Without the rows ∇fᵢ·d = 0 every concave piece of a front would count as a saddle. Source: Nocedal & Wright, section
# 12.5.


@dataclass(frozen=True, kw_only=True, eq=False)
class Curvature:
    """The result of the second-order test of a critical point."""

    status: str  # "minimum", "saddle" or "undetermined"; then ``reason`` says why
    reason: str = ""
    better: Point | None = None  # for a saddle, a point that is better in every objective


def undetermined(reason: str) -> Curvature:
    """Return the undetermined result, with its reason in one line."""
    return Curvature(status="undetermined", reason=" ".join(reason.split()))


def curvature_at(
    program: Program, at: Linearisation, result: Criticality, constraints: Constraints, ranges: np.ndarray
) -> Curvature:
    """Return the result of the second-order test of a critical point.

    A point is a saddle only if negative curvature leads to a point that is better in every objective.
    """
    gradients = at.gradients[: len(ranges)] / ranges[:, None]
    counts = result.weights >= OPTIONS.multiplier
    strong = result.multipliers > least_multipliers(constraints, result.multipliers)
    weak = ~strong & (constraints.values <= OPTIONS.active)
    # the Hessian (columns, columns) of the Lagrangian, with the second derivatives of the lengths in ``at.cones``, and
    # the rows that tie each length to its column: on the critical cone both change equally
    count, finite = len(ranges), np.isfinite(program.upper)
    elastic, bounds, ties = np.split(result.multipliers, [at.elastic, at.elastic + np.count_nonzero(finite)])
    weights = np.zeros(len(program.upper))
    weights[:count] = result.weights / ranges
    weights[finite] += bounds
    hessian = at.hessian(weights, np.concatenate([elastic, ties]), result.cone_multipliers).toarray()
    cone_rows = list[np.ndarray]()
    for cone, multiplier in zip(at.cones, result.cone_multipliers, strict=True):
        size, slopes = float(np.linalg.norm(cone.values)), cone.rows.toarray()
        top, second = np.zeros((1, at.columns)), np.zeros((at.columns, at.columns))
        top[0, cone.column] = 1.0
        if size <= OPTIONS.active:  # a length of zero can only grow
            cone_rows.append(np.concatenate([top, slopes]))
        else:
            slope = (cone.values / size)[None] @ slopes
            cone_rows.append(top - slope)
            second = (slopes.T @ slopes - slope.T @ slope) / size  # second derivatives of the length
        hessian += np.linalg.norm(multiplier) * second
    fixed = np.concatenate([gradients[counts], constraints.jacobian[strong].toarray(), *cone_rows])
    edges = np.concatenate([constraints.jacobian[weak].toarray(), -gradients[~counts]])  # no direction may lower these
    direction, curvature = _least_curved(fixed, hessian, at)
    if curvature >= -OPTIONS.curvature:
        return Curvature(status="minimum")
    directions = [direction]
    if len(edges):
        inner, inner_curvature = _least_curved(np.concatenate([fixed, edges]), hessian, at)
        directions += [inner] if inner_curvature < -OPTIONS.curvature else []
    signed = [sign * each for each in directions for sign in (1.0, -1.0)]
    allowed = [at.unit * each for each in signed if np.all(edges @ each >= -OPTIONS.slope)]
    better = _better_point(program, at, allowed, ranges)
    if better is not None:
        return Curvature(status="saddle", better=better)
    met = [~strong & (constraints.values < OPTIONS.met * np.abs(constraints.jacobian @ each)) for each in allowed]
    ends = len(directions) == 1 or (len(met) > 0 and all(rows.any() for rows in met))
    names = edge_names(program, at, np.any([weak, *met], axis=0), ~counts) if ends else ""
    end = f"that ends at {names}" if names else "in which no better point was found"
    return undetermined(f"curvature {curvature:.1e} along a direction {end}")


def least_multipliers(
    constraints: Constraints, multipliers: Float[np.ndarray, " inequalities"]
) -> Float[np.ndarray, " inequalities"]:
    """Return the least size at which each multiplier counts.

    Rows with a common auxiliary variable share its weight, so that smaller multipliers count.
    """
    auxiliary = abs(sparse.csc_array(constraints.jacobian)[:, constraints.unknowns :])
    if not auxiliary.shape[1]:
        return np.full(len(multipliers), OPTIONS.multiplier)
    totals = sparse.csr_array(auxiliary @ sparse.diags_array(auxiliary.T @ multipliers)).max(axis=1).toarray().ravel()
    sizes = np.clip(OPTIONS.tie_share * totals, OPTIONS.least_multiplier, OPTIONS.multiplier)
    return np.where(totals > 0.0, sizes, OPTIONS.multiplier)


def edge_names(
    program: Program, at: Linearisation, weak: Bool[np.ndarray, " inequalities"], weightless: Bool[np.ndarray, " n_obj"]
) -> str:
    """Return as text the weakly active limits, kinks, and objectives of weight 0."""
    bounds = int(np.count_nonzero(np.isfinite(program.upper)))
    rows = np.flatnonzero(weak)
    limits = [name for i in rows[rows < at.elastic] for name in program.inequality_names[i : i + 1]]  # not all have one
    totals = np.flatnonzero(np.isfinite(program.upper))
    limits += [program.objective_names[totals[i - at.elastic]] for i in rows if 0 <= i - at.elastic < bounds]
    kinks = [f"a kink of {name}" for name in program.kinked] if (rows >= at.elastic + bounds).any() else []
    objectives = [f"{program.objective_names[i]}, which has no weight" for i in np.flatnonzero(weightless)]
    names = list(dict.fromkeys([*kinks, *limits, *objectives]))
    more = [f"{len(names) - OPTIONS.names} more"] if len(names) > OPTIONS.names else []
    return ", ".join([*names[: OPTIONS.names], *more])


def _least_curved(fixed: np.ndarray, hessian: np.ndarray, at: Linearisation) -> tuple[np.ndarray, float]:
    """Return the direction of least curvature in the null space of ``fixed``, and this curvature.

    The curvature is inf if no direction has negative curvature.
    """
    tangent, unit = null_space(fixed, at.unknowns), at.unit
    projected = tangent.T @ hessian @ tangent
    if is_positive_definite(projected + OPTIONS.curvature / unit**2 * np.eye(len(projected))):
        return np.zeros(len(hessian)), np.inf
    values, vectors = np.linalg.eigh(projected)
    direction: np.ndarray = tangent @ vectors[:, 0]
    return direction, float(values[0] * unit**2)


def null_space(
    rows: Float[np.ndarray, "rows columns"], unknowns: int | None = None
) -> Float[np.ndarray, "columns free"]:
    """Return a basis of the rows' null space, orthonormal in the ``unknowns``.

    The columns after the unknowns (by default none) are auxiliary and are eliminated first, because their rows are
    sparse. The length of a row has no effect.
    """
    count = rows.shape[1]
    unit = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
    elimination = eliminate(unit, count if unknowns is None else unknowns)
    normals = unit_rows(elimination.reduced, OPTIONS.dependent)
    basis, _, _, rank = factorise_rows(normals, OPTIONS.dependent, mode="full")
    basis = basis[:, rank:]
    directions = np.zeros((count, basis.shape[1]))
    directions[elimination.free] = basis
    directions[elimination.columns] = -elimination.table[elimination.pivots][:, elimination.free] @ basis
    return directions


def _better_point(
    program: Program, at: Linearisation, directions: list[np.ndarray], ranges: np.ndarray
) -> Point | None:
    """Return a feasible point better in every objective; else None.

        minimise    Σ F̂(x)                     F̂: objectives divided by their ranges
        subject to  F̂(x) ≤ F̂(this point)

    If no step along a direction is better, this program is solved from the first step of each direction.
    """
    values, starts = at.objectives[: len(ranges)], list[Point]()
    for direction in directions:
        steps = [at.retract(length * direction) for length in OPTIONS.descent_steps]
        for x in steps:
            if x is not None and _is_better(program, x, values):
                return x
        starts += [x for x in steps[:1] if x is not None]
    rows = np.eye(len(ranges), len(program.upper)) / ranges[:, None]
    weights, upper = rows.sum(axis=0, keepdims=True), np.tile(rows @ at.objectives, (len(starts), 1))
    for options in OPTIONS.descents if starts else ():
        solutions = minimise(program, np.stack(starts), weights, upper, options, rows=rows)
        for i in np.argsort(solutions.objectives @ weights[0], kind="stable"):
            if _is_better(program, solutions.x[i], values):
                return np.asarray(solutions.x[i])
    return None


def _is_better(program: Program, x: Point, values: np.ndarray) -> bool:
    objectives, equalities, inequalities = program.evaluate(x)
    violation = violation_of(program, objectives, equalities, inequalities)
    return bool(np.all(objectives[: len(values)] < values) and violation <= FEASIBLE)


# Exchange rates of objectives from multipliers, and intervals if multipliers are not unique.


def exchange_rates(
    weights: Float[np.ndarray, "points n_obj"],
    ratios: Float[np.ndarray, "points n_obj n_obj 2"],
    ranges: Float[np.ndarray, " n_obj"],
    signs: Float[np.ndarray, " n_obj"],
) -> Float[np.ndarray, "points n_obj n_obj"]:
    """Return the exchange rates ∂f_j/∂f_i = −λ_i/λ_j, other objectives fixed.

    They are in natural units, in the user's own sign. The diagonal is 1. An entry is NaN if a weight is 0, or if the
    bounds of λ_i/λ_j are unknown or differ.
    """
    reliable, natural = np.where(weights >= OPTIONS.weight, weights, np.nan), ranges * signs
    rates = -reliable[:, :, None] / reliable[:, None, :] * natural[None, None, :] / natural[None, :, None]
    with np.errstate(invalid="ignore"):  # a bound may be infinite
        unique = ratios[..., 1] - ratios[..., 0] <= OPTIONS.unique * ratios[..., 0]
    rates[~unique] = np.nan
    i = np.arange(len(ranges))
    rates[:, i, i] = 1.0
    return rates


def exchange_intervals(
    ratios: Float[np.ndarray, "points n_obj n_obj 2"],
    ranges: Float[np.ndarray, " n_obj"],
    signs: Float[np.ndarray, " n_obj"],
) -> Float[np.ndarray, "points n_obj n_obj 2"]:
    """Return the lower and upper bounds of the rates ∂f_j/∂f_i, from those of λ_i/λ_j."""
    natural = ranges * signs
    rates = -ratios * (natural[None, :] / natural[:, None])[..., None]
    i = np.arange(len(ranges))
    rates[:, i, i] = 1.0
    return np.sort(rates, axis=-1)


def weight_ratios(
    gradients: Float[np.ndarray, "n_obj columns"], constraints: Constraints, weights: Float[np.ndarray, " n_obj"]
) -> Float[np.ndarray, "n_obj n_obj 2"]:
    """Return the range of λ_i/λ_j over all multipliers of a critical point.

    It is NaN if a weight is 0. If there are cones, multipliers are assumed to be unique. Raises SolverFailed.
    """
    reliable = np.where(weights >= OPTIONS.weight, weights, np.nan)
    ratios = reliable[:, None] / reliable[None, :]
    intervals = np.stack([ratios, ratios], axis=-1)
    if constraints.cones:
        return intervals
    active = constraints.jacobian[constraints.values <= OPTIONS.active].toarray()
    shares = share_ranges(gradients, active, constraints.unknowns)
    if shares is None:
        return intervals
    with np.errstate(divide="ignore"):
        ends = shares / np.where(1.0 - shares >= OPTIONS.weight, 1.0 - shares, 0.0)
    ends[shares < OPTIONS.weight] = 0.0
    within = np.stack([np.minimum(ends[..., 0], ratios), np.maximum(ends[..., 1], ratios)], axis=-1)
    return np.where(np.isnan(ratios)[..., None], np.nan, within)


# Certificates of a front's points.


@dataclass(frozen=True, kw_only=True, eq=False)
class Discretisation:
    """Errors of the objectives ``names``: differences from their values on the motion's curve."""

    names: Sequence[str]
    values: Float[np.ndarray, "points n_obj"]
    errors: Float[np.ndarray, "points n_obj"]
    # whether a minimum with a large error is "under-resolved"; False for finite differences, which define no curve
    judged: bool


def certify(
    program: Program | Sequence[Program],
    x: Points,
    *,
    ranges: Float[np.ndarray, " n_obj"],
    signs: Float[np.ndarray, " n_obj"],
    violation_between: Float[np.ndarray, " points"],
    exceeded: Sequence[str] = (),
    discretisation: Discretisation | None = None,
    observe: Observe | None = None,
) -> tuple[Certificates, list[Point | None]]:
    """Return the certificates of points, and for each point a better one if it is a saddle, else None.

    The better point is feasible and better in all objectives. The first objectives of a program are those of the front.
    After a signal the remaining points are undetermined.

    program: one program for all points, or one per point
    signs: −1 for maximised objectives, else 1
    violation_between: violation of limits between samples, which the program does not evaluate
    exceeded: for each point, the limit exceeded between samples, "" if none; a point that exceeds one is no minimum
    discretisation: errors of the objectives; a minimum with too large an error is "under-resolved"
    observe: function called with the number of certified points and of all points
    """
    count, n_obj = len(x), len(ranges)
    programs = program if isinstance(program, Sequence) else [program] * count
    common = programs[0] if count and all(each is programs[0] for each in programs) else None  # sent to workers once
    by_place = dict[int, Values]()
    with suppress(Interrupted):
        check_interruption()
        items = [(None if common is not None else each, one, ranges) for each, one in zip(programs, x, strict=True)]
        keys = [program_key("certificate", each, one, ranges) for each, one in zip(programs, x, strict=True)]
        for i, values in compute_each(_certify_point, common, items, keys):
            if isinstance(values, Lost):
                values = _unknown(programs[i], x[i], n_obj, values.cause)
            by_place[i] = values
            if observe is not None:
                observe(len(by_place), count)
    late = "interrupted before it was certified"
    certificates = [by_place[i] if i in by_place else _unknown(programs[i], x[i], n_obj, late) for i in range(count)]
    violation = np.array([each["violation"] for each in certificates], dtype=float).reshape(count)
    weights = np.array([each["weights"] for each in certificates]).reshape(count, n_obj)
    ratios = np.array([each["ratios"] for each in certificates]).reshape(count, n_obj, n_obj, 2)
    statuses = [str(each["curvature"][0]) for each in certificates]
    reasons = [str(each["curvature"][1]) for each in certificates]
    # minima with too large errors are under-resolved
    if discretisation is not None and discretisation.judged:
        shares = discretisation.errors / np.maximum(np.abs(discretisation.values), ranges)
        for i in np.flatnonzero(~(shares <= OPTIONS.resolved).all(axis=1)).tolist():
            if statuses[i] == "minimum":
                worst = int(np.argmax(shares[i]))
                statuses[i] = "under-resolved"
                name, share = discretisation.names[worst], 100 * shares[i, worst]
                reasons[i] = f"{name} differs by {share:.2g} % on the curve; more samples help"
    for i, words in enumerate(exceeded):
        if words and statuses[i] in ("minimum", "under-resolved"):
            statuses[i], reasons[i] = "undetermined", "; ".join(filter(None, (words, reasons[i])))
    certified = Certificates(
        violation=violation,
        violation_between=np.maximum(violation, violation_between),
        criticality=np.array([each["residual"] for each in certificates], dtype=float).reshape(count),
        weights=weights,
        exchange_rates=exchange_rates(weights, ratios, ranges, signs),
        exchange_intervals=exchange_intervals(ratios, ranges, signs),
        status=np.array(statuses, dtype=np.str_),
        reason=np.array(reasons, dtype=np.str_),
        discretisation_error=np.full((count, n_obj), np.nan) if discretisation is None else discretisation.errors,
    )
    return certified, [each.get("better") for each in certificates]


def confirmed_criticality(program: Program, x: Point) -> float:
    """Return the criticality of a program with one objective, by a convex program; NaN if that fails."""
    with suppress(Interrupted, SolverFailed, EvaluationFailed, np.linalg.LinAlgError):
        return criticality(*_first_order(program, program.linearise(x), np.ones(1))).value
    return np.nan


def criticality_at(program: Program, at: Linearisation, ranges: Float[np.ndarray, " n_obj"]) -> float:
    """Return the criticality of a point, or an upper bound of it if that is near 0."""
    return quick_criticality(*_first_order(program, at, ranges)).value


def criticality_bound(program: Program, at: Linearisation, ranges: Float[np.ndarray, " n_obj"]) -> float:
    """Return an upper bound of the criticality without a conic program.

    It is inf if it is not near 0 (``active_set_criticality``). If there are auxiliary columns, it is exact.
    """
    gradients, constraints, unit = _first_order(program, at, ranges)
    if gradients.shape[1] > at.unknowns:
        return criticality(gradients, constraints, unit).value
    result = active_set_criticality(gradients, constraints, unit)
    return np.inf if result is None else result.value


def weights_at(program: Program, x: Points, n_obj: int) -> Float[np.ndarray, "points n_obj"]:
    """Return the objectives' weights at points; NaN if a point is not critical."""
    weights = np.full((len(x), n_obj), np.nan)
    for row, one in zip(weights, x, strict=True):
        check_interruption()
        with suppress(SolverFailed, EvaluationFailed, np.linalg.LinAlgError):
            result = quick_criticality(*_first_order(program, program.linearise(one), np.ones(n_obj)))
            if result.value <= OPTIONS.critical:
                row[:] = result.weights
    return weights


def _certify_point(common: Program | None, point: tuple[Program | None, Point, Float[np.ndarray, " n_obj"]]) -> Values:
    """Return a certificate as plain arrays, by the point's own program or else the ``common`` one."""
    program, x, ranges = point[0] or common, *point[1:]
    assert program is not None
    n_obj = len(ranges)
    try:
        at = program.linearise(x)
        gradients, constraints, unit = _first_order(program, at, ranges)
        result = criticality(gradients, constraints, unit)
    except (SolverFailed, EvaluationFailed, np.linalg.LinAlgError) as fault:
        return _unknown(program, x, n_obj, str(fault))
    ratios = np.full((n_obj, n_obj, 2), np.nan)
    if result.value <= OPTIONS.critical:
        try:
            curvature = curvature_at(program, at, result, constraints, ranges)
        except (SolverFailed, EvaluationFailed, np.linalg.LinAlgError) as fault:
            curvature = undetermined(str(fault))
        try:
            ratios = weight_ratios(gradients, constraints, result.weights)
        except (SolverFailed, np.linalg.LinAlgError) as fault:
            curvature = replace(curvature, reason=curvature.reason or str(fault))
    else:
        kinks = ", ".join(program.kinks_at(x))
        side = f", by its derivatives on one side of a kink of {kinks}" if kinks else ""
        curvature = undetermined(f"criticality {result.value:.1e}: all objectives can still gain{side}")
    return _certificate(violation_at(program, at), result.weights, ratios, result.value, curvature)


def _unknown(program: Program, x: Point, n_obj: int, reason: str) -> Values:
    """Return the certificate of an undetermined point, with its violation if known."""
    try:
        violation = violation_of(program, *program.evaluate(x))
    except EvaluationFailed:
        violation = np.nan
    nothing = np.full((n_obj, n_obj, 2), np.nan)
    return _certificate(violation, nothing[0, :, 0], nothing, np.nan, undetermined(reason))


def _certificate(
    violation: float, weights: np.ndarray, ratios: np.ndarray, criticality: float, curvature: Curvature
) -> Values:
    """Return the parts of a certificate as arrays by name."""
    better = {} if curvature.better is None else {"better": curvature.better}
    words = np.array([curvature.status, curvature.reason], dtype=np.str_)
    numbers = {"violation": violation, "weights": weights, "ratios": ratios, "residual": criticality}
    return {**{name: np.asarray(value) for name, value in numbers.items()}, "curvature": words, **better}


def _first_order(
    program: Program, at: Linearisation, ranges: Float[np.ndarray, " n_obj"]
) -> tuple[Float[np.ndarray, "n_obj columns"], Constraints, float]:
    """Return gradients divided by ranges, all inequalities, and the unit of steps."""
    size = len(program.upper)
    constraints = bounded(at, Goal(weights=np.zeros(size), rows=np.eye(size), upper=program.upper))[0]
    return at.gradients[: len(ranges)] / ranges[:, None], constraints, at.unit
