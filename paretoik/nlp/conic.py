"""The constraints that convex subproblems share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

CLARABEL_TOLERANCE = 1e-10  # of gaps and infeasibilities: steps and moves are known to about its square root


def dense_rows(matrix: Float[np.ndarray, "rows columns"]) -> sparse.csr_array:
    """Return a dense matrix as a sparse one that has every entry: its pattern follows from its shape alone."""
    rows, columns = matrix.shape
    return sparse.csr_array(
        (matrix.ravel(), np.tile(np.arange(columns), rows), columns * np.arange(rows + 1)), shape=matrix.shape
    )


def stack_rows(parts: Sequence[sparse.csr_array]) -> sparse.csr_array:
    """Return matrices one below the other: as SciPy's vstack, in a tenth of its time where they are small."""
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
    """d[column] + ‖values‖ ≥ ‖values + rows d‖: at d = 0 the column stands for the length itself."""

    column: int
    values: Float[np.ndarray, " parts"]
    rows: sparse.csr_array


@dataclass(frozen=True, kw_only=True, eq=False)
class Constraints:
    """values + jacobian d ≥ 0, and cones; the length of a step d is that of its first ``unknowns`` entries."""

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
        """Euclidean length of every row of the Jacobian, at least a tiny one."""
        square = np.bincount(self.entries.row, self.entries.data**2, minlength=len(self.values))
        return np.maximum(np.sqrt(square), 1e-300)

    def within_reach(self, radius: float, *, order: int) -> Int[np.ndarray, " rows"]:
        """Return the inequalities that some step within a ball could reach, ``order`` being that of the ball's norm.

        Those that bound an auxiliary column, which no ball bounds, always count.
        """
        bounded, count = self.entries.col < self.unknowns, len(self.values)
        row, value = self.entries.row[bounded], np.abs(self.entries.data[bounded])
        dual_norm = np.bincount(row, value, count) if order != 2 else np.sqrt(np.bincount(row, value**2, count))
        auxiliary = np.bincount(self.entries.row[~bounded], minlength=count) > 0
        reachable: np.ndarray = np.flatnonzero(auxiliary | (self.values < dual_norm * radius))
        return reachable

    def cone_multipliers(self, dual: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the multipliers of the vector in every cone from the dual variables of all their rows."""
        multipliers, first = [], 0
        for cone in self.cones:
            multipliers.append(-dual[first + 1 : first + 1 + len(cone.values)])
            first += len(cone.values) + 1
        return tuple(multipliers)
