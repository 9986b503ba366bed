"""All multipliers that make a point critical, and how the objectives' weights may differ among them.

    {(λ, μ): Σ λᵢ ∇fᵢ = Aᵀ μ,  λ ≥ 0, μ ≥ 0},  A the gradients of the active inequalities

λ is unique up to its length where the parts of ∇fᵢ across the rows of A depend on each other in one way only: that
takes no solver. Elsewhere all solutions of the equation are λ = V y, μ = M y + N z, and linear programs as small as
these give the least and the largest share λᵢ / (λᵢ + λⱼ) of every pair:

    extremise   λᵢ
    subject to  λᵢ + λⱼ = 1,  V y ≥ 0,  M y + N z ≥ 0

They are solved by SciPy's HiGHS, whose simplex ends on a vertex; an interior point stops short of one where many meet.
Source: Gal & Nedoma 1972 for the set of multipliers; Charnes & Cooper 1962 for ratios.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.linalg import qr, solve_triangular
from scipy.optimize import linprog

from paretoik.errors import SolverFailed
from paretoik.nlp.elimination import eliminate


@dataclass(frozen=True, kw_only=True)
class MultiplierSetOptions:
    """Tolerances; none has a unit, gradients being divided by their lengths."""

    singular: float = 1e-7  # singular value that counts as none
    negligible: float = 1e-12  # length, of the longest gradient, of one that is none
    balance: float = 1e-9  # by which a multiplier may be negative
    solver_tolerance: float = 1e-9  # of HiGHS's infeasibilities


OPTIONS = MultiplierSetOptions()


def share_ranges(
    gradients: Float[np.ndarray, "n_obj columns"],
    active: Float[np.ndarray, "rows columns"],
    unknowns: int | None = None,
) -> Float[np.ndarray, "n_obj n_obj 2"] | None:
    """Return the least and largest λᵢ / (λᵢ + λⱼ) over all multipliers of a critical point; None where λ is unique.

    Columns from ``unknowns`` on, if any, are auxiliary. Raises SolverFailed where HiGHS ends without a solution.
    """
    longest = max(float(np.linalg.norm(gradients, axis=1).max()), 1e-300)
    scaled, lengths = gradients / longest, np.linalg.norm(active, axis=1)
    rows = active[lengths > OPTIONS.negligible]
    rows = rows / lengths[lengths > OPTIONS.negligible, None]
    if unknowns is not None and unknowns < gradients.shape[1] and _are_unique(scaled, rows, unknowns):
        return None
    basis, triangle, order = qr(rows.T, pivoting=True, mode="economic")  # rows[order].T = basis · triangle
    sizes = np.abs(np.diagonal(triangle))
    rank = int(np.count_nonzero(sizes > OPTIONS.singular * sizes.max(initial=0.0)))
    basis, triangle = basis[:, :rank], triangle[:rank]
    along = scaled @ basis
    left, singular, _ = np.linalg.svd(scaled - along @ basis.T)
    small = np.append(singular, np.zeros(len(left) - len(singular))) <= OPTIONS.singular
    if np.count_nonzero(small) <= 1:
        return None
    weights = left[:, small]
    return _extreme_shares(weights, *_by_parameters(along.T @ weights, triangle, order))


def _are_unique(
    gradients: Float[np.ndarray, "n_obj columns"], rows: Float[np.ndarray, "rows columns"], unknowns: int
) -> bool:
    """Return whether gradients depend on each other in one way across rows, auxiliary columns being eliminated.

    Multiples of rows, added to gradients and to other rows, leave what is across all rows as it is.
    """
    elimination = eliminate(np.concatenate([rows, gradients]), unknowns, len(rows))
    reduced = elimination.reduced
    across, others = reduced[-len(gradients) :], reduced[: -len(gradients)]
    lengths = np.linalg.norm(others, axis=1)
    others = others[lengths > OPTIONS.singular] / lengths[lengths > OPTIONS.singular, None]
    basis, triangle, _ = qr(others.T, pivoting=True, mode="economic")
    sizes = np.abs(np.diagonal(triangle))
    basis = basis[:, : np.count_nonzero(sizes > OPTIONS.singular * sizes.max(initial=0.0))]
    singular = np.linalg.svd(across - across @ basis @ basis.T, compute_uv=False)
    return int(np.count_nonzero(singular > OPTIONS.singular)) >= len(gradients) - 1


def _by_parameters(
    target: Float[np.ndarray, "rank y"], triangle: Float[np.ndarray, "rank rows"], order: np.ndarray
) -> tuple[Float[np.ndarray, "rows y"], Float[np.ndarray, "rows z"]]:
    """Return M and N: all solutions of triangle · μ[order] = target · y are μ = M y + N z."""
    rank, count = triangle.shape
    particular, kernel = np.zeros((count, target.shape[1])), np.zeros((count, count - rank))
    if rank:
        particular[order[:rank]] = solve_triangular(triangle[:, :rank], target)
        kernel[order[:rank]] = -solve_triangular(triangle[:, :rank], triangle[:, rank:])
    kernel[order[rank:]] = np.eye(count - rank)
    return particular, kernel


def _extreme_shares(
    weights: Float[np.ndarray, "n_obj y"], particular: Float[np.ndarray, "rows y"], kernel: Float[np.ndarray, "rows z"]
) -> Float[np.ndarray, "n_obj n_obj 2"]:
    """Return the ends of the shares of all pairs."""
    count, free = len(weights), kernel.shape[1]
    padded = np.pad(weights, ((0, 0), (0, free)))
    nonnegative = np.concatenate([padded, np.hstack([particular, kernel])])
    sizes = np.abs(nonnegative).max(axis=1)
    counts = sizes > OPTIONS.balance
    limits = -sparse.csr_array(nonnegative[counts] / sizes[counts, None])
    tolerance = OPTIONS.solver_tolerance
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
                raise SolverFailed(f"multipliers: HiGHS wanted to end with an optimum, got {solution.message}")
            shares[i, j, end] = np.clip(padded[i] @ solution.x, 0.0, 1.0)
        shares[j, i] = 1.0 - shares[i, j, ::-1]
    return shares
