"""The non-dominated archive outside the population: NSGA-II forgets, the archive does not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from moocore import is_nondominated
from numpy.typing import ArrayLike

from paretoik.arrays import Constraints, Genes, Ids, Mask, Objectives
from paretoik.inputs import check_size
from paretoik.search.objectives import TOLERANCE, Floats, Integers, violations


@dataclass(frozen=True, kw_only=True)
class ArchiveOptions:
    """Settings of the archive."""

    capacity: int = 20_000  # points above which a grid thins the archive
    distance_tolerance: float = 1e-9  # of each objective's range: nearer points are duplicates
    finest_grid: int = 2**16  # cells an axis that thinning starts from


OPTIONS = ArchiveOptions()


@dataclass(frozen=True, eq=False)
class Members:
    """Points as arrays, oldest first: ``ids`` (points,), ``X``, ``F`` minimised, ``G``, ``generations`` (points,)."""

    ids: Ids
    X: Genes
    F: Objectives
    G: Constraints
    generations: Ids

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, rows: Integers | Mask | slice) -> Members:
        return Members(**{name: part[rows] for name, part in vars(self).items()})

    def __add__(self, other: Members) -> Members:
        """Put ``other`` behind these."""
        return Members(**{name: np.concatenate((part, getattr(other, name))) for name, part in vars(self).items()})


@dataclass(frozen=True)
class Failures:
    """How many evaluations gave no usable number, and why the first did not."""

    count: int = 0
    first_cause: str = ""


class Archive:
    """All feasible, finite, mutually non-dominated points so far, each with the id it was evaluated under.

    A point within 1e-9 of the ranges of an older one is that older one. Above ``capacity`` points the oldest of each
    cell of a grid and the best of each objective remain. ``tolerance`` says what counts as feasible; ``names`` are the
    objectives', for causes of failure.
    """

    def __init__(
        self, *, tolerance: ArrayLike = TOLERANCE, capacity: int = OPTIONS.capacity, names: Sequence[str] = ()
    ) -> None:
        check_size("archive capacity", capacity, 1)
        self.failed = Failures()
        self._tolerance = tolerance
        self._capacity = capacity
        self._names = tuple(names)
        self._members: Members | None = None
        self._least_violating: Members | None = None
        self._smallest_violation = np.inf

    def __len__(self) -> int:
        return 0 if self._members is None else len(self._members)

    @property
    def members(self) -> Members | None:
        """All points; None before anything was added."""
        return self._members

    @property
    def F(self) -> Objectives:  # noqa: N802  the field's name
        """Minimised objectives (points, n_obj) of the front."""
        return np.empty((0, 0)) if self._members is None else self._members.F

    @property
    def ids(self) -> Ids:
        """Ids (points,) of the front."""
        return np.empty(0, dtype=np.int64) if self._members is None else self._members.ids

    @property
    def least_violating(self) -> Members | None:
        """The one point with the least finite violation, as long as none is feasible; otherwise None."""
        return None if len(self) else self._least_violating

    def add(
        self,
        ids: Ids,
        X: Genes,
        F: Objectives,
        G: Constraints | None,
        generation: int,
        *,
        causes: Mapping[int, str] | None = None,
    ) -> None:
        """Take in evaluated points; ``causes`` says, by id, why an evaluation failed."""
        G = np.zeros((len(F), 0)) if G is None else G
        new = Members(ids, X, F, G, np.full(len(ids), generation, dtype=np.int64))[np.argsort(ids)]
        violation = violations(new.F, new.G, tolerance=self._tolerance)
        self._count_failures(new, causes or {})
        best = int(np.argmin(violation))
        if np.isfinite(violation[best]) and violation[best] < self._smallest_violation:
            self._least_violating, self._smallest_violation = new[best : best + 1], float(violation[best])
        old = new[:0] if self._members is None else self._members
        self._members = self._merge(old, new[violation <= 0.0])

    def _count_failures(self, new: Members, causes: Mapping[int, str]) -> None:
        for row in np.flatnonzero(~np.isfinite(new.F).all(axis=1) | np.isnan(new.G).any(axis=1)):
            first = self.failed.first_cause or causes.get(int(new.ids[row])) or self._describe(new.F[row], new.G[row])
            self.failed = Failures(self.failed.count + 1, first)

    def _describe(self, F: Floats, G: Floats) -> str:
        bad = np.flatnonzero(~np.isfinite(F))
        if bad.size:
            name = self._names[bad[0]] if self._names else f"f{bad[0] + 1}"
            return f"objective {name} is {F[bad[0]]}"
        return f"constraint {np.flatnonzero(np.isnan(G))[0] + 1} is nan"

    def _merge(self, old: Members, new: Members) -> Members:
        new = new[_non_dominated(old.F, new.F)[len(old) :]]
        new = new[~_duplicates(old.F, new.F)]
        if not len(new):
            return old
        both = old + new
        both = both[_non_dominated(old.F, new.F)]
        return both if len(both) <= self._capacity else both[_thin(both.F, self._capacity // 2)]


def _non_dominated(old: Floats, new: Floats) -> Mask:
    mask: Mask = is_nondominated(np.concatenate((old, new)), keep_weakly=False)
    return mask


def _duplicates(old: Floats, new: Floats) -> Mask:
    """Mark those of ``new`` that repeat an old point or an earlier new one, within the tolerance."""
    points = np.concatenate((old, new))
    close = np.tri(len(new), len(points), len(old) - 1, dtype=bool)  # only older ones count
    for axis in range(new.shape[1] if len(new) else 0):
        reach = OPTIONS.distance_tolerance * np.ptp(points[:, axis])
        np.logical_and(close, np.abs(points[:, axis] - new[:, axis, None]) <= reach, out=close)
    return np.asarray(close.any(axis=1))


def _thin(F: Floats, count: int) -> Integers:
    """Return the rows of the best of each objective and the oldest of each cell of the finest grid with ``count``."""
    ideal, width = F.min(axis=0), np.ptp(F, axis=0)
    share: Floats = np.divide(F - ideal, width, out=np.zeros_like(F), where=width > 0)
    extremes = F.argmin(axis=0)
    cells = OPTIONS.finest_grid
    while True:
        inside = np.minimum((share * cells).astype(np.int64), cells - 1)
        selected = np.unique(np.concatenate((np.unique(inside, axis=0, return_index=True)[1], extremes)))
        if len(selected) <= max(count, len(np.unique(extremes)) + 1):
            return selected
        cells //= 2
