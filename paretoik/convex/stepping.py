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

from paretoik.convex.models import Constraints, asked
from paretoik.errors import EvaluationFailed


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

    ``hessian`` has to be positive semidefinite. Raises EvaluationFailed where Clarabel finds no solution.
    """
    columns, unknowns = len(gradient), constraints.unknowns
    near = constraints.in_reach(radius, order=1)
    gives = np.flatnonzero(near < yielding)
    lengths = constraints.lengths[near]
    lengths[gives] = 1.0  # their units decide what a violation costs
    way_out = sparse.coo_array((np.ones(len(gives)), (gives, np.zeros(len(gives), dtype=int))), shape=(len(near), 1))
    box = sparse.eye_array(unknowns, columns + 1)
    last = sparse.coo_array((np.ones(1), (np.zeros(1, dtype=int), np.array([columns]))), shape=(1, columns + 1))
    limited = sparse.diags_array(1.0 / lengths) @ constraints.slopes[near]
    blocks = [-sparse.hstack([limited, way_out]), box, -box, -last]
    right = [constraints.gaps[near] / lengths, np.full(2 * unknowns, radius), np.zeros(1)]
    cones = [clarabel.NonnegativeConeT(len(near) + 2 * unknowns + 1)]
    for cone in constraints.cones:
        top = sparse.coo_array((np.ones(1), (np.zeros(1, dtype=int), np.array([cone.column]))), shape=(1, columns + 1))
        rows = sparse.hstack([cone.rows, sparse.csr_array((len(cone.values), 1))])
        blocks.append(-sparse.vstack([top, rows]))
        right.append(np.append(np.linalg.norm(cone.values), cone.values))
        cones.append(clarabel.SecondOrderConeT(len(cone.values) + 1))
    wide = sparse.csc_array(hessian)
    wide.resize((columns + 1, columns + 1))
    found = asked("step", wide, np.append(gradient, price), blocks, right, cones, 1e-10)
    limits = np.zeros(len(constraints.gaps))
    limits[near] = found.dual[: len(near)] / lengths
    rest, pulls = found.dual[len(near) + 2 * unknowns + 1 :], []
    for cone in constraints.cones:
        pulls.append(-rest[1 : len(cone.values) + 1])
        rest = rest[len(cone.values) + 1 :]
    return Step(step=found.x[:columns], violation=max(float(found.x[columns]), 0.0), limits=limits, pulls=tuple(pulls))


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
    gives = (np.arange(len(constraints.gaps)) < yielding).astype(float)
    within = constraints.gaps + constraints.slopes @ d + gives * t >= 0
    box = cvxpy.norm_inf(d[: constraints.unknowns]) <= radius
    tops = [
        cvxpy.SOC(d[cone.column] + np.linalg.norm(cone.values), cone.values + cone.rows @ d)
        for cone in constraints.cones
    ]
    worth = gradient @ d + cvxpy.quad_form(d, cvxpy.psd_wrap(hessian)) / 2 + price * t
    problem = cvxpy.Problem(cvxpy.Minimize(worth), [within, box, *tops])
    problem.solve(solver=cvxpy.CLARABEL)
    if d.value is None:
        raise EvaluationFailed(f"step: a solution wanted, got {problem.status}")
    return Step(
        step=np.array(d.value),
        violation=float(t.value),
        limits=np.array(within.dual_value),
        pulls=tuple(-np.ravel(top.dual_value[1]) for top in tops),
    )
