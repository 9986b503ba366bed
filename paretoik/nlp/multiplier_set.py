"""All multipliers that make a point critical, and how the objectives' weights may differ among them.

    {(λ, μ): Σ λᵢ ∇fᵢ = Aᵀ μ,  λ ≥ 0, μ ≥ 0},  A the gradients of the active inequalities

λ is unique up to its length where the parts of ∇fᵢ across the rows of A depend on each other in one way only: that
takes no solver. Elsewhere all solutions of the equation are λ = V y, μ = M y + N z, and one linear program, with a
block for each end, gives the least and largest shares λᵢ / (λᵢ + λⱼ) of all pairs:

    extremise   λᵢ
    subject to  λᵢ + λⱼ = 1,  V y ≥ 0,  M y + N z ≥ 0

It is solved by Clarabel. Source: Gal & Nedoma 1972 for the set of multipliers; Charnes & Cooper 1962 for ratios.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import clarabel
import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.linalg import qr, solve_triangular

from paretoik.errors import SolverFailed
from paretoik.nlp.elimination import eliminate


@dataclass(frozen=True, kw_only=True)
class MultiplierSetOptions:
    """Tolerances; none has a unit, gradients being divided by their lengths."""

    singular: float = 1e-7  # singular value that counts as none
    negligible: float = 1e-12  # length, of the longest gradient, of one that is none
    balance: float = 1e-9  # by which a multiplier may be negative
    solver_tolerance: float = 1e-9  # of Clarabel's gaps and infeasibilities


OPTIONS = MultiplierSetOptions()


def share_ranges(
    gradients: Float[np.ndarray, "n_obj columns"],
    active: Float[np.ndarray, "rows columns"],
    unknowns: int | None = None,
) -> Float[np.ndarray, "n_obj n_obj 2"] | None:
    """Return the least and largest λᵢ / (λᵢ + λⱼ) over all multipliers of a critical point; None where λ is unique.

    Columns from ``unknowns`` on, if any, are auxiliary. Raises SolverFailed where Clarabel ends without a solution.
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
    return _solve_blocks(weights, *_by_parameters(along.T @ weights, triangle, order))


def _are_unique(
    gradients: Float[np.ndarray, "n_obj columns"], rows: Float[np.ndarray, "rows columns"], unknowns: int
) -> bool:
    """Return whether gradients depend on each other in one way across rows, auxiliary columns being eliminated.

    Multiples of rows, added to gradients and to other rows, leave what is across all rows as it is.
    """
    left = eliminate(np.concatenate([rows, gradients]), unknowns, len(rows))
    reduced = left.reduced
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


def _solve_blocks(
    weights: Float[np.ndarray, "n_obj y"], particular: Float[np.ndarray, "rows y"], kernel: Float[np.ndarray, "rows z"]
) -> Float[np.ndarray, "n_obj n_obj 2"]:
    """Return the ends of the shares of all pairs, two blocks a pair."""
    count, free = len(weights), kernel.shape[1]
    nonnegative = np.concatenate([np.pad(weights, ((0, 0), (0, free))), np.hstack([particular, kernel])])
    sizes = np.abs(nonnegative).max(axis=1)
    counts = sizes > OPTIONS.balance
    nonnegative = nonnegative[counts] / sizes[counts, None]
    pairs = list(combinations(range(count), 2))
    equalities = [np.append(weights[i] + weights[j], np.zeros(free))[None] for i, j in pairs for _ in range(2)]
    costs = [np.append(sign * weights[i], np.zeros(free)) for i, _ in pairs for sign in (1.0, -1.0)]
    blocks = len(costs)
    table = sparse.vstack(
        [sparse.block_diag(equalities), -sparse.kron(sparse.eye_array(blocks), nonnegative)], format="csc"
    )
    right = np.concatenate([np.ones(blocks), np.full(blocks * len(nonnegative), OPTIONS.balance)])
    cones = [clarabel.ZeroConeT(blocks), clarabel.NonnegativeConeT(blocks * len(nonnegative))]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = OPTIONS.solver_tolerance
    columns = len(table.indptr) - 1
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix((columns, columns)), np.concatenate(costs), sparse.csc_matrix(table), right, cones, settings
    )
    solution = solver.solve()
    if str(solution.status) not in ("Solved", "AlmostSolved"):
        raise SolverFailed(f"multipliers: Clarabel wanted to end with Solved, got {solution.status}")
    x = np.array(solution.x).reshape(len(pairs), 2, -1)
    shares = np.full((count, count, 2), 0.5)
    for (i, j), ends in zip(pairs, x, strict=True):
        low, high = np.clip(ends[:, : weights.shape[1]] @ weights[i], 0.0, 1.0)
        shares[i, j], shares[j, i] = (low, high), (1.0 - high, 1.0 - low)
    return shares
