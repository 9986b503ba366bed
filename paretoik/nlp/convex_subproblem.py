"""The convex subproblem of SQP steps and the criticality.

It is stated in cvxpy and solved by Clarabel.

minimise    gᵀd + ½ dᵀHd + penalty · t
subject to  c + J d + t ≥ 0       elastic inequalities: violated by at most t, at a penalty
            c + J d ≥ 0           inequalities that tie auxiliary columns
            |dᵢ| ≤ radius         steps along the equalities: the trust region
            ‖values + rows d‖ ≤ d[column] + ‖values‖     cones
            t ≥ 0

Sequential quadratic programming solves it as it is. In the criticality (``nlp.criticality``) there is no gᵀd + ½ dᵀHd,
the trust region is a ball, and t may be negative.

It is canonicalised once for each pattern (the structure of a program), with the placeholders 2, 3, 4, … as its numbers.
cvxpy's canonical form is

minimise    ½ xᵀPx + qᵀx
subject to  b − Ax ∈ K, a product of zero, nonnegative and second-order cones

Each entry of q, A and b is a placeholder with a sign, or a constant 0 or ±1, so it tells which number belongs there.
cvxpy's Parameters would do the same, but need memory for each pair of a number and a variable: 6 GB for a Panda's
motion of 81 samples. Each solution puts its own numbers in, leaves out the inequalities that no step within the trust
region reaches, and runs Clarabel on the rest. Tests compare it with cvxpy's ``solve``.
Source: Nocedal & Wright, Numerical Optimization, section 18.5, with the largest violation as penalty.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
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
    """A statement in cvxpy with its variables."""

    problem: Any
    d: Any
    t: Any


def state(pattern: Pattern, elastic: int, hessian: sparse.csr_array | None, values: Iterator[float]) -> Statement:
    """Return the statement for a pattern; ``values`` are its numbers, in the order of ``statement_values``."""
    import cvxpy  # here: importing it takes two seconds

    (rows, columns), unknowns = pattern.jacobian.shape, pattern.unknowns
    d, t = cvxpy.Variable(columns), cvxpy.Variable()

    def numbers(size: int) -> Float[np.ndarray, " size"]:
        return np.fromiter(values, float, size)

    def product(structure: Structure) -> Any:
        """Return A · d; A's nonzeros, placed by ``structure``, are read from ``values``."""
        row, column = structure.places
        entries = numbers(len(row))
        return sparse.csc_array((entries, (row, column)), shape=structure.shape) @ d

    radius, penalty = numbers(2)
    constraints, objective = [], penalty * t
    if hessian is not None:
        objective += numbers(columns) @ d + cvxpy.quad_form(d, cvxpy.psd_wrap(hessian)) / 2
    if rows:
        c = numbers(rows)
        constraints = [c + product(pattern.jacobian) + (np.arange(rows) < elastic).astype(float) * t >= 0]
    step = d[:unknowns]
    constraints += (
        [cvxpy.SOC(cvxpy.Constant(radius), step)] if hessian is None else [step <= radius, step >= -radius, t >= 0]
    )
    for column, structure in pattern.cones:
        length, shift = numbers(1)[0], numbers(structure.shape[0])
        constraints.append(cvxpy.SOC(d[column] + length, shift + product(structure)))
    return Statement(cvxpy.Problem(cvxpy.Minimize(objective), constraints), d, t)


def statement_values(
    gradient: np.ndarray,
    hessian: sparse.csr_array | None,
    constraints: Constraints,
    radius: float,
    penalty: float,
    scales: np.ndarray,
) -> Float[np.ndarray, " numbers"]:
    """Return the numbers of a statement, in order; inequalities are divided by ``scales``."""
    linear = gradient[: 0 if hessian is None else len(gradient)]
    parts = [np.array([radius, penalty]), linear, constraints.values / scales]
    parts.append(constraints.jacobian.data / scales[constraints.entries.row])
    for cone in constraints.cones:
        parts += [np.array([np.linalg.norm(cone.values)]), cone.values, cone.rows.data]
    return np.concatenate(parts)


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """A step d, its violation t, and the multipliers of inequalities and of vectors in cones.

    In the criticality t may be negative; −t is then the gain of all elastic inequalities.
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

    Two other ways, to reflect them or to stiffen the Hessian normal to active inequalities, took two to five times as
    many steps if curvature comes from kinks. The second took 1.2 times as many on small dense programs.
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


class _Places(NamedTuple):
    """The numbers of a statement that entries of its canonical form contain.

    place: 1 + index of each entry's number; 0 for a constant entry
    factor: sign of each entry's number, or the constant
    """

    place: Int[np.ndarray, " entries"]
    factor: Float[np.ndarray, " entries"]

    @classmethod
    def of(cls, entries: Float[np.ndarray, " entries"]) -> _Places:
        """Return the places, given entries with the placeholders 2, 3, 4 and so on."""
        place = np.maximum(np.abs(entries).astype(int) - 1, 0)
        factor = np.where(place > 0, np.sign(entries), entries)
        assert np.array_equal(entries, np.where(place > 0, factor * (place + 1), factor)), "a number, 0 or ±1"
        return cls(place, factor)

    def fill(self, numbers: Float[np.ndarray, " numbers"]) -> Float[np.ndarray, " entries"]:
        """Return the entries for other numbers."""
        return self.factor * np.append(1.0, numbers)[self.place]


class ConvexSubproblem:
    """The canonicalised subproblem of one pattern, or of its criticality if ``ball``."""

    def __init__(self, pattern: Pattern, elastic: int, *, ball: bool = False) -> None:
        import cvxpy  # here: importing it takes two seconds

        (self._rows, columns), self._elastic = pattern.jacobian.shape, elastic
        hessian = None if ball else sparse.eye_array(columns, format="csr")  # replaced at every solution
        problem, d, t = state(pattern, elastic, hessian, count(2.0))
        canonical = problem.get_problem_data(cvxpy.CLARABEL)[0]
        A, cones = canonical["A"].tocsc(), canonical["dims"]
        self._linear, self._bounds, self._entries = map(_Places.of, (canonical["c"], canonical["b"], A.data))
        self._indices, self._indptr = A.indices, A.indptr
        self._equalities, self._cones = cones.zero, list(cones.soc)
        columns_of = canonical["param_prob"].var_id_to_col
        self._d, self._t = (columns_of[each.id] + np.arange(each.size) for each in (d, t))

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
        """Return the solution for these numbers.

        hessian: Hessian; None for the criticality
        near: indices of the inequalities that count; None for those within reach

        Raises SolverFailed if Clarabel finds no solution.
        """
        scales = constraints.row_norms.copy()
        scales[: self._elastic] = 1.0  # not scaled: their units determine the cost of a violation
        numbers = statement_values(gradient, hessian, constraints, radius, penalty, scales)
        near = constraints.within_reach(radius, order=1) if near is None else near
        mask = np.ones(len(self._bounds.place), dtype=bool)  # which rows of A are used
        mask[: self._rows] = False
        mask[near] = True
        b = self._bounds.fill(numbers)[mask]
        chosen = mask[self._indices]
        row = (np.cumsum(mask) - 1)[self._indices[chosen]]
        indptr = np.append(0, np.cumsum(chosen))[self._indptr]
        A = sparse.csc_matrix((self._entries.fill(numbers)[chosen], row, indptr), shape=(len(b), len(indptr) - 1))
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
        solution = clarabel.DefaultSolver(P, self._linear.fill(numbers), A, b, cones, settings).solve()
        if str(solution.status) not in ("Solved", "AlmostSolved"):
            name = "criticality" if hessian is None else "step"
            raise SolverFailed(f"{name}: Clarabel's status must be Solved, got {solution.status}")
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
        """Return P: the Hessian's upper triangle in d's rows and columns; no entries without a Hessian."""
        variables = len(self._indptr) - 1
        shape = (variables, variables)
        if hessian is None:
            return sparse.csc_matrix(shape)
        lower = np.tril(hessian.toarray())
        column, row = np.nonzero(lower)  # rows of the lower triangle are columns of the upper one
        indptr = np.searchsorted(self._d[column], np.arange(variables + 1))
        return sparse.csc_matrix((lower[column, row], self._d[row], indptr), shape=shape)


subproblem_of = lru_cache(maxsize=64)(ConvexSubproblem)  # canonicalised statements
