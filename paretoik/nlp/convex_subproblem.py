"""The convex subproblem of SQP steps and the criticality.

It is stated in cvxpy and solved by Clarabel.

minimise    gᵀd + ½ dᵀHd + penalty · t
subject to  c + J d + t ≥ 0       elastic inequalities: violated by at most t, at a penalty
            c + J d ≥ 0           inequalities that tie auxiliary columns
            |dᵢ| ≤ radius         steps along the equalities: the trust region
            ‖values + rows d‖ ≤ d[column] + ‖values‖     cones
            t ≥ 0

Sequential quadratic programming solves it as it is. The criticality (``nlp.criticality``) is its special case without
gᵀd + ½ dᵀHd: the trust region is a ball and t is free.

The statement has Parameters for all numbers. It is canonicalised once for each pattern: the structure of a program,
which does not depend on numbers that happen to be 0. cvxpy's canonical form is linear in the parameters:

minimise    ½ xᵀPx + qᵀx
subject to  b − Ax ∈ K, a product of zero, nonnegative and second-order cones

Each solution multiplies cvxpy's matrix by the parameters' values, which gives q, A and b, leaves out the inequalities
that no step within the trust region reaches, and runs Clarabel on the rest. Tests compare it with cvxpy's ``solve``.
Source: Nocedal & Wright, Numerical Optimization, section 18.5, with the largest violation as penalty.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import clarabel
import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from paretoik.errors import SolverFailed
from paretoik.nlp.program import CLARABEL_TOLERANCE, Constraints, Structure


class Pattern(NamedTuple):
    """The structure of a statement, without its numbers."""

    unknowns: int
    jacobian: Structure
    cones: tuple[tuple[int, Structure], ...]

    @classmethod
    def of(cls, constraints: Constraints) -> Pattern:
        """Return the pattern of constraints."""
        cones = tuple((cone.column, Structure.of(cone.rows)) for cone in constraints.cones)
        return cls(constraints.unknowns, Structure.of(constraints.jacobian), cones)


class Statement(NamedTuple):
    """A statement in cvxpy; its ``parameters`` are those of ``parameter_values``, in the same order."""

    problem: Any
    parameters: list[Any]
    d: Any
    t: Any


def state(pattern: Pattern, elastic: int, hessian: sparse.csr_array | None) -> Statement:
    """Return the statement for a pattern and a constant Hessian: dᵀHd allows no Parameter H."""
    import cvxpy  # here: importing it takes two seconds

    (rows, columns), unknowns, parameters = pattern.jacobian.shape, pattern.unknowns, list[Any]()
    d, t = cvxpy.Variable(columns), cvxpy.Variable()

    def numbers(*shape: int) -> Any:
        parameters.append(cvxpy.Parameter(shape))
        return parameters[-1]

    def product(structure: Structure) -> Any:
        """Return matrix · d; the matrix has a Parameter's numbers at the places of a structure."""
        row, column = structure.places
        if not len(row):
            return np.zeros(structure.shape[0])
        places = (row + structure.shape[0] * column, np.arange(len(row)))  # in the matrix by columns
        spread = sparse.csc_array((np.ones(len(row)), places), shape=(structure.shape[0] * columns, len(row)))
        return cvxpy.reshape(spread @ numbers(len(row)), structure.shape, order="F") @ d

    radius, penalty = numbers(), numbers()
    constraints, objective = [], penalty * t
    if hessian is not None:
        objective += numbers(columns) @ d + cvxpy.quad_form(d, cvxpy.psd_wrap(hessian)) / 2
    if rows:
        c = numbers(rows)
        constraints = [c + product(pattern.jacobian) + (np.arange(rows) < elastic).astype(float) * t >= 0]
    step = d[:unknowns]
    constraints += [cvxpy.SOC(radius, step)] if hessian is None else [step <= radius, step >= -radius, t >= 0]
    for column, structure in pattern.cones:
        length, values = numbers(), numbers(structure.shape[0])
        constraints.append(cvxpy.SOC(d[column] + length, values + product(structure)))
    return Statement(cvxpy.Problem(cvxpy.Minimize(objective), constraints), parameters, d, t)


def parameter_values(
    gradient: np.ndarray,
    hessian: sparse.csr_array | None,
    constraints: Constraints,
    radius: float,
    penalty: float,
    scales: np.ndarray,
) -> list[np.ndarray]:
    """Return the values of a statement's parameters, in its order; ``scales`` divide inequalities."""
    linear = gradient[: 0 if hessian is None else len(gradient)]
    parts = [np.array(radius), np.array(penalty), linear, constraints.values / scales]
    parts.append(constraints.jacobian.data / scales[constraints.entries.row])
    for cone in constraints.cones:
        parts += [np.array(np.linalg.norm(cone.values)), cone.values, cone.rows.data]
    return [part for part in parts if part.size]


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """A step d, its violation t, and the multipliers of inequalities and of vectors in cones.

    In the criticality t may be negative: −t is the gain of all elastic inequalities.
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
    """Return the solution of the subproblem with the first ``elastic`` inequalities elastic.

        minimise    gᵀd + ½ dᵀHd + penalty · t
        subject to  c + J d + t ≥ 0 (elastic),  c + J d ≥ 0 (others),  |dᵢ| ≤ radius,  t ≥ 0,  cones

    ``hessian`` must be symmetric and positive semidefinite. Raises SolverFailed if Clarabel ends without a solution.
    """
    return subproblem_of(Pattern.of(constraints), elastic).solve(
        gradient, hessian, constraints, radius=radius, penalty=penalty, tolerance=tolerance
    )


def convexify(hessian: sparse.csr_array, unknowns: int, flattening: float) -> sparse.csr_array:
    """Return the Hessian with negative eigenvalues raised to nearly 0; the trust region bounds steps along them.

    Reflecting them, or stiffening the Hessian across active inequalities, took two to five times as many steps if
    curvature comes from kinks; the latter took 1.2 times as many on small dense programs.
    """
    dense = hessian.toarray()
    indices = np.flatnonzero(np.any(dense != 0, axis=1) | (np.arange(len(dense)) < unknowns))
    inner = dense[np.ix_(indices, indices)]
    smallest = flattening * max(float(np.abs(inner).max(initial=0.0)), 1e-12)
    if is_positive_definite(inner + 1e-2 * smallest * np.eye(len(inner))):
        return hessian
    values, vectors = np.linalg.eigh(inner)
    convex = (vectors * np.maximum(values, smallest)) @ vectors.T
    row, column = np.nonzero(convex)
    return sparse.csr_array((convex[row, column], (indices[row], indices[column])), shape=dense.shape)


def is_positive_definite(matrix: Float[np.ndarray, "size size"]) -> bool:
    """Return whether a symmetric matrix is positive definite, by Cholesky's factorisation."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True


class ConvexSubproblem:
    """The canonicalised subproblem of one pattern; with a ``ball`` it is that of the criticality."""

    def __init__(self, pattern: Pattern, elastic: int, *, ball: bool = False) -> None:
        import cvxpy  # here: importing it takes two seconds

        (self._rows, columns), self._elastic = pattern.jacobian.shape, elastic
        hessian = None if ball else sparse.eye_array(columns, format="csr")  # replaced at every solution
        problem, parameters, d, t = state(pattern, elastic, hessian)
        canonical = problem.get_problem_data(cvxpy.CLARABEL)[0]["param_prob"]
        # places of all parameters in cvxpy's own vector, whose other entry is 1
        places = [canonical.param_id_to_col[each.id] + np.arange(each.size) for each in parameters]
        self._places, self._size = np.concatenate(places), canonical.total_param_size + 1
        self._linear, self._matrix = sparse.csr_array(canonical.q)[:-1], canonical.reduced_A.reduced_mat
        self._indices, self._indptr, (self._all_rows, width) = canonical.reduced_A.problem_data_index
        self._variables, self._equalities = width - 1, canonical.cone_dims.zero
        self._cones = list(canonical.cone_dims.soc)
        self._d, self._t = (canonical.var_id_to_col[each.id] + np.arange(each.size) for each in (d, t))

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
        """Return the solution for these numbers; with a ball there is no Hessian.

        Only inequalities ``near`` count, by default those within reach. Raises SolverFailed if Clarabel finds none.
        """
        scales = constraints.row_norms.copy()
        scales[: self._elastic] = 1.0  # not scaled: their units determine the cost of a violation
        numbers = parameter_values(gradient, hessian, constraints, radius, penalty, scales)
        near = constraints.within_reach(radius, order=1) if near is None else near
        mask = np.ones(self._all_rows, dtype=bool)  # which rows of A are used
        mask[: self._rows] = False
        mask[near] = True
        vector = np.ones(self._size)
        vector[self._places] = np.hstack(numbers)
        # a and b of the rows in a ``mask``; cvxpy's rows are A x + b
        entries = self._matrix @ vector
        chosen = mask[self._indices]
        row = (np.cumsum(mask) - 1)[self._indices[chosen]]
        indptr = np.append(0, np.cumsum(chosen))[self._indptr]
        entries, last = entries[chosen], indptr[-2]
        b = np.zeros(np.count_nonzero(mask))
        b[row[last:]] = entries[last:]
        A = sparse.csc_matrix((-entries[:last], row[:last], indptr[:-1]), shape=(len(b), self._variables))
        linear = len(b) - self._equalities - sum(self._cones)
        cones: list[Any] = [
            *([clarabel.ZeroConeT(self._equalities)] if self._equalities else []),
            *([clarabel.NonnegativeConeT(linear)] if linear else []),
            *map(clarabel.SecondOrderConeT, self._cones),
        ]
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
        P = self._quadratic(hessian)
        solution = clarabel.DefaultSolver(P, self._linear @ vector, A, b, cones, settings).solve()
        if str(solution.status) not in ("Solved", "AlmostSolved"):
            name = "criticality" if hessian is None else "step"
            raise SolverFailed(f"{name}: Clarabel must end with Solved, got {solution.status}")
        x, dual = np.array(solution.x), np.array(solution.z)
        multipliers = np.zeros(self._rows)
        multipliers[near] = dual[: len(near)] / scales[near]
        cone_rows = sum(len(cone.values) + 1 for cone in constraints.cones)
        return Step(
            step=x[self._d],
            violation=float(x[self._t[0]]),
            multipliers=multipliers,
            cone_multipliers=constraints.cone_multipliers(dual[len(dual) - cone_rows :]),
        )

    def _quadratic(self, hessian: sparse.csr_array | None) -> sparse.csc_matrix:
        """Return P: the Hessian's upper triangle in d's rows and columns, no entries without a Hessian."""
        shape = (self._variables, self._variables)
        if hessian is None:
            return sparse.csc_matrix(shape)
        lower = np.tril(hessian.toarray())
        column, row = np.nonzero(lower)  # rows of the lower triangle are columns of the upper one
        indptr = np.searchsorted(self._d[column], np.arange(self._variables + 1))
        return sparse.csc_matrix((lower[column, row], self._d[row], indptr), shape=shape)


subproblem_of = lru_cache(maxsize=64)(ConvexSubproblem)  # canonicalised statements
