"""Fronts of small smooth programs by ε-constraints, from several starts: as ``epsilon`` finds those of motions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from paretoik.errors import SolverFailed
from paretoik.nlp.dense_sqp import Caps
from paretoik.pareto.gap_filling import SAME, fill_gaps, front_rows, known, spread_rows
from paretoik.pareto.refine import Sketch, least, quadratic

YIELD = 1e-6  # of its range: what an objective gives way for the others at an end of the front
FIRST_WEIGHT = 1e-3  # of the others there, until it is found
WEIGHT = 5e-4  # of the other objectives at a given ε: with none, a point may be only weakly optimal
RESOLUTION = 1e-7  # of unknowns of the order of 1: what the last barrier, over FIRST_WEIGHT, leaves open of an end
APART = 0.05  # of the ranges: optima of one objective that are nearer than this to an end are no points of their own
NEAREST = 2  # points, and optima of one objective, that every ε starts from
BRIEF = 60  # quadratic programs, where interior points lead nowhere
BESIDE = 2  # neighbours whose way each point tries at the end


def epsilon_points(
    sketch: Sketch,
    starts: Float[np.ndarray, "starts unknowns"],
    *,
    points: int,
    observe: Callable[[int, int], object] | None = None,
) -> tuple[Float[np.ndarray, "points unknowns"], Float[np.ndarray, " n_obj"]]:
    """Return so many points at most, spread over the front, its ends among them, and the ranges of the objectives.

    Ends are there also where there are more of them than points wanted. First the ends, from every start; then ε
    halfway between two neighbours of the widest gap, started from those near it; last, whether the way of a neighbour
    leads to something better. ``observe`` is called with points found and wanted.

    Raises SolverFailed where no start leads to a point that keeps all limits.
    """
    pool = _alone(sketch, starts)
    payoff = np.array([group[0] for group in pool]) @ sketch.costs.T
    ideal, nadir = payoff.min(axis=0), payoff.max(axis=0)
    resolution = RESOLUTION * np.linalg.norm(sketch.costs, axis=1)
    wide = nadir - ideal > np.maximum(1e-9 * np.maximum(np.abs(ideal), np.abs(nadir)), resolution)
    ranges = np.where(wide, nadir - ideal, np.maximum(np.abs(ideal), 1.0))
    shares = sketch.costs / ranges[:, None]
    if not wide.any():  # one point is the best in every objective
        first = np.array([group[0] for group in pool])
        return first[[int((first @ shares.sum(axis=0)).argmin())]], ranges
    ends = np.array([_finished(shares, sketch, k, group[0]) for k, group in enumerate(pool)])
    other = np.concatenate(pool)
    apart = np.abs((other @ shares.T)[:, None] - ends @ shares.T).max(axis=2).min(axis=1)
    found = _Found(sketch, shares, np.concatenate([ends, other[apart > APART]]), other, observe, points)
    fill_gaps(lambda: found.front()[1], found.add, points)
    found.settle(points)
    z, values = found.front()
    return z[spread_rows(values, points)], ranges


class _Found:
    """The points so far, and how one more is found: from those near it, and from a pool of what starts led to."""

    def __init__(
        self,
        sketch: Sketch,
        shares: np.ndarray,
        z: np.ndarray,
        pool: np.ndarray,
        observe: Callable[[int, int], object] | None,
        wanted: int,
    ) -> None:
        self.sketch, self.shares = sketch, shares
        self.z, self.pool, self.observe, self.wanted = z, pool, observe, wanted

    @property
    def values(self) -> Float[np.ndarray, "points n_obj"]:
        """The objectives, over their ranges."""
        found: np.ndarray = self.z @ self.shares.T
        return found

    def add(self, main: int, caps: np.ndarray) -> bool:
        """Minimise objective ``main`` below caps from the nearest points; return whether that is a new one."""
        starts = [self._nearest(part, caps) for part in (self.front()[0], self.pool)]
        best = self._best(main, caps, np.concatenate(starts))
        if best is None or known(self.shares @ best, self.values):
            return False
        self._keep(best)
        return True

    def settle(self, points: int) -> None:
        """Try for every point of the front whether its neighbours' ways lead to one better in everything."""
        z, values = self.front()
        kept = spread_rows(values, points)
        z, values = z[kept], values[kept]
        for i, value in enumerate(values):
            near = np.argsort(np.linalg.norm(values - value, axis=1), kind="stable")[1 : 1 + BESIDE]
            main = i % len(value)
            best = self._best(main, np.where(np.arange(len(value)) == main, np.inf, value), z[near])
            if best is not None and (value - self.shares @ best)[main] > 10 * SAME:
                self._keep(best)

    def _nearest(self, z: np.ndarray, caps: np.ndarray) -> np.ndarray:
        """Return the few of some points whose objectives are nearest to caps."""
        values = z @ self.shares.T
        apart = np.abs(values - np.where(np.isfinite(caps), caps, values)).max(axis=1)
        return z[np.argsort(apart, kind="stable")[:NEAREST]]

    def _best(self, main: int, caps: np.ndarray, starts: np.ndarray) -> np.ndarray | None:
        """Return the best point below caps that starts lead to, None where they lead to none."""
        cost, others = self.shares[main] + WEIGHT * self.shares.sum(axis=0), np.isfinite(caps)
        below = Caps(rows=self.shares[others], most=caps[others])
        kept = [end.z for z in starts if (end := least(self.sketch, cost, z, below)) is not None]
        if len(starts) and not kept:
            end = quadratic(self.sketch, cost, starts[0], below, iterations=BRIEF)
            kept = [] if end is None or not end.converged else [end.z]
        return min(kept, key=lambda z: float(cost @ z)) if kept else None

    def front(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the points that no other dominates, by the first objective."""
        kept = front_rows(self.values)
        return self.z[kept], self.values[kept]

    def _keep(self, z: np.ndarray) -> None:
        self.z = np.concatenate([self.z, z[None]])
        if self.observe is not None:
            self.observe(len(self.front()[0]), self.wanted)


def _alone(sketch: Sketch, starts: np.ndarray) -> list[np.ndarray]:
    """Return what starts lead to for each objective, nearly alone, the best first: the others may have no least."""
    pool = list[np.ndarray]()
    starts = starts[np.isfinite(starts).all(axis=1)]
    sizes = np.median(np.abs(starts @ sketch.costs.T), axis=0) if len(starts) else np.ones(len(sketch.costs))
    shares = sketch.costs / np.where(sizes > 0, sizes, 1.0)[:, None]
    for own in shares:
        cost = own + FIRST_WEIGHT * shares.sum(axis=0)
        ends = [end.z for start in starts if (end := least(sketch, cost, start)) is not None]
        kept = [ends[i] for i in np.argsort([cost @ z for z in ends], kind="stable")]
        if not kept:
            raise SolverFailed("epsilon_front: a start that leads to a point within all limits wanted, found none")
        pool.append(np.array(kept))
    return pool


def _finished(shares: np.ndarray, sketch: Sketch, main: int, z: np.ndarray) -> np.ndarray:
    """Return what is as good in one objective as z can be, and in the others as good as they can be there."""
    best = least(sketch, shares[main] + YIELD * shares.sum(axis=0), z)
    z = z if best is None else best.z
    others = shares.sum(axis=0) - shares[main]
    end = least(sketch, others, z, Caps(rows=shares[[main]], most=shares[[main]] @ z + YIELD))
    return z if end is None else end.z
