"""Small dense programs with steps along the null space of their equalities.

    minimise    weights · F(z),  F(z) = costs · z
    subject to  h(z) = 0,  c(z) ≥ 0

A step goes along an orthonormal basis of the null space of the equalities' Jacobian; Gauss–Newton steps with that
Jacobian's pseudoinverse lead back to the equalities. Source: Nocedal & Wright, Numerical Optimization, section 15.3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from paretoik.autodiff.differentiation import gradient, hessian
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, Tape, as_entry
from paretoik.errors import EvaluationFailed
from paretoik.nlp.program import dense_rows

if TYPE_CHECKING:
    from paretoik.nlp.dense.dense_rows import DenseKernel

# Equalities and inequalities of smooth programs with their first and second derivatives. Small programs are traced
# once; large ones are assembled from them, each a function of a few of the unknowns.


@dataclass(frozen=True, kw_only=True, eq=False)
class TracedRows:
    """Equalities and inequalities of a few unknowns and parameters; made with ``trace_rows``.

    values: evaluator of h, then c
    jacobian_entries: evaluator of the Jacobian's entries at jacobian_pattern (rows, columns)
    hessian_entries: evaluator of the weighted sum's Hessian, lower triangle, at hessian_pattern; takes weights too
    """

    unknowns: int
    equalities: int
    inequalities: int
    values: Evaluator
    jacobian_entries: Evaluator
    hessian_entries: Evaluator
    jacobian_pattern: tuple[np.ndarray, np.ndarray]
    hessian_pattern: tuple[np.ndarray, np.ndarray]

    def at(self, parameters: Sequence[float] | np.ndarray = ()) -> AssembledRows:
        """Return these rows as a program, for values of their parameters."""
        values = np.array([parameters], dtype=float)
        part = Part(program=self, where=np.arange(self.unknowns)[None], parameters=values)
        return AssembledRows(unknowns=self.unknowns, parts=(part,))


Statement = Callable[[list[Any], list[Any]], tuple[list[Any], list[Any]]]
"""A function of (unknowns, parameters) that returns (equalities, inequalities)."""


def trace_rows(unknowns: int, parameters: int, statement: Statement) -> TracedRows:
    """Return the traced rows of a statement, for all values of its parameters."""
    tape = Tape()
    z, p = [tape.input() for _ in range(unknowns)], [tape.input() for _ in range(parameters)]
    equalities, inequalities = statement(z, p)
    variables = [as_entry(tape, one) for one in z]
    rows = [as_entry(tape, one) for one in (*equalities, *inequalities)]
    jacobian = {
        (i, j): value
        for i, row in enumerate(rows)
        for j, value in enumerate(gradient(tape, row, variables))
        if value != tape.constant(0.0)
    }
    weighted_sum: Any = 0.0
    for row in rows:
        weighted_sum = weighted_sum + tape.input() * Expression(tape, row)
    second = hessian(tape, as_entry(tape, weighted_sum), variables)
    return TracedRows(
        unknowns=unknowns,
        equalities=len(equalities),
        inequalities=len(inequalities),
        values=compile_evaluator(tape, rows),
        jacobian_entries=compile_evaluator(tape, list(jacobian.values())),
        hessian_entries=compile_evaluator(tape, list(second.values())),
        jacobian_pattern=_pattern(jacobian),
        hessian_pattern=_pattern(second),
    )


def _pattern(entries: Iterable[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    row, column = np.array(list(entries), dtype=int).reshape(-1, 2).T
    return row, column


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """Rows in several lanes, each of the unknowns ``where`` and with its own parameters."""

    program: TracedRows
    where: Int[np.ndarray, "lanes unknowns"]
    parameters: Float[np.ndarray, "lanes parameters"]

    def run(self, evaluator: Evaluator, z: np.ndarray, weights: np.ndarray | None) -> np.ndarray:
        """Return the results (outputs, lanes) of one of its evaluators."""
        rows = self.program.equalities + self.program.inequalities
        factors = np.zeros((rows, len(self.where))) if weights is None else weights
        return evaluator(np.concatenate([z[self.where].T, self.parameters.T, factors]))


@dataclass(frozen=True, kw_only=True, eq=False)
class AssembledRows:
    """Equalities h(z) = 0 and inequalities c(z) ≥ 0 with derivatives; unknowns are of the order of 1.

    Rows come from the parts: first the equalities of all parts, then the inequalities of all, lane by lane.
    """

    unknowns: int
    parts: tuple[Part, ...]

    def rows(self, z: Float[np.ndarray, " unknowns"]) -> tuple[np.ndarray, np.ndarray]:
        """Return h and c."""
        values = [(part.program.equalities, part.run(part.program.values, z, None)) for part in self.parts]
        equalities = [rows[:count].T.ravel() for count, rows in values]
        return np.concatenate(equalities), np.concatenate([rows[count:].T.ravel() for count, rows in values])

    def jacobian(self, z: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, "rows unknowns"]:
        """Return the Jacobian of h, then c."""
        equalities, inequalities = list[np.ndarray](), list[np.ndarray]()
        for part in self.parts:
            program, (row, column) = part.program, part.program.jacobian_pattern
            jacobian = np.zeros((len(part.where), program.equalities + program.inequalities, self.unknowns))
            lane = np.arange(len(part.where))[:, None]
            jacobian[lane, row, part.where[:, column]] = part.run(program.jacobian_entries, z, None).T
            equalities.append(jacobian[:, : program.equalities].reshape(-1, self.unknowns))
            inequalities.append(jacobian[:, program.equalities :].reshape(-1, self.unknowns))
        return np.concatenate([*equalities, *inequalities])

    def hessian(self, z: Float[np.ndarray, " unknowns"], weights: Float[np.ndarray, " rows"]) -> np.ndarray:
        """Return the Hessian (unknowns, unknowns) of weights · (h, c)."""
        hessian = np.zeros((self.unknowns, self.unknowns))
        h, c = 0, sum(part.program.equalities * len(part.where) for part in self.parts)  # first rows of a part
        for part in self.parts:
            program, lanes = part.program, len(part.where)
            ends = h + program.equalities * lanes, c + program.inequalities * lanes
            factors = weights[h : ends[0]].reshape(lanes, -1), weights[c : ends[1]].reshape(lanes, -1)
            h, c = ends
            row, column = program.hessian_pattern
            values = part.run(program.hessian_entries, z, np.concatenate(factors, axis=1).T).T
            np.add.at(hessian, (part.where[:, row], part.where[:, column]), values)
            off = row != column
            np.add.at(hessian, (part.where[:, column[off]], part.where[:, row[off]]), values[:, off])
        return hessian


EQUALITY_TOLERANCE = 1e-13  # of a satisfied equality


@dataclass(frozen=True, kw_only=True, eq=False)
class DenseProgram:
    """A program with equalities and inequalities of unknowns z and objectives F = costs · z."""

    rows: AssembledRows
    costs: Float[np.ndarray, "objectives unknowns"]
    objective_names: tuple[str, ...] = ()
    inequality_names: tuple[str, ...] = ()
    rounding: float = 0.0
    kinked: tuple[str, ...] = ()
    unsupported: tuple[()] = ()

    def project(self, x: Float[np.ndarray, "points unknowns"]) -> Float[np.ndarray, "points unknowns"]:
        """Return the points as they are."""
        return x

    def pin(self, x: Float[np.ndarray, "points unknowns"]) -> Float[np.ndarray, "points unknowns"]:
        """Return the points as they are."""
        return x

    @property
    def kernel(self) -> DenseKernel:
        """The program for compiled solvers."""
        from paretoik.nlp.dense.dense_arrays import dense_kernel  # here: numba

        return dense_kernel(self.rows, self.costs)

    @property
    def upper(self) -> Float[np.ndarray, " objectives"]:
        """Upper bounds of the objectives: none."""
        return np.full(len(self.costs), np.inf)

    def evaluate(
        self, x: Float[np.ndarray, " unknowns"]
    ) -> tuple[Float[np.ndarray, " objectives"], Float[np.ndarray, " equalities"], Float[np.ndarray, " inequalities"]]:
        """Return F, h and c."""
        equalities, inequalities = self.rows.rows(x)
        return self.costs @ x, equalities, inequalities

    def linearise(self, x: Float[np.ndarray, " unknowns"]) -> DenseLinearisation:
        """Return the program to first order at a point.

        Raises EvaluationFailed if a row or a derivative is not finite, or too few unknowns affect the equalities.
        """
        equalities, inequalities = self.rows.rows(x)
        jacobian = self.rows.jacobian(x)
        if not all(np.isfinite(part).all() for part in (equalities, inequalities, jacobian)):
            raise EvaluationFailed("program must have finite rows and derivatives, got others")
        basis, pseudoinverse = null_space(jacobian[: len(equalities)])
        return DenseLinearisation(
            program=self,
            x=x,
            objectives=self.costs @ x,
            equalities=equalities,
            inequalities=inequalities,
            basis=basis,
            pseudoinverse=pseudoinverse,
            gradients=self.costs @ basis,
            inequality_jacobian=jacobian[len(equalities) :],
            jacobian=dense_rows(jacobian[len(equalities) :] @ basis),
        )

    def kinks_at(self, x: Float[np.ndarray, " unknowns"]) -> tuple[str, ...]:
        """Return nothing: all kinks have their own unknowns."""
        return ()

    def distance(
        self, x: Float[np.ndarray, " unknowns"], others: Float[np.ndarray, "others unknowns"]
    ) -> Float[np.ndarray, " others"]:
        """Return the Euclidean distance of a point from others."""
        return np.asarray(np.linalg.norm(others - x, axis=-1))


@dataclass(frozen=True, kw_only=True, eq=False)
class DenseLinearisation:
    """A dense program to first order at z: a step y leads to z + basis · y."""

    program: DenseProgram
    x: Float[np.ndarray, " unknowns"]
    objectives: Float[np.ndarray, " objectives"]
    equalities: Float[np.ndarray, " equalities"]
    inequalities: Float[np.ndarray, " inequalities"]
    basis: Float[np.ndarray, "unknowns columns"]
    pseudoinverse: Float[np.ndarray, "unknowns equalities"]
    gradients: Float[np.ndarray, "objectives columns"]
    inequality_jacobian: Float[np.ndarray, "inequalities unknowns"]
    jacobian: sparse.csr_array
    cones: tuple[()] = ()
    unit: float = 1.0

    @property
    def columns(self) -> int:
        """Number of entries of a step."""
        return self.basis.shape[1]

    @property
    def unknowns(self) -> int:
        """Number of entries of a step that the trust region bounds: all."""
        return self.basis.shape[1]

    @property
    def elastic(self) -> int:
        """Number of inequalities that may be violated on the way: all."""
        return len(self.inequalities)

    def hessian(
        self,
        weights: Float[np.ndarray, " objectives"],
        multipliers: Float[np.ndarray, " inequalities"],
        cone_multipliers: Sequence[np.ndarray] = (),
    ) -> sparse.csr_array:
        """Return the Hessian (columns, columns) of the Lagrangian along the basis."""
        assert not cone_multipliers, "dense programs have no cones"
        gradient = weights @ self.program.costs - multipliers @ self.inequality_jacobian
        equality_multipliers = -self.pseudoinverse.T @ gradient
        hessian = self.program.rows.hessian(self.x, np.concatenate([equality_multipliers, -multipliers]))
        return dense_rows(self.basis.T @ hessian @ self.basis)

    def retract(self, step: Float[np.ndarray, " columns"]) -> Float[np.ndarray, " unknowns"] | None:
        """Return the point that a step leads to, on or nearer to the equalities; None if not finite."""
        x = self.x + self.basis @ step
        for _ in range(6):  # Gauss–Newton steps with one Jacobian
            equalities = self.program.rows.rows(x)[0]
            if not np.isfinite(equalities).all():
                return None
            if float(np.abs(equalities).max(initial=0.0)) < EQUALITY_TOLERANCE:
                break
            x = x - self.pseudoinverse @ equalities
        return x if np.isfinite(x).all() else None

    def corrected_inequalities(
        self, step: Float[np.ndarray, " columns"], x: Float[np.ndarray, " unknowns"]
    ) -> Float[np.ndarray, " inequalities"]:
        """Return c at the point x that a step led to."""
        return self.program.rows.rows(x)[1]


def null_space(
    jacobian: Float[np.ndarray, "equalities unknowns"],
) -> tuple[Float[np.ndarray, "unknowns columns"], Float[np.ndarray, "unknowns equalities"]]:
    """Return an orthonormal basis of the null space and the pseudoinverse, by QR decomposition.

    Each unknown in no equality is a basis vector. Raises EvaluationFailed if too few unknowns affect the equalities.
    """
    rows, size = jacobian.shape
    nonzero = jacobian.any(axis=0)
    count = int(np.count_nonzero(nonzero))
    if count < rows:
        raise EvaluationFailed(f"program must have at least {rows} unknowns that affect its equalities, got {count}")
    orthogonal, upper = np.linalg.qr(jacobian[:, nonzero].T, mode="complete")
    basis, pseudoinverse = np.zeros((size, size - rows)), np.zeros((size, rows))
    basis[nonzero, : count - rows] = orthogonal[:, rows:]
    basis[~nonzero, count - rows :] = np.eye(size - count)
    pseudoinverse[nonzero] = np.linalg.lstsq(upper[:rows], orthogonal[:, :rows].T, rcond=None)[0].T
    return basis, pseudoinverse
