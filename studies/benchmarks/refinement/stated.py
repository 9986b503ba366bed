"""The convex subproblem of ``nlp.convex_subproblem`` by cvxpy's own solve of the same statement."""

from __future__ import annotations

import warnings

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import SolverFailed
from paretoik.nlp.convex_subproblem import Pattern, Step, state, statement_values
from paretoik.nlp.program import CLARABEL_TOLERANCE, Constraints


def solve_with_cvxpy(
    gradient: Float[np.ndarray, " columns"],
    hessian: sparse.csr_array,
    constraints: Constraints,
    *,
    elastic: int,
    radius: float,
    penalty: float,
    tolerance: float = CLARABEL_TOLERANCE,
) -> Step:
    """Return the result of ``solve_subproblem``.

    Raises SolverFailed if there is no solution.
    """
    rows, cones = len(constraints.values), len(constraints.cones)
    numbers = statement_values(gradient, hessian, constraints, radius, penalty, np.ones(rows))
    statement = state(Pattern.of(constraints), elastic, hessian, iter(numbers.tolist()))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Solution may be inaccurate")  # Clarabel stopped short of the tolerance
        tolerances = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
        statement.problem.solve(solver="CLARABEL", **tolerances)
    if statement.d.value is None:
        raise SolverFailed(f"step: Clarabel must end with a solution, got {statement.problem.status}")
    stated = statement.problem.constraints
    return Step(
        step=np.array(statement.d.value),
        violation=float(statement.t.value),
        multipliers=np.array(stated[0].dual_value) if rows else np.zeros(0),
        cone_multipliers=tuple(-np.ravel(cone.dual_value[1]) for cone in stated[len(stated) - cones :]),
    )
