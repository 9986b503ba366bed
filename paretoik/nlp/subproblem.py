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

import clarabel
import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import SolverFailed
from paretoik.nlp.conic import Constraints, Entries, run_clarabel

TOLERANCE = 1e-10  # of Clarabel's gaps and infeasibilities
PATTERNS = 64  # canonicalised statements that are remembered


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


class _Structure(NamedTuple):
    """The shape of a sparse matrix and where its entries stand, in compressed sparse rows."""

    shape: tuple[int, int]
    indptr: bytes
    indices: bytes

    @classmethod
    def of(cls, matrix: sparse.csr_array) -> _Structure:
        return cls(matrix.shape, matrix.indptr.astype(np.int32).tobytes(), matrix.indices.astype(np.int32).tobytes())

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Row and column of every entry."""
        indptr = np.frombuffer(self.indptr, dtype=np.int32)
        return np.repeat(np.arange(self.shape[0]), np.diff(indptr)), np.frombuffer(self.indices, dtype=np.int32)


class _Pattern(NamedTuple):
    """What the statement depends on besides numbers."""

    unknowns: int
    elastic: int
    jacobian: _Structure
    cones: tuple[tuple[int, _Structure], ...]

    @classmethod
    def of(cls, constraints: Constraints, elastic: int) -> _Pattern:
        cones = tuple((cone.column, _Structure.of(cone.rows)) for cone in constraints.cones)
        return cls(constraints.unknowns, elastic, _Structure.of(constraints.jacobian), cones)


class _Statement(NamedTuple):
    """The statement in cvxpy: its parameters in their order, each with its structure if it is sparse."""

    problem: Any
    d: Any
    t: Any
    parameters: list[tuple[Any, _Structure | None]]
    inequalities: Any
    cones: list[Any]

    @classmethod
    def of(cls, pattern: _Pattern, hessian: sparse.csr_array) -> _Statement:
        """Return the statement for a pattern and a Hessian, which is a constant: dᵀHd takes no Parameter H."""
        import cvxpy  # here: importing it takes two seconds

        (rows, columns), unknowns = pattern.jacobian.shape, pattern.unknowns
        parameters = list[tuple[Any, _Structure | None]]()

        def parameter(*shape: int, structure: _Structure | None = None) -> Any:
            if structure is None:
                parameters.append((cvxpy.Parameter(shape), None))
            else:
                parameters.append((cvxpy.Parameter(structure.shape, sparsity=structure.places), structure))
            return parameters[-1][0]

        d, t = cvxpy.Variable(columns), cvxpy.Variable()
        g, penalty, radius = parameter(columns), parameter(), parameter()
        constraints, inequalities = [], None
        if rows:
            c, is_elastic = parameter(rows), (np.arange(rows) < pattern.elastic).astype(float)
            J = parameter(structure=pattern.jacobian) if pattern.jacobian.indices else np.zeros((rows, columns))
            inequalities = c + J @ d + is_elastic * t >= 0
            constraints = [inequalities]
        constraints += [d[:unknowns] <= radius, d[:unknowns] >= -radius, t >= 0]
        cones = []
        for column, structure in pattern.cones:
            length, values, vectors = parameter(), parameter(structure.shape[0]), parameter(structure=structure)
            cones.append(cvxpy.SOC(d[column] + length, values + vectors @ d))
        objective = g @ d + cvxpy.quad_form(d, cvxpy.psd_wrap(hessian)) / 2 + penalty * t
        problem = cvxpy.Problem(cvxpy.Minimize(objective), constraints + cones)
        return cls(problem, d, t, parameters, inequalities, cones)

    def assign(self, numbers: np.ndarray) -> None:
        """Give all parameters their values, those of sparse ones in the order of compressed sparse rows."""
        first = 0
        for parameter, structure in self.parameters:
            count = parameter.size if structure is None else len(structure.places[0])
            values = numbers[first : first + count]
            first += count
            if structure is None:
                parameter.value = values.reshape(parameter.shape)
            else:
                entries = sparse.coo_array((values, structure.places), shape=structure.shape).tocsr()
                ordered = np.asarray(entries[parameter.sparse_idx]).ravel()  # cvxpy has an order of its own
                parameter.value_sparse = sparse.coo_array((ordered, parameter.sparse_idx), shape=structure.shape)


class ConvexSubproblem:
    """The subproblem of one sparsity pattern, canonicalised: Clarabel's data as linear functions of the parameters."""

    def __init__(self, pattern: _Pattern) -> None:
        import cvxpy  # here: importing it takes two seconds
        from cvxpy.cvxcore.python.canonInterface import get_parameter_vector

        (self._rows, columns), self._elastic = pattern.jacobian.shape, pattern.elastic
        statement = _Statement.of(pattern, sparse.eye_array(columns, format="csr"))  # the Hessian replaces the identity
        # Entries of all parameters are numbered from 2 on, 1 being the constant, and looked for in cvxpy's own vector.
        size = sum(p.size if structure is None else len(structure.places[0]) for p, structure in statement.parameters)
        statement.assign(np.arange(2.0, size + 2.0))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # cvxpy reads its own sparse parameters as dense ones
            canonical = statement.problem.get_problem_data(cvxpy.CLARABEL)[0]["param_prob"]
        values = {parameter.id: np.asarray(parameter.value) for parameter in canonical.parameters}
        numbers = get_parameter_vector(
            canonical.total_param_size, canonical.param_id_to_col, canonical.param_id_to_size, values.__getitem__
        )
        self._order = np.round(numbers).astype(int) - 1
        self._linear, self._matrix = sparse.csr_array(canonical.q)[:-1], canonical.reduced_A.reduced_mat
        self._indices, self._indptr, (self._height, self._width) = canonical.reduced_A.problem_data_index
        self._heights = list(canonical.cone_dims.soc)
        self._d = canonical.var_id_to_col[statement.d.id] + np.arange(columns)
        self._t = canonical.var_id_to_col[statement.t.id]

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
        vector = np.append(1.0, numbers)[self._order]
        near = constraints.within_reach(radius, order=1)
        A, b = self._cut(self._matrix @ vector, near)
        cones = [clarabel.NonnegativeConeT(len(b) - sum(self._heights)), *map(clarabel.SecondOrderConeT, self._heights)]
        solution = run_clarabel("step", self._quadratic(hessian), self._linear @ vector, A, b, cones, TOLERANCE)
        multipliers = np.zeros(self._rows)
        multipliers[near] = solution.dual[: len(near)] / scales[near]
        return Step(
            step=solution.x[self._d],
            violation=max(float(solution.x[self._t]), 0.0),
            multipliers=multipliers,
            cone_multipliers=constraints.cone_multipliers(solution.dual[len(b) - sum(self._heights) :]),
        )

    def _cut(self, entries: np.ndarray, near: np.ndarray) -> tuple[sparse.csc_matrix, np.ndarray]:
        """Return A and b of the inequalities ``near`` and all further rows; cvxpy's rows are A x + b."""
        used = np.ones(self._height, dtype=bool)
        used[: self._rows] = False
        used[near] = True
        chosen = used[self._indices]
        row = (np.cumsum(used) - 1)[self._indices[chosen]]
        indptr = np.append(0, np.cumsum(chosen))[self._indptr]
        entries, last = entries[chosen], indptr[-2]
        b = np.zeros(np.count_nonzero(used))
        b[row[last:]] = entries[last:]
        shape = (len(b), self._width - 1)
        return sparse.csc_matrix((-entries[:last], row[:last], indptr[:-1]), shape=shape), b

    def _quadratic(self, hessian: sparse.csr_array) -> sparse.csc_matrix:
        """Return P, the Hessian's upper triangle where d stands."""
        row, column, value = Entries.of(hessian)
        upper = column <= row  # of a symmetric matrix, rows of the lower triangle are columns of the upper one
        indptr = np.append(0, np.cumsum(np.bincount(row[upper], minlength=hessian.shape[0])))
        indptr = np.pad(indptr, (self._d[0], self._width - 2 - self._d[-1]), mode="edge")
        return sparse.csc_matrix((value[upper], column[upper] + self._d[0], indptr), shape=(self._width - 1,) * 2)


@lru_cache(maxsize=PATTERNS)
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
    statement.assign(_numbers(gradient, constraints, radius, penalty, np.ones(len(constraints.values))))
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
