"""Equalities and inequalities of smooth programs with their first and second derivatives.

Small programs are traced once. Large programs are assembled from small ones, each a function of a few of the unknowns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.autodiff.differentiation import gradient, hessian
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, Tape, as_entry


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
    """Rows in several lanes, each with own unknowns and parameters.

    ``where`` has the indices of the unknowns.
    """

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
    """Equalities h(z) = 0 and inequalities c(z) ≥ 0 with derivatives.

    The unknowns are of the order of 1.

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
