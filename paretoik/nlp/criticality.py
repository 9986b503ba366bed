"""How much all objectives can gain at once, to first order: the criticality of a point.

χ = max t over ‖d‖ ≤ radius with ∇fᵢ·d ≤ −t for every objective and gap + ∇gap·d ≥ 0 for every limit: 0 at a
Pareto-critical point, positive elsewhere. A second-order cone program, solved by Clarabel; ``criticality_model`` is the
same in cvxpy's words, slower and easier to read. Source: Fliege & Svaiter 2000, Eq. 2, with a ball in place of their
quadratic term.
"""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
from jaxtyping import Float

from paretoik.errors import SolverFailed
from paretoik.nlp.conic import Constraints, Entries, asked

SHORT = 0.01  # of the longest step: limits that one so short cannot reach are asked only where the others leave a gain
NOTHING = 1e-10  # of the steepest objective's slope: a gain that needs no more limits to be none


@dataclass(frozen=True, kw_only=True, eq=False)
class Criticality:
    """``value`` χ, the step that attains it, and multipliers of objectives (their sum is 1), limits and cones."""

    value: float
    step: Float[np.ndarray, " columns"]
    weights: Float[np.ndarray, " objectives"]
    limits: Float[np.ndarray, " limits"]
    pulls: tuple[np.ndarray, ...] = ()


def criticality(
    gradients: Float[np.ndarray, "objectives columns"], constraints: Constraints, radius: float
) -> Criticality:
    """Return the criticality where objectives have these gradients.

    Of the limits those nearest are asked first: with fewer limits the gain can only be greater, so that none with them
    is none with all. Raises SolverFailed where Clarabel finds no solution.
    """
    steepest = max(float(np.linalg.norm(gradients, axis=1).max()), 1e-12)
    found = _within(gradients, constraints, radius, constraints.in_reach(SHORT * radius, order=2), steepest)
    if found.value <= NOTHING * steepest:
        return found
    return _within(gradients, constraints, radius, constraints.in_reach(radius, order=2), steepest)


def _within(
    gradients: np.ndarray, constraints: Constraints, radius: float, near: np.ndarray, scale: float
) -> Criticality:
    """Return the criticality as far as the limits ``near`` go, asked with gradients divided by ``scale``."""
    (objectives, columns), unknowns = gradients.shape, constraints.unknowns
    lengths = constraints.lengths[near]
    row, column = np.indices(gradients.shape).reshape(2, -1)
    gains = Entries(
        np.append(row, np.arange(objectives)),
        np.append(column, np.full(objectives, columns)),
        np.append(gradients.ravel() / scale, np.ones(objectives)),
    )
    tops = constraints.tops()
    found = asked(
        "criticality",
        Entries.diagonal(0, 0.0),
        np.append(np.zeros(columns), -1.0),
        [
            (objectives, gains),
            (len(near), constraints.turned(near, lengths)),
            (unknowns + 1, Entries.diagonal(unknowns, -1.0, below=1)),
            *((height, block) for height, block, *_ in tops),
        ],
        [
            np.zeros(objectives),
            np.maximum(constraints.gaps[near], 0.0) / lengths,
            np.append(radius, np.zeros(unknowns)),
            *(right for *_, right, _ in tops),
        ],
        [
            clarabel.NonnegativeConeT(objectives + len(near)),
            clarabel.SecondOrderConeT(unknowns + 1),
            *(kind for *_, kind in tops),
        ],
        1e-11,
    )
    limits = np.zeros(len(constraints.gaps))
    limits[near] = found.dual[objectives : objectives + len(near)] * scale / lengths
    weights = found.dual[:objectives]
    return Criticality(
        value=max(-found.value, 0.0) * scale,
        step=found.x[:columns],
        weights=weights / weights.sum(),
        limits=limits,
        pulls=constraints.pulls(found.dual[objectives + len(near) + unknowns + 1 :] * scale),
    )


def criticality_model(
    gradients: Float[np.ndarray, "objectives columns"], constraints: Constraints, radius: float
) -> Criticality:
    """Return what ``criticality`` does, by cvxpy."""
    import cvxpy  # here: it takes two seconds, and only tests and readers want it

    d, t = cvxpy.Variable(gradients.shape[1]), cvxpy.Variable()
    gain = gradients @ d + t <= 0
    within = -constraints.slopes @ d <= np.maximum(constraints.gaps, 0.0)
    tops = [
        cvxpy.SOC(d[cone.column] + np.linalg.norm(cone.values), cone.values + cone.rows @ d)
        for cone in constraints.cones
    ]
    ball = cvxpy.norm(d[: constraints.unknowns]) <= radius
    problem = cvxpy.Problem(cvxpy.Maximize(t), [gain, within, ball, *tops])
    problem.solve(solver=cvxpy.CLARABEL)
    if d.value is None:
        raise SolverFailed(f"criticality: a solution wanted, got {problem.status}")
    return Criticality(
        value=max(float(problem.value), 0.0),
        step=np.array(d.value),
        weights=np.array(gain.dual_value) / np.sum(gain.dual_value),
        limits=np.array(within.dual_value),
        pulls=tuple(-np.ravel(top.dual_value[1]) for top in tops),
    )
