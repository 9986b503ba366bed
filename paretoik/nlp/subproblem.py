"""The subproblem of sequential quadratic programming: a quadratic model, linear limits, a box, and a way out.

min g·d + ½ dᵀ H d + price · t over |dᵢ| ≤ radius and t ≥ 0 with gap + slope·d + t ≥ 0 for limits that may yield,
gap + slope·d ≥ 0 for the others, and cones. Solved by Clarabel; ``step_model`` is the same in cvxpy's words. Source:
Nocedal & Wright, Numerical Optimization, section 18.5 (with the largest violation as penalty).
"""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import SolverFailed
from paretoik.nlp.conic import Constraints, Entries, solve_conic


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """A step, the violation t that the limits are left with, and multipliers of limits and cones."""

    step: Float[np.ndarray, " columns"]
    violation: float
    limits: Float[np.ndarray, " limits"]
    pulls: tuple[np.ndarray, ...]


def step(
    gradient: Float[np.ndarray, " columns"],
    hessian: sparse.csr_array,
    constraints: Constraints,
    *,
    yielding: int,
    radius: float,
    price: float,
) -> Step:
    """Return the best step; the first ``yielding`` limits may be violated at a price.

    ``hessian`` has to be positive semidefinite. Raises SolverFailed where Clarabel finds no solution.
    """
    columns, unknowns = len(gradient), constraints.unknowns
    near = constraints.within_reach(radius, order=1)
    gives = np.flatnonzero(near < yielding)
    lengths = constraints.row_norms[near]
    lengths[gives] = 1.0  # their units decide what a violation costs
    way_out = Entries(gives, np.full(len(gives), columns), np.full(len(gives), -1.0))
    last = Entries(np.zeros(1, dtype=int), np.array([columns]), np.full(1, -1.0))
    tops = constraints.conic_rows()
    found = solve_conic(
        "step",
        Entries.of(hessian),
        np.append(gradient, price),
        [
            (0, constraints.scaled_rows(near, lengths)),
            (len(near), way_out),
            (unknowns, Entries.diagonal(unknowns, 1.0)),
            (unknowns, Entries.diagonal(unknowns, -1.0)),
            (1, last),
            *((height, block) for height, block, *_ in tops),
        ],
        [
            constraints.values[near] / lengths,
            np.full(2 * unknowns, radius),
            np.zeros(1),
            *(right for *_, right, _ in tops),
        ],
        [clarabel.NonnegativeConeT(len(near) + 2 * unknowns + 1), *(kind for *_, kind in tops)],
        1e-10,
    )
    limits = np.zeros(len(constraints.values))
    limits[near] = found.dual[: len(near)] / lengths
    return Step(
        step=found.x[:columns],
        violation=max(float(found.x[columns]), 0.0),
        limits=limits,
        pulls=constraints.cone_multipliers(found.dual[len(near) + 2 * unknowns + 1 :]),
    )


def step_model(
    gradient: Float[np.ndarray, " columns"],
    hessian: sparse.csr_array,
    constraints: Constraints,
    *,
    yielding: int,
    radius: float,
    price: float,
) -> Step:
    """Return what ``step`` does, by cvxpy."""
    import cvxpy  # here: it takes two seconds, and only tests and readers want it

    d, t = cvxpy.Variable(len(gradient)), cvxpy.Variable(nonneg=True)
    gives = (np.arange(len(constraints.values)) < yielding).astype(float)
    within = constraints.values + constraints.jacobian @ d + gives * t >= 0
    box = cvxpy.norm_inf(d[: constraints.unknowns]) <= radius
    tops = [
        cvxpy.SOC(d[cone.column] + np.linalg.norm(cone.values), cone.values + cone.rows @ d)
        for cone in constraints.cones
    ]
    worth = gradient @ d + cvxpy.quad_form(d, cvxpy.psd_wrap(hessian)) / 2 + price * t
    problem = cvxpy.Problem(cvxpy.Minimize(worth), [within, box, *tops])
    problem.solve(solver=cvxpy.CLARABEL)
    if d.value is None:
        raise SolverFailed(f"step: a solution wanted, got {problem.status}")
    return Step(
        step=np.array(d.value),
        violation=float(t.value),
        limits=np.array(within.dual_value),
        pulls=tuple(-np.ravel(top.dual_value[1]) for top in tops),
    )
