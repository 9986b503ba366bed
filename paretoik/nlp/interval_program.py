"""Points of a path moved so that its pieces take the least time: a second-order cone program, solved again and again.

minimise    Σ ΔT(l)
subject to  ‖values(l) + before(l) d(l) + after(l) d(l+1)‖ ≤ ΔT(l)
            lower ≤ d ≤ upper, d(0) = d(N) = 0

d are the moves of the points between the ends; all pieces have one interval ΔT in common, or each its own. It is built
once and solved by Clarabel, whose data alone change. It is assembled by hand, since it is solved at every step of a
controller: canonicalised by cvxpy and solved anew, five pieces took 1.9 times as long. Tests hold it against a
statement in cvxpy. Source: Kim, Choi & Jang 2021, Eq. 6, its velocity limit linearised.
"""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import SolverFailed
from paretoik.nlp.conic import CLARABEL_TOLERANCE


@dataclass(frozen=True, kw_only=True, eq=False)
class Pieces:
    """Times that pieces take as lengths of vectors, to first order in how their ends move.

    ``values`` [s] are those of the path as it is, ``before`` and ``after`` [s/m] their derivatives by the point that a
    piece begins and ends with.
    """

    values: Float[np.ndarray, "pieces task"]
    before: Float[np.ndarray, "pieces task task"]
    after: Float[np.ndarray, "pieces task task"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Moves:
    """Moves (between, task) [m] of the points between the ends, and the interval (pieces,) [s] of every piece."""

    moves: Float[np.ndarray, "between task"]
    intervals: Float[np.ndarray, " pieces"]


class IntervalSolver:
    """The program for so many pieces, at least two, in so many coordinates, whose solver is reused."""

    def __init__(self, pieces: int, task: int, *, common: bool = True) -> None:
        self._pieces, self._task, self._common = pieces, task, common
        self._unknowns = (pieces - 1) * task
        self._settings = clarabel.DefaultSettings()
        self._settings.verbose = False
        self._settings.presolve_enable = False  # it could drop rows, and data of another size cannot be updated
        self._settings.tol_gap_abs = self._settings.tol_gap_rel = self._settings.tol_feas = CLARABEL_TOLERANCE
        self._place_entries()
        self._solver: clarabel.DefaultSolver | None = None

    def solve(
        self, pieces: Pieces, lower: Float[np.ndarray, "between task"], upper: Float[np.ndarray, "between task"]
    ) -> Moves:
        """Return the best moves between ``lower`` and ``upper`` [m], finite and on either side of 0.

        Raises SolverFailed where Clarabel finds none.
        """
        time = max(float(np.abs(pieces.values).max()), 1e-300)
        length = time / max(float(np.abs(pieces.after).max()), 1e-300)  # in these units pieces and slopes are about 1
        scaled = length / time
        entries = (self._fixed, -scaled * pieces.before[1:].ravel(), -scaled * pieces.after[:-1].ravel())
        matrix = np.concatenate(entries)[self._order]
        tops = np.zeros((self._pieces, self._task + 1))
        tops[:, 1:] = pieces.values / time
        right = np.concatenate([upper.ravel() / length, -lower.ravel() / length, tops.ravel()])
        x = np.array(self._run(matrix, right).x)
        return Moves(
            moves=x[: self._unknowns].reshape(-1, self._task) * length,
            intervals=np.broadcast_to(x[self._unknowns :], self._pieces) * time,
        )

    def _run(self, matrix: np.ndarray, right: np.ndarray) -> clarabel.DefaultSolution:
        if self._solver is None:
            columns = len(self._linear)
            table = sparse.csc_matrix((matrix, self._rows, self._begins), shape=(len(right), columns))
            empty = sparse.csc_matrix((columns, columns))
            self._solver = clarabel.DefaultSolver(empty, self._linear, table, right, self._cones, self._settings)
        else:
            self._solver.update(A=matrix, b=right)
        solution = self._solver.solve()
        if str(solution.status) not in ("Solved", "AlmostSolved"):
            raise SolverFailed(f"intervals: Clarabel wanted to end with Solved, got {solution.status}")
        return solution

    def _place_entries(self) -> None:
        """Find where entries stand: the two sides of the box, the intervals, ``before`` and ``after``."""
        pieces, task, unknowns = self._pieces, self._task, self._unknowns
        index = np.arange(unknowns)
        first = 2 * unknowns + np.arange(pieces) * (task + 1)  # row of each piece's cone
        interval = unknowns + (np.zeros(pieces, dtype=int) if self._common else np.arange(pieces))
        part, coordinate = np.indices((task, task)).reshape(2, -1)
        point = task * np.arange(pieces - 1)[:, None] + coordinate
        row = [
            index,
            index + unknowns,
            first,
            (first[1:, None] + 1 + part).ravel(),
            (first[:-1, None] + 1 + part).ravel(),
        ]
        column = np.concatenate([index, index, interval, point.ravel(), point.ravel()])
        self._order = np.lexsort((np.concatenate(row), column))
        self._rows = np.concatenate(row)[self._order]
        self._linear = np.append(np.zeros(unknowns), np.ones(1 if self._common else pieces))
        self._begins = np.searchsorted(column[self._order], np.arange(len(self._linear) + 1))
        self._fixed = np.concatenate([np.ones(unknowns), np.full(unknowns + pieces, -1.0)])
        self._cones = [clarabel.NonnegativeConeT(2 * unknowns), *[clarabel.SecondOrderConeT(task + 1)] * pieces]
