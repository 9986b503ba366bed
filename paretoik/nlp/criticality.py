"""How much all objectives can gain at once, to first order: the criticality χ of a point.

maximise    t
subject to  ∇fᵢ·d + t ≤ 0 for every objective
            c + J d ≥ 0, c at least 0
            ‖d‖ ≤ radius, and cones

χ is 0 at a Pareto-critical point, positive elsewhere. A second-order cone program, solved by Clarabel. It is assembled
by hand: its sparsity differs from motion to motion, and cvxpy takes seconds to canonicalise each. Tests hold it against
a statement in cvxpy. Source: Fliege & Svaiter 2000, Eq. 2, with a ball in place of their
quadratic term.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import SolverFailed
from paretoik.nlp.conic import Constraints
from paretoik.stop_flag import check_interruption


@dataclass(frozen=True, kw_only=True)
class CriticalityOptions:
    """How the criticality is computed; no field has a unit."""

    near_share: float = 0.01  # of the radius: inequalities that no step so short reaches are left out at first
    gain_tolerance: float = 1e-10  # of the steepest gradient's length: a gain that is as good as 0
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
    scale = _scale(gradients)
    near = constraints.within_reach(OPTIONS.near_share * radius, order=2)
    first = _solve_near(gradients, constraints, radius, near)
    if first.value <= OPTIONS.gain_tolerance * scale:
        return first
    return _solve_near(gradients, constraints, radius, constraints.within_reach(radius, order=2))


def _solve_near(gradients: np.ndarray, constraints: Constraints, radius: float, near: np.ndarray) -> Criticality:
    """Return the criticality with the inequalities ``near`` alone; objectives and inequalities have length one."""
    scale, norms, count = _scale(gradients), constraints.row_norms, len(gradients)
    columns, unknowns = gradients.shape[1], constraints.unknowns
    slopes = sparse.diags_array(1.0 / norms[near]) @ constraints.jacobian[near]
    gains = sparse.csr_array(np.column_stack([gradients / scale, np.ones(count)]))
    ball = sparse.vstack([sparse.csr_array((1, columns)), -sparse.eye_array(unknowns, columns)])
    rows = [-slopes, *[part for cone in constraints.cones for part in (-_unit_row(cone.column, columns), -cone.rows)]]
    steps = sparse.vstack([rows[0], sparse.csr_array((count, columns)), ball, *rows[1:]], format="csr")
    t = sparse.csr_array((steps.shape[0], 1))
    table = sparse.hstack([steps, t], format="lil")
    table[len(near) : len(near) + count] = gains
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
