"""Second-order test of a critical point: the Hessian of the Lagrangian on the critical cone.

The cone: ∇fᵢ·d = 0 if λᵢ > 0, ≤ 0 if λᵢ = 0; ∇c·d = 0 if a limit is strongly active, ≥ 0 if it is weakly active.
Without the rows ∇fᵢ·d = 0 every concave piece of a front would count as a saddle. Source: Nocedal & Wright, section
12.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy import sparse

from paretoik.arrays import Point
from paretoik.nlp.convex_subproblem import is_positive_definite
from paretoik.nlp.criticality import Criticality, eliminate, factorise_rows, unit_rows
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import FEASIBLE, Constraints, InteriorPointOptions, Linearisation, Program, violation_of


@dataclass(frozen=True, kw_only=True)
class CurvatureOptions:
    """Tolerances without unit: objectives and limits are divided by their ranges."""

    curvature: float = 1e-7  # least second derivative along a direction of length one that counts
    multiplier: float = 1e-6  # least multiplier that counts, as a share of all
    tie_share: float = 1e-3  # the same for a tie, among the ties of its slack or epigraph variable
    least_multiplier: float = 1e-9  # least multiplier that counts at all
    active: float = 1e-7  # largest slack of an active limit
    descent_steps: tuple[float, ...] = (1e-2, 1e-3, 1e-4)  # lengths tried along a direction of negative curvature
    descents: tuple[InteriorPointOptions, ...] = (  # tried from the first step until one leads to a better point
        InteriorPointOptions(barrier=1e-6, radius=0.02),
        InteriorPointOptions(barrier=1e-4, radius=0.02),
    )
    met: float = 1e-4  # RMS length of a step: a limit or kink within it ends a direction
    slope: float = 1e-9  # most negative rate of a weakly active limit or an objective without weight, along a direction
    dependent: float = 1e-9  # of rows of length one: smaller lengths count as 0
    names: int = 3  # largest number of limits and kinks that a reason names


OPTIONS = CurvatureOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Curvature:
    """The result of the second-order test of a critical point.

    status: "minimum", "saddle" or "undetermined"
    reason: why it is undetermined
    better: for a saddle, a point that is better in every objective
    """

    status: str
    reason: str = ""
    better: Point | None = None


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
    # the Hessian (columns, columns) of the Lagrangian with lengths of cones, and the rows that fix those. On the
    # critical cone a cone's column changes with its length
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
            second = (slopes.T @ slopes - slope.T @ slope) / size  # of the length
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
    """Return the least size at which each multiplier counts; ties share the weight of their column."""
    auxiliary = abs(sparse.csc_array(constraints.jacobian)[:, constraints.unknowns :])
    if not auxiliary.shape[1]:
        return np.full(len(multipliers), OPTIONS.multiplier)
    totals = sparse.csr_array(auxiliary @ sparse.diags_array(auxiliary.T @ multipliers)).max(axis=1).toarray().ravel()
    sizes = np.clip(OPTIONS.tie_share * totals, OPTIONS.least_multiplier, OPTIONS.multiplier)
    return np.where(totals > 0.0, sizes, OPTIONS.multiplier)


def edge_names(
    program: Program, at: Linearisation, weak: Bool[np.ndarray, " inequalities"], weightless: Bool[np.ndarray, " n_obj"]
) -> str:
    """Return the names of weakly active limits, kinks and objectives without weight, without repeats."""
    bounds = int(np.count_nonzero(np.isfinite(program.upper)))
    rows = np.flatnonzero(weak)
    limits = [name for i in rows[rows < at.elastic] for name in program.inequality_names[i : i + 1]]  # a few have none
    totals = np.flatnonzero(np.isfinite(program.upper))
    limits += [program.objective_names[totals[i - at.elastic]] for i in rows if 0 <= i - at.elastic < bounds]
    kinks = [f"a kink of {name}" for name in program.kinked] if (rows >= at.elastic + bounds).any() else []
    objectives = [f"{program.objective_names[i]}, which has no weight" for i in np.flatnonzero(weightless)]
    names = list(dict.fromkeys([*kinks, *limits, *objectives]))
    more = [f"{len(names) - OPTIONS.names} more"] if len(names) > OPTIONS.names else []
    return ", ".join([*names[: OPTIONS.names], *more])


def _least_curved(fixed: np.ndarray, hessian: np.ndarray, at: Linearisation) -> tuple[np.ndarray, float]:
    """Return the direction of least curvature in the null space of ``fixed``, and that curvature; ∞ if positive."""
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
    """Return a basis of the null space of rows, orthonormal in the first ``unknowns`` columns (default all).

    Auxiliary columns, which follow those, are eliminated first: their rows are sparse. Rows count by direction, not
    length.
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
    """Return a feasible point that is better in every objective, if steps along the directions lead to one.

        minimise    Σ F̂(x)                     F̂: objectives divided by their ranges
        subject to  F̂(x) ≤ F̂(this point)

    This program is solved from the first step of each direction if no step itself is better.
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
