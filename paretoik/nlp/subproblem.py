"""The convex subproblem of steps and of the criticality, stated in cvxpy and solved by Clarabel.

minimise    gᵀd + ½ dᵀHd + penalty · t
subject to  c + J d + t ≥ 0       elastic inequalities: violated by at most t, at a penalty
            c + J d ≥ 0           inequalities that tie auxiliary columns
            |dᵢ| ≤ radius         steps along the equalities: the trust region
            ‖values + rows d‖ ≤ d[column] + ‖values‖     cones
            t ≥ 0

A step of sequential quadratic programming solves it as it is. The criticality (``nlp.criticality``) is its special case
without gᵀd + ½ dᵀHd: the trust region is a ball and t is free.

The statement has Parameters for all numbers and is canonicalised once for each pattern: the structure of a program, not
which of its numbers are 0. A solution then takes one product of cvxpy's matrix from parameters to data with their
values, leaves out the inequalities that no step within the trust region reaches, and runs Clarabel on the rest. Source:
Nocedal & Wright, Numerical Optimization, section 18.5, with the largest violation as penalty.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from paretoik.errors import SolverFailed
from paretoik.nlp.canonical import CanonicalForm, Parameters, Pattern, Statement, parameter_values, state_cones
from paretoik.nlp.conic import CLARABEL_TOLERANCE, Constraints


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """A step d, the violation t that it leaves, and the multipliers of inequalities and of the vectors in cones.

    Without a trust region's t ≥ 0, as in the criticality, t is less than 0 by what all elastic inequalities gain.
    """

    step: Float[np.ndarray, " columns"]
    violation: float
    multipliers: Float[np.ndarray, " inequalities"]
    cone_multipliers: tuple[np.ndarray, ...]


def solve_subproblem(
    gradient: Float[np.ndarray, " columns"],
    hessian: sparse.csr_array,
    constraints: Constraints,
    *,
    elastic: int,
    radius: float,
    penalty: float,
    tolerance: float = CLARABEL_TOLERANCE,
) -> Step:
    """Return the solution, the first ``elastic`` inequalities being elastic.

    ``hessian`` has to be symmetric and positive semidefinite. Raises SolverFailed if Clarabel ends without a solution.
    """
    return subproblem_of(Pattern.of(constraints), elastic).solve(
        gradient, hessian, constraints, radius=radius, penalty=penalty, tolerance=tolerance
    )


def convexify(hessian: sparse.csr_array, unknowns: int, flattening: float) -> sparse.csr_array:
    """Return the Hessian with its negative eigenvalues raised to nearly 0: the trust region bounds steps along them.

    Reflecting them, or stiffening the Hessian across the inequalities that bind, took two to five times as many steps
    where curvature comes from kinks, and the latter 1.2 times as many on small dense programs.
    """
    dense = hessian.toarray()
    indices = np.flatnonzero(np.any(dense != 0, axis=1) | (np.arange(len(dense)) < unknowns))
    inner = dense[np.ix_(indices, indices)]
    smallest = flattening * max(float(np.abs(inner).max(initial=0.0)), 1e-12)
    try:
        np.linalg.cholesky(inner + 1e-2 * smallest * np.eye(len(inner)))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(inner)
        convex = (vectors * np.maximum(values, smallest)) @ vectors.T
        row, column = np.nonzero(convex)
        return sparse.csr_array((convex[row, column], (indices[row], indices[column])), shape=dense.shape)
    return hessian


class ConvexSubproblem:
    """The subproblem of one pattern, canonicalised; with a ``ball`` it is that of the criticality."""

    def __init__(self, pattern: Pattern, elastic: int, *, ball: bool = False) -> None:
        (self._rows, columns), self._elastic = pattern.jacobian.shape, elastic
        hessian = None if ball else sparse.eye_array(columns, format="csr")  # replaced at every solution
        statement = _state(pattern, elastic, hessian)
        self._form = CanonicalForm(statement)
        self._d, self._t = self._form.columns(statement.d), self._form.columns(statement.t)

    def solve(
        self,
        gradient: Float[np.ndarray, " columns"],
        hessian: sparse.csr_array | None,
        constraints: Constraints,
        *,
        radius: float,
        penalty: float = 1.0,
        near: Int[np.ndarray, " near"] | None = None,
        tolerance: float = CLARABEL_TOLERANCE,
    ) -> Step:
        """Return the solution for these numbers, without a Hessian that with a ball.

        Only inequalities ``near`` count, by default those within reach. Raises SolverFailed if Clarabel finds none.
        """
        scales = constraints.row_norms.copy()
        scales[: self._elastic] = 1.0  # their units decide what a violation costs
        numbers = _numbers(gradient, hessian, constraints, radius, penalty, scales)
        near = constraints.within_reach(radius, order=1) if near is None else near
        mask = self._form.rows_in_use(self._rows, near)
        name, P = ("criticality", None) if hessian is None else ("step", self._quadratic(hessian))
        x, dual = self._form.solve(name, numbers, mask, tolerance, P)
        multipliers = np.zeros(self._rows)
        multipliers[near] = dual[: len(near)] / scales[near]
        cone_rows = sum(len(cone.values) + 1 for cone in constraints.cones)
        return Step(
            step=x[self._d],
            violation=float(x[self._t[0]]),
            multipliers=multipliers,
            cone_multipliers=constraints.cone_multipliers(dual[len(dual) - cone_rows :]),
        )

    def _quadratic(self, hessian: sparse.csr_array) -> sparse.csc_matrix:
        """Return P: the upper triangle of the Hessian in the rows and columns of d."""
        lower, size = np.tril(hessian.toarray()), self._form.variables
        column, row = np.nonzero(lower)  # rows of the lower triangle are columns of the upper one
        indptr = np.searchsorted(self._d[column], np.arange(size + 1))
        return sparse.csc_matrix((lower[column, row], self._d[row], indptr), shape=(size, size))


subproblem_of = lru_cache(maxsize=64)(ConvexSubproblem)  # canonicalised statements


def _state(pattern: Pattern, elastic: int, hessian: sparse.csr_array | None) -> Statement:
    """Return the statement for a pattern and a Hessian, which is a constant: dᵀHd takes no Parameter H."""
    import cvxpy  # here: importing it takes two seconds

    (rows, columns), unknowns, parameters = pattern.jacobian.shape, pattern.unknowns, Parameters()
    d, t = cvxpy.Variable(columns), cvxpy.Variable()
    radius, penalty = parameters.dense(), parameters.dense()
    constraints, inequalities, objective = [], None, penalty * t
    if hessian is not None:
        objective += parameters.dense(columns) @ d + cvxpy.quad_form(d, cvxpy.psd_wrap(hessian)) / 2
    if rows:
        c, J = parameters.dense(rows), parameters.sparse(pattern.jacobian)
        is_elastic = (np.arange(rows) < elastic).astype(float)
        inequalities = c + J @ d + is_elastic * t >= 0
        constraints = [inequalities]
    step = d[:unknowns]
    constraints += [cvxpy.SOC(radius, step)] if hessian is None else [step <= radius, step >= -radius, t >= 0]
    cones = state_cones(pattern, d, parameters)
    problem = cvxpy.Problem(cvxpy.Minimize(objective), constraints + cones)
    return Statement(problem, parameters, d, t, inequalities, cones)


def _numbers(
    gradient: np.ndarray,
    hessian: sparse.csr_array | None,
    constraints: Constraints,
    radius: float,
    penalty: float,
    scales: np.ndarray,
) -> Float[np.ndarray, " numbers"]:
    """Return the values of all parameters, in the statement's order, inequalities divided by ``scales``."""
    linear = gradient[: 0 if hessian is None else len(gradient)]
    first = [radius, penalty], linear, constraints.values / scales
    return parameter_values(*first, constraints=constraints, scales=scales)


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
    """Return what ``solve_subproblem`` does, by cvxpy's own solve of the same statement.

    Raises SolverFailed if there is no solution.
    """
    statement = _state(Pattern.of(constraints), elastic, hessian)
    scales = np.ones(len(constraints.values))
    statement.parameters.assign(_numbers(gradient, hessian, constraints, radius, penalty, scales))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # cvxpy reads its own sparse parameters as dense ones
        warnings.filterwarnings("ignore", "Solution may be inaccurate")  # Clarabel stopped short of the tolerance
        tolerances = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
        statement.problem.solve(solver="CLARABEL", **tolerances)
    if statement.d.value is None:
        raise SolverFailed(f"step: a solution wanted, got {statement.problem.status}")
    return Step(
        step=np.array(statement.d.value),
        violation=float(statement.t.value),
        multipliers=np.zeros(0) if statement.inequalities is None else np.array(statement.inequalities.dual_value),
        cone_multipliers=tuple(-np.ravel(cone.dual_value[1]) for cone in statement.cones),
    )
