"""The interface between solvers and nonlinear programs of any kind: motions, postures, paths.

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper

x is a point: an array of any shape. F has the objectives, all minimised, then other functions with upper bounds. Steps
are tangent to h(x) = 0, and ``Linearisation.retract`` leads back to it; for a motion this is the self-motion of every
sample. Functions with kinks (peaks, absolute values, norms) get auxiliary columns: slack and epigraph variables, which
follow from x. Every function of all columns is smooth.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias, get_args, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse

from paretoik.arrays import Point, Points
from paretoik.errors import EvaluationFailed
from paretoik.inputs import check_choice
from paretoik.runs.journal import is_journalled, key_of

# Constraints of convex subproblems, in sparse matrices whose structure does not depend on values.


CLARABEL_TOLERANCE = 1e-10  # tolerance of duality gaps and infeasibilities; solutions are exact to its square root
FEASIBLE = 1e-8  # largest violation of a feasible point, as a share of a limit's range


class Structure(NamedTuple):
    """The shape of a sparse matrix and the places of its entries, in compressed sparse rows."""

    shape: tuple[int, int]
    indptr: bytes
    indices: bytes

    @classmethod
    def of(cls, matrix: sparse.csr_array) -> Structure:
        """Return the structure of a matrix, including entries of 0."""
        return cls(matrix.shape, matrix.indptr.astype(np.int32).tobytes(), matrix.indices.astype(np.int32).tobytes())

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Row and column of every entry."""
        indptr, indices = (np.frombuffer(part, dtype=np.int32) for part in (self.indptr, self.indices))
        return np.repeat(np.arange(self.shape[0]), np.diff(indptr)), indices


def structural_product(left: sparse.csr_array, right: sparse.csr_array) -> sparse.csr_array:
    """Return left · right with an entry wherever their structures allow one.

    SciPy's product drops sums that happen to be 0, so its structure depends on values.
    """
    left_entries, right_entries, places, indptr, indices = _product_plan(Structure.of(left), Structure.of(right))
    entries = np.bincount(places, left.data[left_entries] * right.data[right_entries], len(indices))
    return sparse.csr_array((entries, indices, indptr), shape=(left.shape[0], right.shape[1]))


@lru_cache(maxsize=16)
def _product_plan(left: Structure, right: Structure) -> tuple[np.ndarray, ...]:
    """Return the factors of each product, the entry that it adds to, and the result's structure."""
    row, inner = left.places
    starts = np.frombuffer(right.indptr, dtype=np.int32)
    counts = np.diff(starts)[inner]
    left_entries = np.repeat(np.arange(len(row)), counts)
    first = np.repeat(starts[inner] - np.cumsum(counts) + counts, counts)
    right_entries = first + np.arange(len(first))
    columns = right.shape[1]
    keys, places = np.unique(row[left_entries] * columns + right.places[1][right_entries], return_inverse=True)
    indptr = np.searchsorted(keys, columns * np.arange(left.shape[0] + 1))
    return left_entries, right_entries, places, indptr.astype(np.int32), (keys % columns).astype(np.int32)


def dense_rows(matrix: Float[np.ndarray, "rows columns"]) -> sparse.csr_array:
    """Return a dense matrix as a sparse one that stores all entries, zeros too."""
    rows, columns = matrix.shape
    return sparse.csr_array(
        (matrix.ravel(), np.tile(np.arange(columns), rows), columns * np.arange(rows + 1)), shape=matrix.shape
    )


def stack_rows(parts: Sequence[sparse.csr_array]) -> sparse.csr_array:
    """Return matrices stacked by rows, as SciPy's vstack does, but ten times as fast for small ones."""
    starts = np.cumsum([0, *(part.indptr[-1] for part in parts)])
    pointers = [part.indptr[1:] + start for part, start in zip(parts, starts[:-1], strict=True)]
    return sparse.csr_array(
        (
            np.concatenate([part.data for part in parts]),
            np.concatenate([part.indices for part in parts]),
            np.concatenate([[0], *pointers]),
        ),
        shape=(sum(part.shape[0] for part in parts), parts[0].shape[1]),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Cone:
    """The cone d[column] + ‖values‖ ≥ ‖values + rows d‖; d[column] is the change of the length."""

    column: int
    values: Float[np.ndarray, " parts"]
    rows: sparse.csr_array


@dataclass(frozen=True, kw_only=True, eq=False)
class Constraints:
    """Constraints values + jacobian d ≥ 0, and cones; a ball bounds the first ``unknowns`` entries of d."""

    unknowns: int
    values: Float[np.ndarray, " inequalities"]
    jacobian: sparse.csr_array
    cones: tuple[Cone, ...] = ()

    @cached_property
    def entries(self) -> sparse.coo_array:
        """The entries of the Jacobian, row by row."""
        return self.jacobian.tocoo()

    @cached_property
    def row_norms(self) -> Float[np.ndarray, " inequalities"]:
        """Euclidean length of every row of the Jacobian, at least 1e-300."""
        square = np.bincount(self.entries.row, self.entries.data**2, minlength=len(self.values))
        return np.maximum(np.sqrt(square), 1e-300)

    def within_reach(self, radius: float, *, order: int) -> Int[np.ndarray, " rows"]:
        """Return the inequalities that a step within a ball can reach.

        ``order`` is that of the norm dual to the ball's. Inequalities with an auxiliary column always count, because no
        ball bounds it.
        """
        bounded, count = self.entries.col < self.unknowns, len(self.values)
        row, value = self.entries.row[bounded], np.abs(self.entries.data[bounded])
        dual_norm = np.bincount(row, value, count) if order != 2 else np.sqrt(np.bincount(row, value**2, count))
        auxiliary = np.bincount(self.entries.row[~bounded], minlength=count) > 0
        reachable: np.ndarray = np.flatnonzero(auxiliary | (self.values < dual_norm * radius))
        return reachable

    def cone_multipliers(self, dual: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the multipliers of every cone's vector from the dual variables of all cone rows."""
        multipliers, first = [], 0
        for cone in self.cones:
            multipliers.append(-dual[first + 1 : first + 1 + len(cone.values)])
            first += len(cone.values) + 1
        return tuple(multipliers)


# Settings of the interior-point method (``interior_point``).


class InteriorPointOptions(NamedTuple):
    """Settings of the interior-point method, without unit except ``radius``; each kernel has further settings."""

    barrier: float = 0.1  # μ of the first subproblem
    last_barrier: float = 1e-13  # μ of the last
    penalty: float = 1.0  # first penalty per unit of violation, as a multiple of the kernel's
    tolerance: float = 1e-8  # tolerance of stationarity and of violations
    iterations: int = 150  # largest number of iterations
    kink_iterations: int = 3  # factor of ``iterations`` if functions have kinks
    regularisation: float = 1e-9  # first multiple of I for an indefinite matrix, as a share of its largest entry
    kink_regularisation: float = 1e-13  # the same for functions with kinks, whose entries are large
    radius: float = 0.3  # [rad or arm lengths]: radius of the first step of sequential quadratic programming
    barrier_factor: float = 0.2  # μ₊ = min(factor · μ, μ^power): Wächter & Biegler 2006, Eq. 7
    barrier_power: float = 1.5
    barrier_tolerance: float = 10.0  # largest error of a solved subproblem, as a multiple of μ; ibid., Eq. 5
    penalty_factor: float = 10.0  # factor by which the penalty grows
    penalty_barrier: float = 3e-3  # largest μ at which violations make the penalty grow
    soft_violation: float = 100.0  # largest violation due to the barrier, as a multiple of μ / penalty
    helpless_growth: float = 100.0  # constraints are infeasible if this growth of the penalty does not halve violations
    armijo: float = 1e-4  # Nocedal & Wright, Eq. 3.4
    halvings: int = 40  # largest number of halvings of a step
    boundary_fraction: float = 0.995  # largest share of the way to a slack or multiplier of 0; ibid., Eq. 19.9
    multiplier_range: float = 1e8  # largest factor between a multiplier and μ / slack; Wächter & Biegler, Eq. 16
    flat_decrease: float = 1e-15  # least predicted decrease that is more than rounding, as a share of the merit
    flat_barrier: float = 1e-6  # least predicted decrease that helps a subproblem, as a multiple of μ
    kink_flat_barrier: float = 1e-2  # the same for functions with kinks: each kink ends a step along a flat valley
    merit_rounding: float = 1e-14  # relative rounding error of the merit function
    stalled_decrease: float = 1e-12  # largest relative decrease of the merit function that counts as none
    stalled_steps: int = 5  # number of stalled steps after which a subproblem counts as solved
    least_slack: float = 1e-2  # first value of unknown slacks, or √μ if that is less
    residual_tolerance: float = 1e-10  # largest sum of residuals that counts as 0
    filter_margin: float = 1e-5  # γ of the filter; ibid., Eq. 18
    filter_infeasible: float = 1e-4  # largest residual, over the first, at which only merit may decide; ibid., Eq. 21
    restorations: int = 12  # largest number of cleared filters or recentred slacks without halved residuals


# Results of solvers: a batch of points.


CONVERGED, ITERATION_LIMIT, NO_PROGRESS, SINGULAR, VIOLATED, NOT_FINITE, INTERRUPTED, LOST = range(8)

STATUSES = {
    CONVERGED: "converged",
    ITERATION_LIMIT: "iteration limit reached",
    NO_PROGRESS: "no step improves it",
    SINGULAR: "at a singularity",
    VIOLATED: "limits cannot all be satisfied",
    NOT_FINITE: "not finite at the start",
    INTERRUPTED: "interrupted",
    LOST: "lost, as its workers ended",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Solutions:
    """Solvers' results: a batch of points.

    objectives: F at the points
    bound_multipliers: multipliers of the given upper bounds: 0 for an infinite bound, NaN if unknown
    stationarity: RMS length of the Lagrangian's gradient
    violation: worst violation of all constraints, as a share of its range
    status: a key of STATUSES
    """

    x: Points
    objectives: Float[np.ndarray, "points objectives"]
    bound_multipliers: Float[np.ndarray, "points bounds"]
    stationarity: Float[np.ndarray, " points"]
    violation: Float[np.ndarray, " points"]
    status: Int[np.ndarray, " points"]
    iterations: Int[np.ndarray, " points"]

    def __len__(self) -> int:
        return len(self.x)

    def __getitem__(self, rows: Any) -> Solutions:
        return Solutions(**{name: values[rows] for name, values in vars(self).items()})

    def replace_rows(self, rows: Bool[np.ndarray, " points"], other: Solutions) -> Solutions:
        """Return the batch with ``rows`` replaced by those of another batch."""
        parts = {name: values.copy() for name, values in vars(self).items()}
        for name, values in parts.items():
            values[rows] = getattr(other, name)
        return Solutions(**parts)

    @property
    def converged(self) -> Bool[np.ndarray, " points"]:
        """Which points are stationary and satisfy all constraints."""
        return self.status == CONVERGED


def concatenate(batches: Sequence[Solutions]) -> Solutions:
    """Return several batches as one."""
    return Solutions(**{name: np.concatenate([getattr(each, name) for each in batches]) for name in vars(batches[0])})


# Nonlinear programs, as solvers see them.


Solver: TypeAlias = Literal["auto", "interior-point", "sqp"]
"""Solver of refinements; "auto": the interior-point method if the program has a kernel, else SQP."""


def check_solver_name(solver: object) -> None:
    """Raise InvalidInput unless ``solver`` is the name of a solver."""
    check_choice("solver", solver, get_args(Solver))


@dataclass(frozen=True, kw_only=True, eq=False)
class Goal:
    """Minimise ``weights`` · F with ``rows`` · F ≤ ``upper``; inf is no bound."""

    weights: Float[np.ndarray, " objectives"]
    rows: Float[np.ndarray, "bounds objectives"]
    upper: Float[np.ndarray, " bounds"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearisation(ABC):
    """A program to first order at a point x.

    Its columns are the unknowns of a step along the equalities, then auxiliary variables. Ties are inequalities between
    auxiliary variables and the values that they replace; all steps of a solver satisfy ties.

    unknowns: number of columns of a step along the equalities; the others are auxiliary
    elastic: number of elastic inequalities, which steps may violate; they come first
    unit: Euclidean length of a step with RMS length one
    inequalities: values of c, divided by their ranges, then values of ties
    jacobian: Jacobian of the inequalities (inequalities, columns)
    cones: ties of auxiliary columns to lengths
    """

    x: Point
    unknowns: int
    elastic: int
    unit: float = 1.0
    objectives: Float[np.ndarray, " objectives"]
    equalities: Float[np.ndarray, " equalities"] = field(default_factory=lambda: np.zeros(0))
    inequalities: Float[np.ndarray, " inequalities"]
    gradients: Float[np.ndarray, "objectives columns"]
    jacobian: sparse.csr_array
    cones: tuple[Cone, ...] = ()

    @property
    def columns(self) -> int:
        """Number of columns."""
        return self.gradients.shape[1]

    @abstractmethod
    def hessian(
        self,
        weights: Float[np.ndarray, " objectives"],
        multipliers: Float[np.ndarray, " inequalities"],
        cone_multipliers: tuple[np.ndarray, ...] = (),
    ) -> sparse.csr_array:
        """Return the Hessian (columns, columns) of the Lagrangian weights · F + ν · h − multipliers · c − cones.

        The multipliers ν of the equalities make its gradient 0 normal to the tangent space.
        """

    @abstractmethod
    def retract(self, step: Float[np.ndarray, " columns"]) -> Point | None:
        """Return the point on the equalities after a step; None if it is not reached."""

    @abstractmethod
    def corrected_inequalities(
        self, step: Float[np.ndarray, " columns"], x: Point
    ) -> Float[np.ndarray, " inequalities"]:
        """Return c at the point x that a step led to, with the step's auxiliary columns.

        Its difference from the linear model is the curvature that a second-order correction needs.
        """


@runtime_checkable
class Program(Protocol):
    """A nonlinear program."""

    @property
    def objective_names(self) -> tuple[str, ...]:
        """Names of F."""

    @property
    def inequality_names(self) -> tuple[str, ...]:
        """Names of the elastic part of c."""

    @property
    def upper(self) -> Float[np.ndarray, " objectives"]:
        """The program's own upper bounds of F, inf for no bound."""

    @property
    def kernel(self) -> Any:
        """The program for compiled solvers; None if they do not support a part of F or c."""

    @property
    def kinked(self) -> tuple[str, ...]:
        """Names of functions with kinks; compiled solvers smooth them, so evaluate F again afterwards."""

    @property
    def unsupported(self) -> tuple[str, ...]:
        """Names of functions that compiled solvers do not support."""

    @property
    def rounding(self) -> float:
        """Stationarity that rounding cannot distinguish from 0."""

    def project(self, x: Points) -> Points:
        """Return points with corrected fixed parts, such as a given start or an end at rest."""

    def pin(self, x: Points) -> Points:
        """Return points with their given parts restored exactly."""

    def evaluate(
        self, x: Point
    ) -> tuple[Float[np.ndarray, " objectives"], Float[np.ndarray, " equalities"], Float[np.ndarray, " inequalities"]]:
        """Return F, h and the elastic part of c, divided by its ranges."""

    def linearise(self, x: Point) -> Linearisation:
        """Return the program to first order at a point."""

    def kinks_at(self, x: Point) -> tuple[str, ...]:
        """Return the names of functions that have a kink at x without an auxiliary variable."""

    def distance(self, x: Point, others: Points) -> np.ndarray:
        """Return RMS distances from others, in rad or similar; optima nearer than 0.01 count as one."""


def bounded(at: Linearisation, goal: Goal) -> tuple[Constraints, int]:
    """Return linearised inequalities with the goal's bounds, and the number of elastic ones.

    The program's elastic inequalities come first, then the goal's bounds (also elastic), then ties.
    """
    finite = np.isfinite(goal.upper)
    rows, elastic = goal.rows[finite], at.elastic
    bounds = dense_rows(-rows @ at.gradients)
    ties = np.maximum(at.inequalities[elastic:], 0.0)  # only rounding makes them negative
    constraints = Constraints(
        unknowns=at.unknowns,
        values=np.concatenate([at.inequalities[:elastic], goal.upper[finite] - rows @ at.objectives, ties]),
        jacobian=stack_rows([at.jacobian[:elastic], bounds, at.jacobian[elastic:]]),
        cones=at.cones,
    )
    return constraints, elastic + len(rows)


# Violations of a program at a point.


def violation_at(program: Program, at: Linearisation) -> float:
    """Return the worst violation of equalities, limits and bounds at a point, as a share of their ranges."""
    return violation_of(program, at.objectives, at.equalities, at.inequalities[: at.elastic])


def violation_of(
    program: Program,
    objectives: Float[np.ndarray, " n_obj"],
    equalities: Float[np.ndarray, " equalities"],
    inequalities: Float[np.ndarray, " elastic"],
    rows: Float[np.ndarray, "bounds n_obj"] | None = None,
    upper: Float[np.ndarray, " bounds"] | None = None,
) -> float:
    """Return the worst violation of these F, h and elastic c, NaN if one is NaN.

    The bounds are rows · F ≤ ``upper``, or the program's own bounds of F if these are None.
    """
    if rows is None or upper is None:
        rows, upper = np.eye(len(objectives)), program.upper
    finite = np.isfinite(upper)
    excess = rows[finite] @ objectives - upper[finite]
    return float(np.concatenate([[0.0], np.abs(equalities), -inequalities, excess]).max())


# Keys of a program's results in the run's journal.


def program_key(kind: str, program: Program, x: Point, *inputs: object) -> bytes | None:
    """Return the journal's key of a result for a program, a point and inputs; None if there is no journal.

    Names and values at the point identify the program: other limits have other inequalities there.
    """
    if not is_journalled():
        return None
    values: tuple[np.ndarray, ...] = ()
    with suppress(EvaluationFailed):  # then the result fails too
        values = program.evaluate(x)
    names = program.objective_names, program.inequality_names, program.kinked
    return key_of(kind, *names, program.upper, *values, x, *inputs)
