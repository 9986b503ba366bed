"""The non-dominated archive outside the population: it keeps points that NSGA-II loses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from moocore import is_nondominated
from numpy.typing import ArrayLike

from paretoik.arrays import Constraints, Genes, Ids, Mask, Objectives
from paretoik.inputs import check_size
from paretoik.search.objectives import EQUALITY_TOLERANCE, TOLERANCE, Floats, Integers, column_tolerance, violations


@dataclass(frozen=True, kw_only=True)
class ArchiveOptions:
    """Settings of the archive."""

    capacity: int = 20_000  # number of points above which a grid thins the archive
    distance_tolerance: float = 1e-9  # share of each objective's range; nearer points are duplicates
    finest_grid: int = 2**16  # number of cells per axis at which thinning starts


OPTIONS = ArchiveOptions()


@dataclass(frozen=True, eq=False)
class Members:
    """Points as arrays, oldest first; F is minimised."""

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
        """Return these members followed by ``other``."""
        return Members(**{name: np.concatenate((part, getattr(other, name))) for name, part in vars(self).items()})


@dataclass(frozen=True)
class Failures:
    """Number of failed evaluations, and the cause of the first."""

    count: int = 0
    first_cause: str = ""


class Archive:
    """All feasible, finite, mutually non-dominated points so far, each with its id.

    A point that differs from an older one by less than 1e-9 of each range is a duplicate and is left out. Above
    ``capacity`` points only the oldest in each cell of a grid and the best of each objective remain.

    tolerance: largest G of a feasible point, one number or one per constraint
    equality_tolerance: largest |H| of a feasible point, one number or one per constraint
    names: names of the objectives for causes of failure
    """

    def __init__(
        self,
        *,
        tolerance: ArrayLike = TOLERANCE,
        equality_tolerance: ArrayLike = EQUALITY_TOLERANCE,
        capacity: int = OPTIONS.capacity,
        names: Sequence[str] = (),
    ) -> None:
        check_size("archive capacity", capacity, 1)
        self.failed = Failures()
        self.members: Members | None = None  # all points; None before the first are added
        self._tolerance, self._equality_tolerance = tolerance, equality_tolerance
        self._capacity, self._names = capacity, tuple(names)
        self._least_violating: Members | None = None
        self._smallest_violation = np.inf

    def __len__(self) -> int:
        return 0 if self.members is None else len(self.members)

    @property
    def F(self) -> Objectives:  # noqa: N802  the field's name
        """Minimised objectives (points, n_obj) of the front."""
        return np.empty((0, 0)) if self.members is None else self.members.F

    @property
    def ids(self) -> Ids:
        """Ids (points,) of the front."""
        return np.empty(0, dtype=np.int64) if self.members is None else self.members.ids

    @property
    def least_violating(self) -> Members | None:
        """The point with the least finite violation; None if a feasible point was found."""
        return None if len(self) else self._least_violating

    def add(
        self,
        ids: Ids,
        X: Genes,
        F: Objectives,
        G: Constraints | None,
        generation: int,
        *,
        H: Float[np.ndarray, "points n_equalities"] | None = None,
        causes: Mapping[int, str] | None = None,
    ) -> None:
        """Add evaluated points. ``causes``: reasons of failed evaluations, by id."""
        G, H = (np.zeros((len(F), 0)) if table is None else table for table in (G, H))
        slack = column_tolerance("equality_tolerance", self._equality_tolerance, H.shape[1])
        tolerance = np.append(column_tolerance("tolerance", self._tolerance, G.shape[1]), np.zeros(H.shape[1]))
        G = np.column_stack((G, np.abs(H) - slack))
        new = Members(ids, X, F, G, np.full(len(ids), generation, dtype=np.int64))[np.argsort(ids)]
        violation = violations(new.F, new.G, tolerance=tolerance)
        for row in np.flatnonzero(~np.isfinite(new.F).all(axis=1) | np.isnan(new.G).any(axis=1)):
            first = self.failed.first_cause or (causes or {}).get(int(new.ids[row]))
            if not first:
                bad = np.flatnonzero(~np.isfinite(new.F[row]))
                if bad.size:
                    name = self._names[bad[0]] if self._names else f"f{bad[0] + 1}"
                    first = f"objective {name} is {new.F[row, bad[0]]}"
                else:
                    first = f"constraint {np.flatnonzero(np.isnan(new.G[row]))[0] + 1} is nan"
            self.failed = Failures(self.failed.count + 1, first)
        best = int(np.argmin(violation))
        if np.isfinite(violation[best]) and violation[best] < self._smallest_violation:
            self._least_violating, self._smallest_violation = new[best : best + 1], float(violation[best])

        # Feasible, non-dominated new points enter unless they are duplicates; old points that they dominate leave.
        old, new = new[:0] if self.members is None else self.members, new[violation <= 0.0]
        new = new[is_nondominated(np.concatenate((old.F, new.F)), keep_weakly=False)[len(old) :]]
        # mask of new points that are duplicates of an old point or an earlier new one
        points = np.concatenate((old.F, new.F))
        close = np.tri(len(new.F), len(points), len(old.F) - 1, dtype=bool)  # only older ones count
        for axis in range(new.F.shape[1] if len(new.F) else 0):
            reach = OPTIONS.distance_tolerance * np.ptp(points[:, axis])
            np.logical_and(close, np.abs(points[:, axis] - new.F[:, axis, None]) <= reach, out=close)
        repeated = np.asarray(close.any(axis=1))
        new = new[~repeated]
        both = old + new
        if len(new):
            both = both[is_nondominated(both.F, keep_weakly=False)]
        self.members = both if len(both) <= self._capacity else both[_thin(both.F, self._capacity // 2)]


def _thin(F: Floats, count: int) -> Integers:
    """Return rows of each objective's best point and of each grid cell's oldest.

    The grid is the finest one that leaves at most ``count`` points.
    """
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
