"""How much all objectives can gain at once, to first order: the criticality χ of a point.

maximise    t
subject to  ∇fᵢ·d + t ≤ 0 for every objective
            c + J d ≥ 0, c at least 0
            ‖d‖ ≤ radius, and cones

χ is 0 at a Pareto-critical point, positive elsewhere. A second-order cone program, assembled by hand for Clarabel:
``solve_with_cvxpy`` states the same and is what tests hold it against. Source: Fliege & Svaiter 2000, Eq. 2, with a
ball in place of their quadratic term.
"""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
from jaxtyping import Float

from paretoik.errors import SolverFailed
from paretoik.nlp.conic import Constraints, Entries, solve_conic

NEAR_SHARE = 0.01  # of the radius: inequalities that a step so short cannot reach are left out at first
GAIN_TOLERANCE = 1e-10  # of the steepest gradient's length: a gain that further inequalities could only lower to 0
TOLERANCE = 1e-11  # of Clarabel's gaps and infeasibilities


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
    scale = max(float(np.linalg.norm(gradients, axis=1).max()), 1e-12)
    near = constraints.within_reach(NEAR_SHARE * radius, order=2)
    first = _solve(gradients, constraints, radius, near, scale)
    if first.value <= GAIN_TOLERANCE * scale:
        return first
    return _solve(gradients, constraints, radius, constraints.within_reach(radius, order=2), scale)


def _solve(
    gradients: np.ndarray, constraints: Constraints, radius: float, rows: np.ndarray, scale: float
) -> Criticality:
    """Return the criticality with the inequalities ``rows`` alone, all gradients divided by ``scale``."""
    (objectives, columns), unknowns = gradients.shape, constraints.unknowns
    norms = constraints.row_norms[rows]
    row, column = np.indices(gradients.shape).reshape(2, -1)
    gains = Entries(
        np.append(row, np.arange(objectives)),
        np.append(column, np.full(objectives, columns)),
        np.append(gradients.ravel() / scale, np.ones(objectives)),
    )
    cones = constraints.conic_rows()
    solution = solve_conic(
        "criticality",
        Entries.diagonal(0, 0.0),
        np.append(np.zeros(columns), -1.0),
        [
            (objectives, gains),
            (len(rows), constraints.scaled_rows(rows, norms)),
            (unknowns + 1, Entries.diagonal(unknowns, -1.0, offset=1)),
            *((height, block) for height, block, *_ in cones),
        ],
        [
            np.zeros(objectives),
            np.maximum(constraints.values[rows], 0.0) / norms,
            np.append(radius, np.zeros(unknowns)),
            *(b for *_, b, _ in cones),
        ],
        [
            clarabel.NonnegativeConeT(objectives + len(rows)),
            clarabel.SecondOrderConeT(unknowns + 1),
            *(kind for *_, kind in cones),
        ],
        TOLERANCE,
    )
    multipliers = np.zeros(len(constraints.values))
    multipliers[rows] = solution.dual[objectives : objectives + len(rows)] * scale / norms
    weights = solution.dual[:objectives]
    return Criticality(
        value=max(-solution.value, 0.0) * scale,
        step=solution.x[:columns],
        weights=weights / weights.sum(),
        multipliers=multipliers,
        cone_multipliers=constraints.cone_multipliers(solution.dual[objectives + len(rows) + unknowns + 1 :] * scale),
    )


def solve_with_cvxpy(
    gradients: Float[np.ndarray, "objectives columns"], constraints: Constraints, radius: float
) -> Criticality:
    """Return the criticality by cvxpy's own solve. Raises SolverFailed where there is no solution."""
    import cvxpy  # here: importing it takes two seconds

    d, t = cvxpy.Variable(gradients.shape[1]), cvxpy.Variable()
    gain = gradients @ d + t <= 0
    inequalities = -constraints.jacobian @ d <= np.maximum(constraints.values, 0.0)
    cones = [
        cvxpy.SOC(d[cone.column] + np.linalg.norm(cone.values), cone.values + cone.rows @ d)
        for cone in constraints.cones
    ]
    ball = cvxpy.norm(d[: constraints.unknowns]) <= radius
    problem = cvxpy.Problem(cvxpy.Maximize(t), [gain, inequalities, ball, *cones])
    problem.solve(solver=cvxpy.CLARABEL)
    if d.value is None:
        raise SolverFailed(f"criticality: a solution wanted, got {problem.status}")
    return Criticality(
        value=max(float(problem.value), 0.0),
        step=np.array(d.value),
        weights=np.array(gain.dual_value) / np.sum(gain.dual_value),
        multipliers=np.array(inequalities.dual_value),
        cone_multipliers=tuple(-np.ravel(cone.dual_value[1]) for cone in cones),
    )
