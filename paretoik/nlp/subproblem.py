"""The convex subproblem of sequential quadratic programming, stated in cvxpy and solved by Clarabel.

minimise    gᵀd + ½ dᵀHd + penalty · t
subject to  c + J d + t ≥ 0       elastic inequalities: violated by at most t, at a penalty
            c + J d ≥ 0           inequalities that tie auxiliary columns
            |dᵢ| ≤ radius         steps along the equalities: the trust region
            ‖values + rows d‖ ≤ d[column] + ‖values‖     cones
            t ≥ 0

The statement has Parameters for all numbers and is canonicalised once for each sparsity pattern. A solution then takes
one product of cvxpy's matrix from parameters to data with their values, leaves out the inequalities that no step within
the trust region reaches, and runs Clarabel on the rest. Source: Nocedal & Wright, Numerical Optimization, section 18.5,
with the largest violation as penalty.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import SolverFailed
from paretoik.nlp.canonical import CanonicalForm, Parameters, Structure
from paretoik.nlp.conic import Constraints, Entries

TOLERANCE = 1e-10  # of Clarabel's gaps and infeasibilities


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """A step d, the violation t that it leaves, and the multipliers of inequalities and of the vectors in cones."""

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
) -> Step:
    """Return the solution where the first ``elastic`` inequalities are elastic.

    ``hessian`` has to be symmetric and positive semidefinite. Raises SolverFailed where Clarabel ends without a
    solution.
    """
    subproblem = _subproblem(_Pattern.of(constraints, elastic))
    return subproblem.solve(gradient, hessian, constraints, radius=radius, penalty=penalty)


class _Pattern(NamedTuple):
    """What the statement depends on besides numbers."""

    unknowns: int
    elastic: int
    jacobian: Structure
    cones: tuple[tuple[int, Structure], ...]

    @classmethod
    def of(cls, constraints: Constraints, elastic: int) -> _Pattern:
        cones = tuple((cone.column, Structure.of(cone.rows)) for cone in constraints.cones)
        return cls(constraints.unknowns, elastic, Structure.of(constraints.jacobian), cones)


class _Statement(NamedTuple):
    """The statement in cvxpy."""

    problem: Any
    parameters: Parameters
    d: Any
    t: Any
    inequalities: Any
    cones: list[Any]

    @classmethod
    def of(cls, pattern: _Pattern, hessian: sparse.csr_array) -> _Statement:
        """Return the statement for a pattern and a Hessian, which is a constant: dᵀHd takes no Parameter H."""
        import cvxpy  # here: importing it takes two seconds

        (rows, columns), unknowns, parameters = pattern.jacobian.shape, pattern.unknowns, Parameters()
        d, t = cvxpy.Variable(columns), cvxpy.Variable()
        g, penalty, radius = parameters.dense(columns), parameters.dense(), parameters.dense()
        constraints, inequalities = [], None
        if rows:
            c, J = parameters.dense(rows), parameters.sparse(pattern.jacobian)
            is_elastic = (np.arange(rows) < pattern.elastic).astype(float)
            inequalities = c + J @ d + is_elastic * t >= 0
            constraints = [inequalities]
        constraints += [d[:unknowns] <= radius, d[:unknowns] >= -radius, t >= 0]
        cones = []
        for column, structure in pattern.cones:
            length, values = parameters.dense(), parameters.dense(structure.shape[0])
            cones.append(cvxpy.SOC(d[column] + length, values + parameters.sparse(structure) @ d))
        objective = g @ d + cvxpy.quad_form(d, cvxpy.psd_wrap(hessian)) / 2 + penalty * t
        return cls(cvxpy.Problem(cvxpy.Minimize(objective), constraints + cones), parameters, d, t, inequalities, cones)


class ConvexSubproblem:
    """The subproblem of one sparsity pattern, canonicalised."""

    def __init__(self, pattern: _Pattern) -> None:
        (self._rows, columns), self._elastic = pattern.jacobian.shape, pattern.elastic
        statement = _Statement.of(pattern, sparse.eye_array(columns, format="csr"))  # the Hessian replaces the identity
        self._form = CanonicalForm(statement.problem, statement.parameters)
        self._d, self._t = self._form.columns(statement.d), self._form.columns(statement.t)

    def solve(
        self,
        gradient: Float[np.ndarray, " columns"],
        hessian: sparse.csr_array,
        constraints: Constraints,
        *,
        radius: float,
        penalty: float,
    ) -> Step:
        """Return the solution for these numbers. Raises SolverFailed where Clarabel ends without one."""
        scales = constraints.row_norms.copy()
        scales[: self._elastic] = 1.0  # their units decide what a violation costs
        numbers = _numbers(gradient, constraints, radius, penalty, scales)
        near = constraints.within_reach(radius, order=1)
        used = np.ones(self._form.rows, dtype=bool)
        used[: self._rows] = False
        used[near] = True
        solution = self._form.solve("step", numbers, self._quadratic(hessian), used, TOLERANCE)
        multipliers = np.zeros(self._rows)
        multipliers[near] = solution.dual[: len(near)] / scales[near]
        cone_rows = sum(len(cone.values) + 1 for cone in constraints.cones)
        return Step(
            step=solution.x[self._d],
            violation=max(float(solution.x[self._t[0]]), 0.0),
            multipliers=multipliers,
            cone_multipliers=constraints.cone_multipliers(solution.dual[len(solution.dual) - cone_rows :]),
        )

    def _quadratic(self, hessian: sparse.csr_array) -> sparse.csc_matrix:
        """Return P, the Hessian's upper triangle where d stands."""
        row, column, value = Entries.of(hessian)
        upper, size = column <= row, self._form.variables  # rows of the lower triangle are columns of the upper one
        indptr = np.append(0, np.cumsum(np.bincount(row[upper], minlength=hessian.shape[0])))
        indptr = np.pad(indptr, (self._d[0], size - 1 - self._d[-1]), mode="edge")
        return sparse.csc_matrix((value[upper], column[upper] + self._d[0], indptr), shape=(size, size))


@lru_cache(maxsize=64)  # canonicalised statements
def _subproblem(pattern: _Pattern) -> ConvexSubproblem:
    return ConvexSubproblem(pattern)


def _numbers(
    gradient: np.ndarray, constraints: Constraints, radius: float, penalty: float, scales: np.ndarray
) -> Float[np.ndarray, " numbers"]:
    """Return the values of all parameters, in the statement's order, inequalities divided by ``scales``."""
    numbers = [gradient, [penalty], [radius], constraints.values / scales]
    numbers.append(constraints.jacobian.data / scales[constraints.entries.row])
    for cone in constraints.cones:
        numbers += [[np.linalg.norm(cone.values)], cone.values, cone.rows.data]
    return np.concatenate(numbers)


def solve_with_cvxpy(
    gradient: Float[np.ndarray, " columns"],
    hessian: sparse.csr_array,
    constraints: Constraints,
    *,
    elastic: int,
    radius: float,
    penalty: float,
) -> Step:
    """Return what ``solve_subproblem`` does, by cvxpy's own solve of the same statement.

    Raises SolverFailed where there is no solution.
    """
    import cvxpy  # here: importing it takes two seconds

    statement = _Statement.of(_Pattern.of(constraints, elastic), hessian)
    statement.parameters.assign(_numbers(gradient, constraints, radius, penalty, np.ones(len(constraints.values))))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # cvxpy reads its own sparse parameters as dense ones
        statement.problem.solve(solver=cvxpy.CLARABEL)
    if statement.d.value is None:
        raise SolverFailed(f"step: a solution wanted, got {statement.problem.status}")
    return Step(
        step=np.array(statement.d.value),
        violation=max(float(statement.t.value), 0.0),
        multipliers=np.zeros(0) if statement.inequalities is None else np.array(statement.inequalities.dual_value),
        cone_multipliers=tuple(-np.ravel(cone.dual_value[1]) for cone in statement.cones),
    )
