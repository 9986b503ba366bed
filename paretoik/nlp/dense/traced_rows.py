"""Equalities and inequalities of smooth programs with their first and second derivatives.

Small programs are traced once. Large programs are assembled from small ones, which use a few unknowns each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
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
    hessian_entries: evaluator of the lower triangle of the Hessian of Σ weight · row, at hessian_pattern
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
    """Rows in several lanes, each with its own unknowns (indices ``where``) and parameters."""

    program: TracedRows
    where: Int[np.ndarray, "lanes unknowns"]
    parameters: Float[np.ndarray, "lanes parameters"]

    def run(self, evaluator: Evaluator, z: np.ndarray, weights: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the results (outputs, lanes) of an evaluator of the program, with weights (rows, lanes) of rows."""
        rows = self.program.equalities + self.program.inequalities
        factors = np.broadcast_to(weights, (rows, len(self.where)))
        return evaluator(np.concatenate([z[self.where].T, self.parameters.T, factors]))


@dataclass(frozen=True, kw_only=True, eq=False)
class AssembledRows:
    """Equalities h(z) = 0 and inequalities c(z) ≥ 0 with derivatives; the unknowns are of the order of 1.

    Rows come from the parts: first the equalities of all parts, then the inequalities of all, lane by lane.
    """

    unknowns: int
    parts: tuple[Part, ...]

    @cached_property
    def equalities(self) -> int:
        """Number of equalities."""
        return sum(part.program.equalities * len(part.where) for part in self.parts)

    @cached_property
    def inequalities(self) -> int:
        """Number of inequalities."""
        return sum(part.program.inequalities * len(part.where) for part in self.parts)

    @cached_property
    def places(self) -> list[Int[np.ndarray, "rows lanes"]]:
        """Indices of every part's rows among all rows."""
        places, h, c = [], 0, self.equalities
        for part in self.parts:
            equalities, inequalities, lane = (
                part.program.equalities,
                part.program.inequalities,
                np.arange(len(part.where)),
            )
            first_h, first_c = h + equalities * lane, c + inequalities * lane
            rows = np.arange(equalities)[:, None] + first_h, np.arange(inequalities)[:, None] + first_c
            places.append(np.concatenate(rows))
            h, c = h + equalities * len(lane), c + inequalities * len(lane)
        return places

    def rows(self, z: Float[np.ndarray, " unknowns"]) -> tuple[np.ndarray, np.ndarray]:
        """Return h and c."""
        values = np.empty(self.equalities + self.inequalities)
        for part, places in zip(self.parts, self.places, strict=True):
            values[places] = part.run(part.program.values, z)
        return values[: self.equalities], values[self.equalities :]

    def jacobian(self, z: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, "rows unknowns"]:
        """Return the Jacobian of h, then c."""
        jacobian = np.zeros((self.equalities + self.inequalities, self.unknowns))
        for part, places in zip(self.parts, self.places, strict=True):
            row, column = part.program.jacobian_pattern
            jacobian[places[row], part.where.T[column]] = part.run(part.program.jacobian_entries, z)
        return jacobian

    def hessian(self, z: Float[np.ndarray, " unknowns"], weights: Float[np.ndarray, " rows"]) -> np.ndarray:
        """Return the Hessian (unknowns, unknowns) of weights · (h, c)."""
        hessian = np.zeros((self.unknowns, self.unknowns))
        for part, places in zip(self.parts, self.places, strict=True):
            row, column = part.program.hessian_pattern
            values = part.run(part.program.hessian_entries, z, weights[places]).T
            np.add.at(hessian, (part.where[:, row], part.where[:, column]), values)
            off = row != column
            np.add.at(hessian, (part.where[:, column[off]], part.where[:, row[off]]), values[:, off])
        return hessian
