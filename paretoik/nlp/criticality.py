"""The criticality χ of a point: the common first-order gain of objectives.

maximise    χ
subject to  −∇fᵢ·d − χ ≥ 0 for every objective
            max(c, 0) + J d ≥ 0
            ‖d‖ ≤ radius, and cones

χ is 0 at a Pareto-critical point, positive elsewhere. The problem is a special case of ``nlp.convex_subproblem``: the
elastic inequalities are the objectives' gains, and t = −χ. Source: Fliege & Svaiter 2000, Eq. 2, with a ball instead of
their quadratic term.

By weak duality, any λ ≥ 0 with Σλ = 1 and any μ ≥ 0 give an upper bound:

    χ ≤ radius · ‖Σ λᵢ ∇fᵢ − Jᵀ μ‖ + μ·c

Nonnegative least squares (Lawson & Hanson 1974, chapter 23) give multipliers of only the active inequalities. They are
exact if they are unique and their bound is almost 0. Searches use this bound for χ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse
from scipy.linalg import qr, solve_triangular
from scipy.optimize import linprog, nnls

from paretoik.errors import SolverFailed
from paretoik.nlp.convex_subproblem import Pattern, subproblem_of
from paretoik.nlp.program import Constraints, dense_rows, stack_rows
from paretoik.stop_flag import check_interruption


@dataclass(frozen=True, kw_only=True)
class CriticalityOptions:
    """Settings of the criticality and its multipliers; no field has a unit."""

    near_share: float = 0.01  # share of the radius; inequalities out of reach of such steps are left out at first
    gain_tolerance: float = 1e-10  # largest gain that counts as 0, as a share of the steepest gradient's length
    active: float = 1e-7  # slack up to which an inequality is active
    bound: float = 1e-8  # largest bound that replaces χ, as a share of the steepest gradient's length times the radius
    singular: float = 1e-7  # largest singular value that counts as 0, for gradients of length one
    solver_tolerances: tuple[float, ...] = (1e-11, 1e-9)  # Clarabel's tolerances, tried in order
    pivot: float = 1e-9  # largest entry that counts as 0 in an elimination, for rows of length one
    negligible: float = 1e-12  # largest length of a row that counts as 0
    balance: float = 1e-9  # largest amount by which a multiplier may be negative
    simplex_tolerance: float = 1e-9  # tolerance of HiGHS's infeasibilities


OPTIONS = CriticalityOptions()

# Elimination of auxiliary columns, which are sparse, before dense factorisations of the rest.


@dataclass(frozen=True, kw_only=True, eq=False)
class Elimination:
    """Rows after elimination: each eliminated column has an entry only in its pivot row.

    pivots: pivot row of every elimination
    columns: column of every elimination
    remaining: whether each row is no pivot row
    free: whether each column stays
    """

    table: Float[np.ndarray, "rows columns"]
    pivots: list[int]
    columns: list[int]
    remaining: Bool[np.ndarray, " rows"]
    free: Bool[np.ndarray, " columns"]

    @property
    def reduced(self) -> Float[np.ndarray, "remaining free"]:
        """Entries of the remaining rows in the columns that stay."""
        return self.table[np.ix_(self.remaining, self.free)]


def eliminate(rows: Float[np.ndarray, "rows columns"], unknowns: int, pivot_rows: int | None = None) -> Elimination:
    """Eliminate the columns from ``unknowns`` on (Gauss–Jordan); a column without a pivot stays.

    Pivots are the largest entries among the first ``pivot_rows`` rows (None: all).
    """
    table, (count, size) = rows.copy(), rows.shape
    remaining, free = np.ones(count, dtype=bool), np.ones(size, dtype=bool)
    pivots, columns = list[int](), list[int]()
    end = count if pivot_rows is None else pivot_rows
    for column in range(unknowns, size):
        sizes = np.abs(table[:end, column]) * remaining[:end]
        pivot = int(np.argmax(sizes)) if end else 0
        if not end or sizes[pivot] <= OPTIONS.pivot:
            continue
        pivots.append(pivot)
        columns.append(column)
        remaining[pivot], free[column] = False, False
        table[pivot] /= table[pivot, column]
        others = np.flatnonzero(table[:, column])
        others = others[others != pivot]
        table[others] -= table[others, column][:, None] * table[pivot]
    return Elimination(table=table, pivots=pivots, columns=columns, remaining=remaining, free=free)


# The set of all multipliers that make a point critical, and the ranges of the objectives' weights.
#
#     {(λ, μ): Σ λᵢ ∇fᵢ = Aᵀ μ,  λ ≥ 0, μ ≥ 0},  A: gradients of the active inequalities
#
# λ is unique up to a factor if the parts of ∇fᵢ orthogonal to the rows of A have only one linear dependence; this test
# needs no solver. Otherwise all solutions of the equation are λ = V y, μ = M y + N z, and small linear programs give
# the least and the largest share λᵢ / (λᵢ + λⱼ) of every pair:
#
#     extremise   λᵢ
#     subject to  λᵢ + λⱼ = 1,  V y ≥ 0,  M y + N z ≥ 0
#
# SciPy's HiGHS solves them by the simplex method, which ends on a vertex. Source: Gal & Nedoma 1972 for the set of
# multipliers; Charnes & Cooper 1962 for ratios.


def share_ranges(
    gradients: Float[np.ndarray, "n_obj columns"],
    active: Float[np.ndarray, "rows columns"],
    unknowns: int | None = None,
) -> Float[np.ndarray, "n_obj n_obj 2"] | None:
    """Return the ranges of λᵢ / (λᵢ + λⱼ) over all multipliers of a critical point; None if λ is unique.

    Columns from ``unknowns`` on, if any, are auxiliary. Raises SolverFailed if HiGHS ends without a solution.
    """
    scaled = gradients / max(float(np.linalg.norm(gradients, axis=1).max()), 1e-300)
    rows = unit_rows(active, OPTIONS.negligible)
    if unknowns is not None and unknowns < gradients.shape[1] and _are_unique(scaled, rows, unknowns):
        return None
    basis, triangle, order, rank = factorise_rows(rows, OPTIONS.singular)
    basis, triangle = basis[:, :rank], triangle[:rank]
    along = scaled @ basis
    left, singular, _ = np.linalg.svd(scaled - along @ basis.T)
    small = np.append(singular, np.zeros(len(left) - len(singular))) <= OPTIONS.singular
    if np.count_nonzero(small) <= 1:
        return None
    weights = left[:, small]
    # all solutions μ = M y + N z of triangle · μ[order] = target · y
    target, count = along.T @ weights, len(order)
    particular, kernel = np.zeros((count, target.shape[1])), np.zeros((count, count - rank))
    if rank:
        particular[order[:rank]] = solve_triangular(triangle[:, :rank], target)
        kernel[order[:rank]] = -solve_triangular(triangle[:, :rank], triangle[:, rank:])
    kernel[order[rank:]] = np.eye(count - rank)
    return _extreme_shares(weights, particular, kernel)


def _are_unique(
    gradients: Float[np.ndarray, "n_obj columns"], rows: Float[np.ndarray, "rows columns"], unknowns: int
) -> bool:
    """Return whether the gradients' parts orthogonal to the rows have one linear dependence.

    Auxiliary columns are eliminated first. This adds multiples of rows to gradients and rows, which does not change
    these parts.
    """
    reduced = eliminate(np.concatenate([rows, gradients]), unknowns, len(rows)).reduced
    across, others = reduced[-len(gradients) :], reduced[: -len(gradients)]
    basis, _, _, rank = factorise_rows(unit_rows(others, OPTIONS.singular), OPTIONS.singular)
    basis = basis[:, :rank]
    singular = np.linalg.svd(across - across @ basis @ basis.T, compute_uv=False)
    return int(np.count_nonzero(singular > OPTIONS.singular)) >= len(gradients) - 1


def unit_rows(rows: Float[np.ndarray, "rows columns"], shortest: float) -> Float[np.ndarray, "long columns"]:
    """Return the rows longer than ``shortest``, divided by their lengths."""
    lengths = np.linalg.norm(rows, axis=1)
    return np.asarray(rows[lengths > shortest] / lengths[lengths > shortest, None])


def factorise_rows(
    rows: Float[np.ndarray, "rows columns"], dependent: float, mode: str = "economic"
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Return Q, R, order and rank of rows: rows[order]ᵀ = Q R; the first ``rank`` columns of Q span the rows."""
    basis, triangle, order = qr(rows.T, pivoting=True, mode=mode)
    sizes = np.abs(np.diagonal(triangle))
    return basis, triangle, order, int(np.count_nonzero(sizes > dependent * sizes.max(initial=0.0)))


def _extreme_shares(
    weights: Float[np.ndarray, "n_obj y"], particular: Float[np.ndarray, "rows y"], kernel: Float[np.ndarray, "rows z"]
) -> Float[np.ndarray, "n_obj n_obj 2"]:
    """Return the least and largest λᵢ / (λᵢ + λⱼ) of every pair, by linear programs."""
    count, free = len(weights), kernel.shape[1]
    padded = np.pad(weights, ((0, 0), (0, free)))
    nonnegative = np.concatenate([padded, np.hstack([particular, kernel])])
    sizes = np.abs(nonnegative).max(axis=1)
    counts = sizes > OPTIONS.balance
    limits = -sparse.csr_array(nonnegative[counts] / sizes[counts, None])
    tolerance = OPTIONS.simplex_tolerance
    shares = np.full((count, count, 2), 0.5)
    for i, j in combinations(range(count), 2):
        for end, sign in enumerate((1.0, -1.0)):
            solution = linprog(
                sign * padded[i],
                A_ub=limits,
                b_ub=np.full(limits.shape[0], OPTIONS.balance),
                A_eq=(padded[i] + padded[j])[None],
                b_eq=np.ones(1),
                bounds=(None, None),
                method="highs-ds",
                options={"primal_feasibility_tolerance": tolerance, "dual_feasibility_tolerance": tolerance},
            )
            if solution.status != 0:
                raise SolverFailed(f"multipliers: HiGHS found no optimum: {solution.message}")
            shares[i, j, end] = np.clip(padded[i] @ solution.x, 0.0, 1.0)
        shares[j, i] = 1.0 - shares[i, j, ::-1]
    return shares


# The criticality χ of a point.


@dataclass(frozen=True, kw_only=True, eq=False)
class Criticality:
    """The value χ and its step; the weights λ of the objectives, Σλ = 1, and the other multipliers μ."""

    value: float
    step: Float[np.ndarray, " columns"]
    weights: Float[np.ndarray, " objectives"]
    multipliers: Float[np.ndarray, " inequalities"]
    cone_multipliers: tuple[np.ndarray, ...] = ()


def criticality(
    gradients: Float[np.ndarray, "objectives columns"], constraints: Constraints, radius: float
) -> Criticality:
    """Return the criticality for these gradients of the objectives.

    At first only the nearest inequalities count. The others can only lower χ, so if it is 0, it stays 0 with them.
    Unique multipliers of the active inequalities replace Clarabel's, which are less exact. Raises SolverFailed if
    Clarabel ends without a solution.
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
    """Return the bound from active inequalities, else the criticality. Raises as ``criticality`` does."""
    check_interruption()
    return active_set_criticality(gradients, constraints, radius) or criticality(gradients, constraints, radius)


def active_set_criticality(
    gradients: Float[np.ndarray, "objectives columns"], constraints: Constraints, radius: float
) -> Criticality | None:
    """Return a bound of the criticality from active inequalities, with their unique multipliers.

        minimise    ‖Σ λᵢ ∇fᵢ − Aᵀμ‖² + (Σλ + Σμ − 1)²
        subject to  λ ≥ 0,  μ ≥ 0

    Returns None if the bound is not almost 0, the multipliers are not unique, or there are auxiliary columns.
    """
    if constraints.cones or gradients.shape[1] > constraints.unknowns:
        return None
    scale, norms, count = _scale(gradients), constraints.row_norms, len(gradients)
    active = np.flatnonzero(constraints.values <= OPTIONS.active)
    rows = np.concatenate([gradients / scale, -(constraints.jacobian[active].toarray() / norms[active, None])])
    total = np.concatenate([np.ones(count), np.zeros(len(active))])
    try:
        dual = nnls(np.vstack([rows.T, total]), np.append(np.zeros(rows.shape[1]), 1.0))[0]
    except RuntimeError:  # iteration limit reached
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
    """Return the criticality with only the inequalities ``near``, at the first tolerance that Clarabel reaches."""
    (count, columns), scale = gradients.shape, _scale(gradients)
    statement = Constraints(
        unknowns=constraints.unknowns,
        values=np.concatenate([np.zeros(count), np.maximum(constraints.values, 0.0)]),
        jacobian=stack_rows([dense_rows(-gradients / scale), constraints.jacobian]),
        cones=constraints.cones,
    )
    rows = np.concatenate([np.arange(count), count + near])
    subproblem = subproblem_of(Pattern.of(statement), count, ball=True)
    for tolerance in OPTIONS.solver_tolerances:  # a larger one if rounding stops progress
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
