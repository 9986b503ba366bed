"""How much all objectives can gain at once, to first order: the criticality χ of a point.

maximise    t
subject to  ∇fᵢ·d + t ≤ 0 for every objective
            c + J d ≥ 0, c at least 0
            ‖d‖ ≤ radius, and cones

χ is 0 at a Pareto-critical point, positive elsewhere. A second-order cone program, solved by Clarabel. It is assembled
by hand: its sparsity differs from motion to motion, and cvxpy takes seconds to canonicalise each. Tests hold it against
a statement in cvxpy. Source: Fliege & Svaiter 2000, Eq. 2, with a ball in place of their quadratic term.

Any λ ≥ 0, Σλ = 1, and μ ≥ 0 bound it from above, by weak duality:

    χ ≤ radius · ‖Σ λᵢ ∇fᵢ − Jᵀ μ‖ + μ·c

Where the active inequalities alone have multipliers that bound it by next to nothing, and no others do, that is faster:
nonnegative least squares (Lawson & Hanson 1974, chapter 23).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.optimize import nnls

from paretoik.errors import SolverFailed
from paretoik.nlp.conic import Constraints, dense_rows
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

    The nearest inequalities alone come first: with fewer χ can only be greater, so that χ = 0 with them is χ = 0
    with all. Raises SolverFailed where Clarabel ends without a solution.
    """
    check_interruption()
    bounded = active_set_criticality(gradients, constraints, radius)
    if bounded is not None:
        return bounded
    scale = _scale(gradients)
    near = constraints.within_reach(OPTIONS.near_share * radius, order=2)
    first = _solve_near(gradients, constraints, radius, near)
    if first.value <= OPTIONS.gain_tolerance * scale:
        return first
    return _solve_near(gradients, constraints, radius, constraints.within_reach(radius, order=2))


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


def _solve_near(gradients: np.ndarray, constraints: Constraints, radius: float, near: np.ndarray) -> Criticality:
    """Return the criticality with the inequalities ``near`` alone; objectives and inequalities have length one."""
    scale, norms, count = _scale(gradients), constraints.row_norms, len(gradients)
    columns, unknowns = gradients.shape[1], constraints.unknowns
    slopes = sparse.diags_array(1.0 / norms[near]) @ constraints.jacobian[near]
    gains = dense_rows(gradients / scale)
    ball = sparse.vstack([sparse.csr_array((1, columns)), -sparse.eye_array(unknowns, columns)])
    rows = [-slopes, *[part for cone in constraints.cones for part in (-_unit_row(cone.column, columns), -cone.rows)]]
    steps = sparse.vstack([rows[0], gains, ball, *rows[1:]])
    t = sparse.coo_array(
        (np.ones(count), (len(near) + np.arange(count), np.zeros(count, dtype=int))), (steps.shape[0], 1)
    )
    table = sparse.hstack([steps, t])
    values = [part for cone in constraints.cones for part in ([np.linalg.norm(cone.values)], cone.values)]
    slacks = np.maximum(constraints.values[near], 0.0) / norms[near]
    right = np.concatenate([slacks, np.zeros(count), [radius], np.zeros(unknowns), *values])
    kinds = [clarabel.NonnegativeConeT(len(near) + count), clarabel.SecondOrderConeT(1 + unknowns)]
    kinds += [clarabel.SecondOrderConeT(1 + len(cone.values)) for cone in constraints.cones]
    x, dual = _solve_conic(np.append(np.zeros(columns), -1.0), sparse.csc_matrix(table), right, kinds)
    multipliers, end = np.zeros(len(norms)), len(near) + count
    multipliers[near] = dual[: len(near)] * scale / norms[near]
    weights = dual[len(near) : end]
    return Criticality(
        value=max(float(x[-1]), 0.0) * scale,
        step=x[:-1],
        weights=weights / weights.sum(),
        multipliers=multipliers,
        cone_multipliers=constraints.cone_multipliers(dual[end + 1 + unknowns :] * scale),
    )


def _solve_conic(
    linear: np.ndarray, table: sparse.csc_matrix, right: np.ndarray, cones: list[Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Return x and dual variables; raises SolverFailed where Clarabel ends without a solution at any tolerance."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    empty = sparse.csc_matrix((len(linear), len(linear)))
    for tolerance in OPTIONS.solver_tolerances:  # the next where there is no progress below what rounding leaves
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
        solution = clarabel.DefaultSolver(empty, linear, table, right, cones, settings).solve()
        if str(solution.status) in ("Solved", "AlmostSolved"):
            return np.array(solution.x), np.array(solution.z)
    raise SolverFailed(f"criticality: Clarabel wanted to end with Solved, got {solution.status}")


def _unit_row(column: int, columns: int) -> sparse.csr_array:
    return sparse.csr_array(([1.0], ([0], [column])), shape=(1, columns))


def _scale(gradients: np.ndarray) -> float:
    return max(float(np.linalg.norm(gradients, axis=1).max()), 1e-12)
