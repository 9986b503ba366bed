"""The constraints that convex subproblems share, in sparse matrices whose structure never depends on numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

CLARABEL_TOLERANCE = 1e-10  # of gaps and infeasibilities: steps and moves are known to about its square root


class Structure(NamedTuple):
    """The shape of a sparse matrix and the places of its entries, in compressed sparse rows."""

    shape: tuple[int, int]
    indptr: bytes
    indices: bytes

    @classmethod
    def of(cls, matrix: sparse.csr_array) -> Structure:
        """Return that of a matrix, entries of 0 included."""
        return cls(matrix.shape, matrix.indptr.astype(np.int32).tobytes(), matrix.indices.astype(np.int32).tobytes())

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Row and column of every entry."""
        indptr, indices = (np.frombuffer(part, dtype=np.int32) for part in (self.indptr, self.indices))
        return np.repeat(np.arange(self.shape[0]), np.diff(indptr)), indices


def structural_product(left: sparse.csr_array, right: sparse.csr_array) -> sparse.csr_array:
    """Return left · right with an entry wherever their structures allow one.

    SciPy's product drops sums that are 0 by chance, so that its structure depends on numbers.
    """
    left_entries, right_entries, places, indptr, indices = _product_plan(Structure.of(left), Structure.of(right))
    entries = np.bincount(places, left.data[left_entries] * right.data[right_entries], len(indices))
    return sparse.csr_array((entries, indices, indptr), shape=(left.shape[0], right.shape[1]))


@lru_cache(maxsize=16)
def _product_plan(left: Structure, right: Structure) -> tuple[np.ndarray, ...]:
    """Return the entries that each product multiplies, which entry it adds to, and the structure of these."""
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
