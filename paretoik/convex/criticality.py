"""How much all objectives can gain at once, to first order: the criticality of a point.

χ = max t over ‖d‖ ≤ radius with ∇fᵢ·d ≤ −t for every objective and g + ∇g d ≤ 0 for every limit: 0 at a Pareto-critical
point, positive elsewhere. A second-order cone program, solved by Clarabel; ``criticality_model`` is the same in cvxpy's
words, slower and easier to read. Source: Fliege & Svaiter 2000, Eq. 2, with a ball in place of their quadratic term.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import EvaluationFailed


@dataclass(frozen=True, kw_only=True, eq=False)
class Criticality:
    """``value`` χ, the direction that attains it, and multipliers of objectives (their sum is 1) and limits."""

    value: float
    direction: Float[np.ndarray, " unknowns"]
    weights: Float[np.ndarray, " objectives"]
    limits: Float[np.ndarray, " limits"]


def criticality(
    gradients: Float[np.ndarray, "objectives unknowns"],
    gaps: Float[np.ndarray, " limits"],
    slopes: Any,
    radius: float,
) -> Criticality:
    """Return the criticality at a point with ``gaps`` −g of its limits and ``slopes`` ∇g, a sparse array with its rows.

    Raises EvaluationFailed where Clarabel finds no solution.
    """
    objectives, unknowns = gradients.shape
    steepness = np.sqrt(np.asarray(slopes.multiply(slopes).sum(axis=1)).ravel())
    near = np.flatnonzero(gaps < steepness * radius)  # the others cannot be reached from here
    scale = max(float(np.linalg.norm(gradients, axis=1).max()), 1e-12)
    lengths = np.maximum(steepness[near], 1e-300)
    by = sparse.diags_array(1.0 / lengths)
    matrix = sparse.block_array(
        [
            [sparse.csr_array(gradients / scale), np.ones((objectives, 1))],
            [by @ slopes[near], None],
            [None, sparse.csr_array((1, 1))],
            [-sparse.eye_array(unknowns), None],
        ],
        format="csc",
    )
    matrix.resize((matrix.shape[0], unknowns + 1))
    right = np.concatenate([np.zeros(objectives), np.maximum(gaps[near], 0.0) / lengths, [radius], np.zeros(unknowns)])
    cones = [clarabel.NonnegativeConeT(objectives + len(near)), clarabel.SecondOrderConeT(unknowns + 1)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix((unknowns + 1, unknowns + 1)),
        np.append(np.zeros(unknowns), -1.0),
        sparse.csc_matrix(matrix),
        right,
        cones,
        settings,
    )
    found = solver.solve()
    if str(found.status) not in ("Solved", "AlmostSolved"):
        raise EvaluationFailed(f"criticality: Clarabel wanted to end with Solved, got {found.status}")
    dual = np.array(found.z)
    limits = np.zeros(len(gaps))
    limits[near] = dual[objectives : objectives + len(near)] * scale / lengths
    return Criticality(
        value=max(-found.obj_val, 0.0) * scale,
        direction=np.array(found.x)[:unknowns],
        weights=dual[:objectives] / dual[:objectives].sum(),
        limits=limits,
    )


def criticality_model(
    gradients: Float[np.ndarray, "objectives unknowns"],
    gaps: Float[np.ndarray, " limits"],
    slopes: Any,
    radius: float,
) -> Criticality:
    """Return what ``criticality`` does, by cvxpy."""
    import cvxpy  # here: it takes two seconds, and only tests and readers want it

    d, t = cvxpy.Variable(gradients.shape[1]), cvxpy.Variable()
    gain = gradients @ d + t <= 0
    within = slopes @ d <= np.maximum(gaps, 0.0)
    problem = cvxpy.Problem(cvxpy.Maximize(t), [gain, within, cvxpy.norm(d) <= radius])
    problem.solve(solver=cvxpy.CLARABEL)
    if d.value is None:
        raise EvaluationFailed(f"criticality: a solution wanted, got {problem.status}")
    return Criticality(
        value=max(float(problem.value), 0.0),
        direction=np.array(d.value),
        weights=np.array(gain.dual_value) / np.sum(gain.dual_value),
        limits=np.array(within.dual_value),
    )
