"""Large smooth programs out of small ones: the same rows again and again, each of a few of the unknowns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.autodiff.evaluator import Evaluator
from paretoik.nlp.traced import Smooth


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """A program that holds at several places: of the unknowns ``where`` (lanes, its unknowns), each with parameters."""

    program: Smooth
    where: Int[np.ndarray, "lanes unknowns"]
    parameters: Float[np.ndarray, "lanes parameters"]

    def run(self, program: Evaluator, z: np.ndarray, weights: np.ndarray | None) -> np.ndarray:
        """Return what one of its programs says at every place, (outputs, lanes)."""
        count = self.program.equalities + self.program.inequalities
        given = np.zeros((count, len(self.where))) if weights is None else weights
        return program(np.concatenate([z[self.where].T, self.parameters.T, given]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Assembled:
    """A program of parts: the equalities of all in order, then the inequalities of all, lane by lane."""

    unknowns: int
    parts: tuple[Part, ...]

    def rows(self, z: Float[np.ndarray, " unknowns"]) -> tuple[np.ndarray, np.ndarray]:
        """Return both kinds of rows."""
        found = [(part.program.equalities, part.run(part.program.values, z, None)) for part in self.parts]
        equal = [values[:count].T.ravel() for count, values in found]
        return np.concatenate(equal), np.concatenate([values[count:].T.ravel() for count, values in found])

    def jacobian(self, z: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, "rows unknowns"]:
        """Return the first derivatives of all rows, equalities first."""
        equal, room = list[np.ndarray](), list[np.ndarray]()
        for part in self.parts:
            own, (row, column) = part.program, part.program.places
            table = np.zeros((len(part.where), own.equalities + own.inequalities, self.unknowns))
            lane = np.arange(len(part.where))[:, None]
            table[lane, row, part.where[:, column]] = part.run(own.first, z, None).T
            equal.append(table[:, : own.equalities].reshape(-1, self.unknowns))
            room.append(table[:, own.equalities :].reshape(-1, self.unknowns))
        return np.concatenate([*equal, *room])

    def curvature(self, z: Float[np.ndarray, " unknowns"], weights: Float[np.ndarray, " rows"]) -> np.ndarray:
        """Return the second derivatives of weights · rows, (unknowns, unknowns)."""
        found = np.zeros((self.unknowns, self.unknowns))
        equal, room = 0, sum(part.program.equalities * len(part.where) for part in self.parts)
        for part in self.parts:
            own, lanes = part.program, len(part.where)
            ends = equal + own.equalities * lanes, room + own.inequalities * lanes
            mine = weights[equal : ends[0]].reshape(lanes, -1), weights[room : ends[1]].reshape(lanes, -1)
            equal, room = ends
            given = np.concatenate(mine, axis=1).T
            row, column = own.bends
            values = part.run(own.second, z, given).T
            np.add.at(found, (part.where[:, row], part.where[:, column]), values)
            apart = row != column
            np.add.at(found, (part.where[:, column[apart]], part.where[:, row[apart]]), values[:, apart])
        return found
