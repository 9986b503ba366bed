"""The rows of large smooth programs out of those of small ones, each of a few of the unknowns, lane by lane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.autodiff.evaluator import Evaluator
from paretoik.nlp.traced import TracedRows


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """Rows in several lanes: of the unknowns ``where`` (lanes, unknowns of the part), each with parameters."""

    program: TracedRows
    where: Int[np.ndarray, "lanes unknowns"]
    parameters: Float[np.ndarray, "lanes parameters"]

    def run(self, evaluator: Evaluator, z: np.ndarray, weights: np.ndarray | None) -> np.ndarray:
        """Return what one of its evaluators gives in every lane, (outputs, lanes)."""
        rows = self.program.equalities + self.program.inequalities
        factors = np.zeros((rows, len(self.where))) if weights is None else weights
        return evaluator(np.concatenate([z[self.where].T, self.parameters.T, factors]))


@dataclass(frozen=True, kw_only=True, eq=False)
class AssembledRows:
    """The rows of parts: the equalities of all in order, then the inequalities of all, lane by lane."""

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
