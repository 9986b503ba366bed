"""Small smooth programs, written down once: rows that must be 0, rows that must not be negative, and derivatives.

``sequential`` solves them; ``assembled`` makes large ones of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.differentiation import gradient, hessian
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Expression, Tape, as_entry


@runtime_checkable
class Rows(Protocol):
    """Rows that must be 0 and rows that must not be negative, with derivatives, of unknowns of the order of 1."""

    def rows(self, z: Float[np.ndarray, " unknowns"]) -> tuple[np.ndarray, np.ndarray]:
        """Return both kinds of rows."""

    def jacobian(self, z: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, "rows unknowns"]:
        """Return the first derivatives of all rows, equalities first."""

    def curvature(self, z: Float[np.ndarray, " unknowns"], weights: Float[np.ndarray, " rows"]) -> np.ndarray:
        """Return the second derivatives of weights · rows, (unknowns, unknowns)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Smooth:
    """Rows that must be 0 and rows that must not be negative, of unknowns and parameters; made with ``smooth``.

    ``values`` computes both kinds, one below the other, ``first`` their Jacobian's entries at ``places``, ``second``,
    of weights too, those of the second derivatives of their weighted sum at ``bends``.
    """

    equalities: int
    inequalities: int
    parameters: Float[np.ndarray, " parameters"]
    values: Evaluator
    first: Evaluator
    second: Evaluator
    places: tuple[np.ndarray, np.ndarray]
    bends: tuple[np.ndarray, np.ndarray]

    def rows(self, z: Float[np.ndarray, " unknowns"]) -> tuple[np.ndarray, np.ndarray]:
        """Return both kinds of rows."""
        found = self.values(self._given(z, np.zeros(self.equalities + self.inequalities)))[:, 0]
        return found[: self.equalities], found[self.equalities :]

    def jacobian(self, z: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, "rows unknowns"]:
        """Return the first derivatives of all rows, equalities first."""
        found = np.zeros((self.equalities + self.inequalities, len(z)))
        found[self.places] = self.first(self._given(z, np.zeros(len(found))))[:, 0]
        return found

    def curvature(self, z: Float[np.ndarray, " unknowns"], weights: Float[np.ndarray, " rows"]) -> np.ndarray:
        """Return the second derivatives of weights · rows, (unknowns, unknowns)."""
        found = np.zeros((len(z), len(z)))
        found[self.bends] = self.second(self._given(z, weights))[:, 0]
        return found + np.tril(found, -1).T

    def _given(self, z: np.ndarray, weights: np.ndarray) -> np.ndarray:
        return np.concatenate([z, self.parameters, weights])[:, None]


Written = Callable[[list[Any], list[Any]], tuple[list[Any], list[Any]]]


def smooth(unknowns: int, parameters: int, written: Written) -> Smooth:
    """Write down a program once, for all parameters: ``written`` of both lists gives equalities and inequalities."""
    tape = Tape()
    z, known = [tape.input() for _ in range(unknowns)], [tape.input() for _ in range(parameters)]
    equal, room = written(z, known)
    variables, rows = [as_entry(tape, one) for one in z], [as_entry(tape, one) for one in (*equal, *room)]
    slopes = {
        (i, j): value
        for i, row in enumerate(rows)
        for j, value in enumerate(gradient(tape, row, variables))
        if value != tape.constant(0.0)
    }
    weighed: Any = 0.0
    for row in rows:
        weighed = weighed + tape.input() * Expression(tape, row)
    second = hessian(tape, as_entry(tape, weighed), variables)
    return Smooth(
        equalities=len(equal),
        inequalities=len(room),
        parameters=np.zeros(parameters),
        values=compile_evaluator(tape, rows),
        first=compile_evaluator(tape, list(slopes.values())),
        second=compile_evaluator(tape, list(second.values())),
        places=_places(slopes),
        bends=_places(second),
    )


def _places(table: Iterable[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    row, column = np.array(list(table), dtype=int).reshape(-1, 2).T
    return row, column
