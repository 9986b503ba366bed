"""Statements in cvxpy that are canonicalised once and then solved by Clarabel for any values of their parameters.

minimise    ½ xᵀPx + qᵀx
subject to  b − Ax ∈ K, a product of zero, nonnegative and second-order cones

cvxpy's canonical form is linear in the parameters: one product of its matrix with the vector of their values gives all
of Clarabel's data. This reads cvxpy's own canonical form, which tests hold against cvxpy's ``solve``.
"""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import clarabel
import numpy as np
from jaxtyping import Bool, Float
from scipy import sparse

from paretoik.errors import SolverFailed
from paretoik.nlp.conic import Constraints, Structure


class Pattern(NamedTuple):
    """What a statement depends on besides numbers."""

    unknowns: int
    jacobian: Structure
    cones: tuple[tuple[int, Structure], ...]

    @classmethod
    def of(cls, constraints: Constraints) -> Pattern:
        """Return that of constraints."""
        cones = tuple((cone.column, Structure.of(cone.rows)) for cone in constraints.cones)
        return cls(constraints.unknowns, Structure.of(constraints.jacobian), cones)


class Parameters:
    """The parameters of a statement, in the order in which they were made; sparse ones have a Structure."""

    def __init__(self) -> None:
        self._parameters = list[tuple[Any, Structure | None, int]]()  # each with how many numbers it has

    def dense(self, *shape: int) -> Any:
        """Return a new parameter of a shape."""
        import cvxpy  # here: importing it takes two seconds

        parameter = cvxpy.Parameter(shape)
        self._parameters.append((parameter, None, parameter.size))
        return parameter

    def sparse(self, structure: Structure) -> Any:
        """Return a new parameter whose entries stand where a structure has any; zeros for one without entries."""
        import cvxpy  # here: importing it takes two seconds

        if not structure.indices:
            return np.zeros(structure.shape)
        row, column = structure.places
        parameter = cvxpy.Parameter(structure.shape, sparsity=(row, column))
        self._parameters.append((parameter, structure, len(row)))
        return parameter

    @property
    def size(self) -> int:
        """How many numbers the parameters have in all."""
        return sum(count for _, _, count in self._parameters)

    def assign(self, numbers: Float[np.ndarray, " numbers"]) -> None:
        """Give all parameters their values: dense ones by rows, sparse ones as compressed sparse rows."""
        first = 0
        for parameter, structure, count in self._parameters:
            values = numbers[first : first + count]
            first += count
            if structure is None:
                parameter.value = values.reshape(parameter.shape)
            else:
                entries = sparse.csr_array((values, structure.places), shape=structure.shape)
                ordered = np.asarray(entries[parameter.sparse_idx]).ravel()  # cvxpy has an order of its own
                parameter.value_sparse = sparse.coo_array((ordered, parameter.sparse_idx), shape=structure.shape)


def state_cones(pattern: Pattern, d: Any, parameters: Parameters) -> list[Any]:
    """Return ‖values + rows d‖ ≤ d[column] + ‖values‖ for every cone."""
    import cvxpy  # here: importing it takes two seconds

    cones = []
    for column, structure in pattern.cones:
        length, values = parameters.dense(), parameters.dense(structure.shape[0])
        cones.append(cvxpy.SOC(d[column] + length, values + parameters.sparse(structure) @ d))
    return cones


def parameter_values(*first: Any, constraints: Constraints, scales: np.ndarray) -> Float[np.ndarray, " numbers"]:
    """Return the numbers of a statement whose parameters are ``first``, then J / ``scales``, then those of cones."""
    numbers = [*first, constraints.jacobian.data / scales[constraints.entries.row]]
    for cone in constraints.cones:
        numbers += [[np.linalg.norm(cone.values)], cone.values, cone.rows.data]
    return np.concatenate(numbers)


class Statement(NamedTuple):
    """A statement in cvxpy: its variables d and t, its inequalities, None for none, and its cones."""

    problem: Any
    parameters: Parameters
    d: Any
    t: Any
    inequalities: Any
    cones: list[Any]


class CanonicalForm:
    """A statement canonicalised: minimise ½ xᵀPx + qᵀx with b − Ax in cones, q, A and b linear in the parameters."""

    def __init__(self, statement: Statement) -> None:
        import cvxpy  # here: importing it takes two seconds
        from cvxpy.cvxcore.python.canonInterface import get_parameter_vector

        problem, parameters = statement.problem, statement.parameters
        # Entries of all parameters are numbered from 2 on, 1 being the constant, and looked for in cvxpy's own vector.
        parameters.assign(np.arange(2.0, parameters.size + 2.0))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # cvxpy reads its own sparse parameters as dense ones
            canonical = problem.get_problem_data(cvxpy.CLARABEL)[0]["param_prob"]
        values = {parameter.id: np.asarray(parameter.value) for parameter in canonical.parameters}
        numbers = get_parameter_vector(
            canonical.total_param_size, canonical.param_id_to_col, canonical.param_id_to_size, values.__getitem__
        )
        self._order = np.round(numbers).astype(int) - 1
        self._linear, self._matrix = sparse.csr_array(canonical.q)[:-1], canonical.reduced_A.reduced_mat
        self._indices, self._indptr, (self.rows, width) = canonical.reduced_A.problem_data_index
        self._first = dict(canonical.var_id_to_col)
        self.variables, self._equalities = width - 1, canonical.cone_dims.zero
        self._cones = list(canonical.cone_dims.soc)

    def columns(self, variable: Any) -> np.ndarray:
        """Return where the entries of a variable stand in x."""
        return np.asarray(self._first[variable.id] + np.arange(variable.size))

    def rows_in_use(self, rows: int, near: np.ndarray) -> Bool[np.ndarray, " rows"]:
        """Return which rows of A are used where of the first ``rows``, the inequalities, those ``near`` are."""
        mask = np.ones(self.rows, dtype=bool)
        mask[:rows] = False
        mask[near] = True
        return mask

    def solve(
        self,
        name: str,
        numbers: Float[np.ndarray, " numbers"],
        mask: Bool[np.ndarray, " rows"],
        tolerance: float,
        P: sparse.csc_matrix | None = None,
    ) -> tuple[Float[np.ndarray, " variables"], Float[np.ndarray, " used"]]:
        """Return x and the dual variables for values of the parameters, of the rows of A in a ``mask`` alone.

        Rows of cones have to be in it; gaps and infeasibilities are within ``tolerance``. Raises SolverFailed, naming
        the program, where Clarabel ends without a solution.
        """
        vector = np.append(1.0, numbers)[self._order]
        A, b = self._cut(self._matrix @ vector, mask)
        linear = len(b) - self._equalities - sum(self._cones)
        cones: list[Any] = [
            *([clarabel.ZeroConeT(self._equalities)] if self._equalities else []),
            *([clarabel.NonnegativeConeT(linear)] if linear else []),
            *map(clarabel.SecondOrderConeT, self._cones),
        ]
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
        P = sparse.csc_matrix((self.variables, self.variables)) if P is None else P
        solution = clarabel.DefaultSolver(P, self._linear @ vector, A, b, cones, settings).solve()
        if str(solution.status) not in ("Solved", "AlmostSolved"):
            raise SolverFailed(f"{name}: Clarabel wanted to end with Solved, got {solution.status}")
        return np.array(solution.x), np.array(solution.z)

    def _cut(self, entries: np.ndarray, mask: np.ndarray) -> tuple[sparse.csc_matrix, np.ndarray]:
        """Return A and b of the rows in a ``mask``; cvxpy's rows are A x + b."""
        chosen = mask[self._indices]
        row = (np.cumsum(mask) - 1)[self._indices[chosen]]
        indptr = np.append(0, np.cumsum(chosen))[self._indptr]
        entries, last = entries[chosen], indptr[-2]
        b = np.zeros(np.count_nonzero(mask))
        b[row[last:]] = entries[last:]
        return sparse.csc_matrix((-entries[:last], row[:last], indptr[:-1]), shape=(len(b), self.variables)), b
