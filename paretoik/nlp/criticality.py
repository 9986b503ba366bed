"""How much all objectives can gain at once, to first order: the criticality χ of a point.

maximise    χ
subject to  −∇fᵢ·d − χ ≥ 0 for every objective
            c + J d ≥ 0, c at least 0
            ‖d‖ ≤ radius, and cones

χ is 0 at a Pareto-critical point, positive elsewhere. It is the convex subproblem of ``nlp.subproblem``, stated in
cvxpy and solved by Clarabel: the elastic inequalities are the objectives' gains, and t = −χ. Source: Fliege & Svaiter
2000, Eq. 2, with a ball in place of their quadratic term.

Any λ ≥ 0, Σλ = 1, and μ ≥ 0 bound it from above, by weak duality:

    χ ≤ radius · ‖Σ λᵢ ∇fᵢ − Jᵀ μ‖ + μ·c

If the active inequalities alone have multipliers that bound it by next to nothing, and no others do, these are exact
(nonnegative least squares: Lawson & Hanson 1974, chapter 23). Searches take this bound for χ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import nnls

from paretoik.errors import SolverFailed
from paretoik.nlp.canonical import Pattern
from paretoik.nlp.conic import Constraints, dense_rows, stack_rows
from paretoik.nlp.subproblem import subproblem_of
from paretoik.stop_flag import check_interruption


@dataclass(frozen=True, kw_only=True)
class CriticalityOptions:
    """How the criticality is computed; no field has a unit."""

    near_share: float = 0.01  # of the radius: inequalities that no step so short reaches are left out at first
    gain_tolerance: float = 1e-10  # of the steepest gradient's length: a gain that is as good as 0
    active: float = 1e-7  # slack up to which an inequality is active
    bound: float = 1e-8  # of the steepest gradient's length times the radius: a bound of χ that stands for it
    singular: float = 1e-7  # singular value that counts as none, of gradients of length one
    solver_tolerances: tuple[float, ...] = (1e-11, 1e-9)  # of Clarabel's gaps and infeasibilities, until one is met


OPTIONS = CriticalityOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Criticality:
    """``value`` χ, the step that attains it, ``weights`` λ of the objectives, Σλ = 1, and multipliers μ of the rest."""

    value: float
    step: Float[np.ndarray, " columns"]
    weights: Float[np.ndarray, " objectives"]
    multipliers: Float[np.ndarray, " inequalities"]
    cone_multipliers: tuple[np.ndarray, ...] = ()


def criticality(
    gradients: Float[np.ndarray, "objectives columns"], constraints: Constraints, radius: float
) -> Criticality:
    """Return the criticality where objectives have these gradients.

    The nearest inequalities come first: with fewer χ can only be greater, so that χ = 0 with them is χ = 0 with all.
    Multipliers of the active inequalities replace Clarabel's if they are unique: an interior point stops short of them.
    Raises SolverFailed if Clarabel ends without a solution.
    """
    check_interruption()
    scale = _scale(gradients)
    near = constraints.within_reach(OPTIONS.near_share * radius, order=2)
    result = _solve_near(gradients, constraints, radius, near)
    if result.value > OPTIONS.gain_tolerance * scale:
        result = _solve_near(gradients, constraints, radius, constraints.within_reach(radius, order=2))
    exact = active_set_criticality(gradients, constraints, radius)
    return result if exact is None else replace(exact, value=result.value)


def quick_criticality(
    gradients: Float[np.ndarray, "objectives columns"], constraints: Constraints, radius: float
) -> Criticality:
    """Return the bound that active inequalities give, or the criticality if there is none. Raises as that does."""
    check_interruption()
    return active_set_criticality(gradients, constraints, radius) or criticality(gradients, constraints, radius)


def active_set_criticality(
    gradients: Float[np.ndarray, "objectives columns"], constraints: Constraints, radius: float
) -> Criticality | None:
    """Return a bound of the criticality, and the only multipliers of the active inequalities that lead to it.

    None where the bound is not next to nothing, other multipliers do as well, or there are auxiliary columns.
    """
    if constraints.cones or gradients.shape[1] > constraints.unknowns:
        return None
    scale, norms, count = _scale(gradients), constraints.row_norms, len(gradients)
    active = np.flatnonzero(constraints.values <= OPTIONS.active)
    rows = np.concatenate([gradients / scale, -(constraints.jacobian[active].toarray() / norms[active, None])])
    total = np.concatenate([np.ones(count), np.zeros(len(active))])
    try:
        dual = nnls(np.vstack([rows.T, total]), np.append(np.zeros(rows.shape[1]), 1.0))[0]
    except RuntimeError:  # no end within its iterations
        return None
    if not dual[:count].any():
        return None
    dual /= dual[:count].sum()
    slacks = np.maximum(constraints.values[active], 0.0) / norms[active]
    bound = radius * float(np.linalg.norm(rows.T @ dual)) + float(dual[count:] @ slacks)
    if bound > OPTIONS.bound * radius:
        return None
    lengths = np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
    singular = np.linalg.svd(rows / lengths, compute_uv=False)
    if len(rows) - np.count_nonzero(singular > OPTIONS.singular) > 1:
        return None
    multipliers = np.zeros(len(norms))
    multipliers[active] = dual[count:] * scale / norms[active]
    return Criticality(value=bound * scale, step=np.zeros(rows.shape[1]), weights=dual[:count], multipliers=multipliers)


def _solve_near(
    gradients: np.ndarray, constraints: Constraints, radius: float, near: Int[np.ndarray, " near"]
) -> Criticality:
    """Return the criticality with only the inequalities ``near``, by the first tolerance that Clarabel reaches."""
    (count, columns), scale = gradients.shape, _scale(gradients)
    statement = Constraints(
        unknowns=constraints.unknowns,
        values=np.concatenate([np.zeros(count), np.maximum(constraints.values, 0.0)]),
        jacobian=stack_rows([dense_rows(-gradients / scale), constraints.jacobian]),
        cones=constraints.cones,
    )
    rows = np.concatenate([np.arange(count), count + near])
    subproblem = subproblem_of(Pattern.of(statement), count, ball=True)
    for tolerance in OPTIONS.solver_tolerances:  # the next if there is no progress below what rounding leaves
        try:
            solution = subproblem.solve(
                np.zeros(columns), None, statement, radius=radius, near=rows, tolerance=tolerance
            )
        except SolverFailed:
            if tolerance == OPTIONS.solver_tolerances[-1]:
                raise
            continue
        break
    weights = solution.multipliers[:count]
    return Criticality(
        value=max(-solution.violation, 0.0) * scale,
        step=solution.step,
        weights=weights / weights.sum(),
        multipliers=solution.multipliers[count:] * scale,
        cone_multipliers=tuple(each * scale for each in solution.cone_multipliers),
    )


def _scale(gradients: np.ndarray) -> float:
    return max(float(np.linalg.norm(gradients, axis=1).max()), 1e-12)
