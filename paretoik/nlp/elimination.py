"""Elimination of auxiliary columns, in which few rows have entries, before dense factorisations of what is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float


@dataclass(frozen=True, kw_only=True)
class EliminationOptions:
    """Entries up to ``pivot`` of rows of length one are none."""

    pivot: float = 1e-9


OPTIONS = EliminationOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Elimination:
    """Rows with auxiliary columns eliminated from all but one row each, their pivots.

    ``pivots`` are the rows of ``columns``, ``remaining`` says which rows are none, ``free`` which columns stay.
    """

    table: Float[np.ndarray, "rows columns"]
    pivots: list[int]
    columns: list[int]
    remaining: Bool[np.ndarray, " rows"]
    free: Bool[np.ndarray, " columns"]

    @property
    def reduced(self) -> Float[np.ndarray, "remaining free"]:
        """What other rows have in the columns that stay."""
        return self.table[np.ix_(self.remaining, self.free)]


def eliminate(rows: Float[np.ndarray, "rows columns"], unknowns: int, pivot_rows: int | None = None) -> Elimination:
    """Eliminate the columns from ``unknowns`` on (Gauss & Jordan), pivots being among the first ``pivot_rows``, or all.

    Pivots are the largest entries; a column without any stays.
    """
    table, (count, size) = rows.copy(), rows.shape
    remaining, free = np.ones(count, dtype=bool), np.ones(size, dtype=bool)
    pivots, columns = list[int](), list[int]()
    end = count if pivot_rows is None else pivot_rows
    for column in range(unknowns, size):
        sizes = np.abs(table[:end, column]) * remaining[:end]
        pivot = int(np.argmax(sizes)) if end else 0
        if not end or sizes[pivot] <= OPTIONS.pivot:
            continue
        pivots.append(pivot)
        columns.append(column)
        remaining[pivot], free[column] = False, False
        table[pivot] /= table[pivot, column]
        others = np.flatnonzero(table[:, column])
        others = others[others != pivot]
        table[others] -= table[others, column][:, None] * table[pivot]
    return Elimination(table=table, pivots=pivots, columns=columns, remaining=remaining, free=free)
