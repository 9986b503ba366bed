"""What convex subproblems are made of, and how Clarabel is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import clarabel
import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from paretoik.errors import SolverFailed


class Entries(NamedTuple):
    """Row, column and value of each entry of a sparse matrix: what subproblems are put together from, quickly."""

    row: Int[np.ndarray, " entries"]
    column: Int[np.ndarray, " entries"]
    value: Float[np.ndarray, " entries"]

    @classmethod
    def of(cls, table: sparse.csr_array) -> Entries:
        """Return those of a matrix."""
        return cls(np.repeat(np.arange(table.shape[0]), np.diff(table.indptr)), table.indices, table.data)

    @classmethod
    def diagonal(cls, size: int, value: float, *, below: int = 0) -> Entries:
        """Return those of a multiple of the identity, ``below`` empty rows."""
        place = np.arange(size)
        return cls(place + below, place, np.full(size, value))


@dataclass(frozen=True, kw_only=True, eq=False)
class Cone:
    """The number of a column is at least the length of values + rows · step; where step = 0 it is that length."""

    column: int
    values: Float[np.ndarray, " parts"]
    rows: sparse.csr_array


@dataclass(frozen=True, kw_only=True, eq=False)
class Constraints:
    """gaps + slopes · step ≥ 0, and cones; the length of a step is that of its first ``unknowns`` entries."""

    unknowns: int
    gaps: Float[np.ndarray, " limits"]
    slopes: sparse.csr_array
    cones: tuple[Cone, ...] = ()

    @cached_property
    def entries(self) -> Entries:
        """The entries of the slopes."""
        return Entries.of(self.slopes)

    @cached_property
    def lengths(self) -> Float[np.ndarray, " limits"]:
        """Length of every limit's slope, at least a tiny one."""
        square = np.bincount(self.entries.row, self.entries.value**2, minlength=len(self.gaps))
        return np.maximum(np.sqrt(square), 1e-300)

    def in_reach(self, longest: float, *, order: int) -> np.ndarray:
        """Return which limits a step of the unknowns, of that length in the norm of ``order``, could reach."""
        own, size = self.entries.column < self.unknowns, len(self.gaps)
        row, value = self.entries.row[own], np.abs(self.entries.value[own])
        steep = np.bincount(row, value, size) if order != 2 else np.sqrt(np.bincount(row, value**2, size))
        tied = np.bincount(self.entries.row[~own], minlength=size) > 0
        found: np.ndarray = np.flatnonzero(tied | (self.gaps < steep * longest))
        return found

    def turned(self, near: np.ndarray, lengths: np.ndarray) -> Entries:
        """Return −slopes / lengths of the limits ``near`` alone, as a solver takes them."""
        place = np.full(len(self.gaps), -1)
        place[near] = np.arange(len(near))
        row, column, value = self.entries
        kept = place[row] >= 0
        row = place[row[kept]]
        return Entries(row, column[kept], -value[kept] / lengths[row])

    def tops(self) -> list[tuple[int, Entries, np.ndarray, Any]]:
        """Return the height, entries, right side and kind of every cone, as a solver takes them."""
        found = []
        for cone in self.cones:
            row, column, value = Entries.of(cone.rows)
            below = Entries(np.append(0, row + 1), np.append(cone.column, column), np.append(-1.0, -value))
            right = np.append(np.linalg.norm(cone.values), cone.values)
            found.append((len(right), below, right, clarabel.SecondOrderConeT(len(right))))
        return found

    def pulls(self, dual: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the multipliers of every cone from the dual variables of the rows of all."""
        found, begun = [], 0
        for cone in self.cones:
            found.append(-dual[begun + 1 : begun + 1 + len(cone.values)])
            begun += len(cone.values) + 1
        return tuple(found)


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """A solver's answer: the variables, the dual variables of all rows, and the value."""

    x: Float[np.ndarray, " variables"]
    dual: Float[np.ndarray, " rows"]
    value: float


def asked(
    what: str,
    quadratic: Entries,
    linear: Float[np.ndarray, " variables"],
    blocks: Sequence[tuple[int, Entries]],
    right: Sequence[np.ndarray],
    cones: Sequence[Any],
    tolerance: float,
) -> Answer:
    """Return the answer to: least ½ xᵀ P x + q·x with right − blocks · x in the cones.

    ``blocks`` stand one below the other, each with its height; of P the upper half counts. Raises SolverFailed,
    naming ``what``, where there is no answer.
    """
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    upper = quadratic.row <= quadratic.column
    square = _compressed(Entries(*(part[upper] for part in quadratic)), len(linear), len(linear))
    begins = np.cumsum([0, *(height for height, _ in blocks)])
    stacked = Entries(
        np.concatenate([block.row + begin for (_, block), begin in zip(blocks, begins[:-1], strict=True)]),
        np.concatenate([block.column for _, block in blocks]),
        np.concatenate([block.value for _, block in blocks]),
    )
    matrix = _compressed(stacked, int(begins[-1]), len(linear))
    found = clarabel.DefaultSolver(square, linear, matrix, np.concatenate(right), list(cones), settings).solve()
    if str(found.status) not in ("Solved", "AlmostSolved"):
        raise SolverFailed(f"{what}: Clarabel wanted to end with Solved, got {found.status}")
    return Answer(x=np.array(found.x), dual=np.array(found.z), value=float(found.obj_val))


def _compressed(entries: Entries, rows: int, columns: int) -> sparse.csc_matrix:
    order = np.argsort(entries.column * rows + entries.row)
    begins = np.searchsorted(entries.column[order], np.arange(columns + 1))
    return sparse.csc_matrix((entries.value[order], entries.row[order], begins), shape=(rows, columns))
