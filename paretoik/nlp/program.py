"""What a solver needs to know of a nonlinear program, whatever it describes: motions, postures, paths.

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper

x is a point: an array of any shape. F are the objectives, always minimised, then whatever else is bounded as a number
of the whole point. Steps are taken along the tangent space of h(x) = 0; ``Linearisation.retract`` leads back to it:
for a motion, its own self-motion at every sample. Functions with kinks (peaks, absolute values, norms) are written with
auxiliary columns, slack and epigraph variables that follow from x, so that every function of the columns is smooth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeAlias, get_args, runtime_checkable

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.arrays import Point, Points
from paretoik.inputs import check_choice
from paretoik.nlp.conic import Cone, Constraints, dense_rows, stack_rows

Solver: TypeAlias = Literal["auto", "interior-point", "sqp"]
"""Which solver refines: if "auto", interior points where the program has a kernel, else SQP."""


def check_solver_name(solver: object) -> None:
    """Raise InvalidInput unless this is the name of a solver."""
    check_choice("solver", solver, get_args(Solver))


@dataclass(frozen=True, kw_only=True, eq=False)
class Goal:
    """Minimise ``weights`` · F where ``rows`` · F ≤ ``upper``; a bound of inf does not count."""

    weights: Float[np.ndarray, " objectives"]
    rows: Float[np.ndarray, "bounds objectives"]
    upper: Float[np.ndarray, " bounds"]


@runtime_checkable
class Linearisation(Protocol):
    """A program to first order at a point, in columns: a step along the equalities, then auxiliary variables.

    The inequalities that tie auxiliary columns hold exactly at any step that a solver may take.
    """

    @property
    def x(self) -> Point:
        """The point."""

    @property
    def columns(self) -> int:
        """Number of columns."""

    @property
    def unknowns(self) -> int:
        """Number of columns that are steps along the equalities; the others are auxiliary."""

    @property
    def unit(self) -> float:
        """Euclidean length of a step of RMS length one."""

    @property
    def objectives(self) -> Float[np.ndarray, " objectives"]:
        """F."""

    @property
    def equalities(self) -> Float[np.ndarray, " equalities"]:
        """The equalities h."""

    @property
    def inequalities(self) -> Float[np.ndarray, " inequalities"]:
        """The inequalities c, divided by their ranges, then those that tie auxiliary columns."""

    @property
    def elastic(self) -> int:
        """Number of inequalities that may be violated on the way: the first ones."""

    @property
    def gradients(self) -> Float[np.ndarray, "objectives columns"]:
        """The gradients of F."""

    @property
    def jacobian(self) -> sparse.csr_array:
        """The Jacobian of the inequalities (inequalities, columns)."""

    @property
    def cones(self) -> tuple[Cone, ...]:
        """The cones that tie auxiliary columns to lengths."""

    def hessian(
        self,
        weights: Float[np.ndarray, " objectives"],
        multipliers: Float[np.ndarray, " inequalities"],
        cone_multipliers: tuple[np.ndarray, ...],
    ) -> sparse.csr_array:
        """Return the Hessian (columns, columns) of the Lagrangian weights · F + ν · h − multipliers · c − cones.

        ν are the multipliers of the equalities that leave no gradient across their tangent space.
        """

    def retract(self, step: Float[np.ndarray, " columns"]) -> Point | None:
        """Return the point that a step leads to, back on the equalities; None where it cannot be led back."""

    def corrected_inequalities(
        self, step: Float[np.ndarray, " columns"], x: Point
    ) -> Float[np.ndarray, " inequalities"]:
        """Return c at the point x that a step led to, auxiliary columns being what the step makes them.

        What is left after the part linear in the step is the curvature that a second-order correction makes up for.
        """


@runtime_checkable
class Program(Protocol):
    """A nonlinear program."""

    @property
    def objective_names(self) -> tuple[str, ...]:
        """Names of F."""

    @property
    def inequality_names(self) -> tuple[str, ...]:
        """Names of c, its elastic part."""

    @property
    def upper(self) -> Float[np.ndarray, " objectives"]:
        """The program's own upper bounds of F, inf where there is none."""

    @property
    def kernel(self) -> Any:
        """What compiled solvers take, None where F or c has parts that they cannot take."""

    @property
    def kinked(self) -> tuple[str, ...]:
        """Names of what has kinks: compiled solvers smooth them, and what they return of F is to be evaluated."""

    @property
    def unsupported(self) -> tuple[str, ...]:
        """Names of what compiled solvers cannot take."""

    @property
    def rounding(self) -> float:
        """Stationarity that cannot be told from none."""

    def project(self, x: Points) -> Points:
        """Return starts with what no step changes put right: a given start, a last step at rest."""

    def pin(self, x: Points) -> Points:
        """Return points whose given parts are what they were given as, to the bit."""

    def evaluate(
        self, x: Point
    ) -> tuple[Float[np.ndarray, " objectives"], Float[np.ndarray, " equalities"], Float[np.ndarray, " inequalities"]]:
        """Return F, h and c, its elastic part alone, divided by its ranges."""

    def linearise(self, x: Point) -> Linearisation:
        """Return the program to first order at a point."""

    def kinks_at(self, x: Point) -> tuple[str, ...]:
        """Return the names of what has a kink at a point that no auxiliary column stands for."""

    def distance(self, x: Point, others: Points) -> np.ndarray:
        """Return how far a point is from others (others,), RMS in rad or alike: optima nearer than 0.01 are one."""


def bounded(at: Linearisation, goal: Goal) -> tuple[Constraints, int]:
    """Return the inequalities to first order, the goal's bounds among them, and how many of them are elastic.

    First come the elastic inequalities, then the goal's bounds, as elastic, then those that tie auxiliary columns.
    """
    finite = np.isfinite(goal.upper)
    rows, elastic = goal.rows[finite], at.elastic
    bounds = dense_rows(-rows @ at.gradients)
    ties = np.maximum(at.inequalities[elastic:], 0.0)  # negative by rounding alone
    constraints = Constraints(
        unknowns=at.unknowns,
        values=np.concatenate([at.inequalities[:elastic], goal.upper[finite] - rows @ at.objectives, ties]),
        jacobian=stack_rows([at.jacobian[:elastic], bounds, at.jacobian[elastic:]]),
        cones=at.cones,
    )
    return constraints, elastic + len(rows)
