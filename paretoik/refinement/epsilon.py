"""Fronts by ε-constraints: one objective minimised, the others kept below ε, from several starts for every ε.

Source: Tringali & Cocuzza 2020, section 4.3, with inequalities in place of the printed equality, which returns
dominated points; Haimes et al. 1971.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from paretoik.errors import EvaluationFailed
from paretoik.refinement.compiled.interior_point import Rules
from paretoik.refinement.multistart import APART, coarse_starts, descended, distance, planned
from paretoik.refinement.polish import Polished, polish
from paretoik.refinement.program import MotionProgram, motion_program
from paretoik.task.motion_task import MotionTask

YIELD = 1e-6  # weight of the other objectives, as shares of their ranges: at an end of the front, at a given ε
SAME = 1e-7  # of the ranges: points nearer than this are one, and a gain of less is none
NEAREST = 6  # points whose motions every ε starts from
INNER = (0.25, 0.5, 0.75)  # of the way from nadir to ideal: ε with cold starts of their own
POOL = 4  # optima of each objective that every ε starts from
COLD, WARM = Rules(barrier=0.1, radius=0.2), Rules(barrier=1e-4, radius=0.02)


@dataclass(frozen=True, kw_only=True, eq=False)
class Points:
    """Motions of a front with their objectives, minimised, and the ranges that these were divided by on the way."""

    q: Float[np.ndarray, "points time dof"]
    values: Float[np.ndarray, "points n_obj"]
    ranges: Float[np.ndarray, " n_obj"]


def epsilon_points(
    task: MotionTask,
    *,
    points: int,
    starts: int,
    seed: int,
    observe: Callable[[int, int], object] | None = None,
) -> Points:
    """Return at least two and at most about ``points`` motions spread over the front, its ends among them.

    Two objectives: ε goes down evenly, then into the widest gaps. More: a grid of ε. Every ε is started from the optima
    of the single objectives and from its neighbours' motions. ``observe`` is called with points found and wanted.

    Raises as ``planned`` does.
    """
    pool, ends, ranges = _ends(task, starts=starts, seed=seed)
    program = motion_program(task, ranges)
    cold = coarse_starts(task, starts=starts, seed=seed)
    found = _Found(program, np.concatenate([pool, *_between(task, cold, ends, ranges)]), ends, ranges, observe, points)
    if len(ranges) == 2:
        _fill_gaps(found, points)
    elif len(ranges) > 2:
        _fill_grid(found, points)
    q, values = found.front()
    return Points(q=q, values=values * ranges, ranges=ranges)


class _Found:
    """The points so far, and how one more is found."""

    def __init__(
        self,
        program: MotionProgram,
        pool: np.ndarray,
        ends: Polished,
        ranges: np.ndarray,
        observe: Callable[[int, int], object] | None,
        wanted: int,
    ) -> None:
        self.program, self.pool, self.ranges = program, pool, ranges
        self.q, self.values = ends.q, ends.totals
        self.observe, self.wanted = observe, wanted

    def add(self, main: int, caps: np.ndarray, *, cold: bool) -> bool:
        """Minimise objective ``main`` below caps from the nearest points, and ``cold`` also from the pool.

        Returns whether that is a new point.
        """
        got = self._best(main, caps, self._nearest(caps), cold=cold)
        if got is None or _known(got.totals[0], self.values):
            return False
        self._store(got)
        return True

    def traced(self, levels: np.ndarray) -> None:
        """Follow every optimum of the pool as its own branch, through falling and through rising ε of objective two.

        Two objectives. A branch that is dominated here may be the best one there: all that is found is kept.
        """
        factors, caps = np.zeros((1, len(self.program.totals))), np.full((1, len(self.program.totals)), np.inf)
        factors[0, :2] = 1.0, YIELD
        motions = self.program.task.motion(self.pool)
        own = (
            np.asarray(self.program.task.objectives[1](motions)) * self.program.task.objectives[1].sign / self.ranges[1]
        )
        for falling, order in ((True, levels), (False, levels[::-1])):
            q, waiting = self.pool[:0], np.ones(len(own), dtype=bool)
            for level in order:
                joining = waiting & (own >= level if falling else own <= level)
                waiting &= ~joining
                q = np.concatenate([q, self.pool[joining]])
                if len(q):
                    caps[0, 1] = level
                    got = polish(self.program, q, factors, caps, WARM)
                    got = got[got.converged]
                    got = got[_apart(self.program.task, got)]
                    self._store(got)
                    q = got.q

    def _store(self, got: Polished) -> None:
        self.q = np.concatenate([self.q, got.q])
        self.values = np.concatenate([self.values, got.totals])
        if self.observe is not None:
            self.observe(len(self.front()[0]), self.wanted)

    def _nearest(self, caps: np.ndarray) -> np.ndarray:
        values = self.values[:, : len(caps)]
        apart = np.abs(values - np.where(np.isfinite(caps), caps, values)).max(axis=1)
        return np.argsort(apart, kind="stable")[:NEAREST]

    def _best(self, main: int, caps: np.ndarray, nearest: np.ndarray, *, cold: bool) -> Polished | None:
        """Return the best motion below caps that these points' motions, and ``cold`` the pool's, lead to."""
        pool = self.pool if cold else self.pool[:0]
        rules = [WARM] * len(nearest) + [COLD] * len(pool)
        factors, below = np.zeros((1, len(self.program.totals))), np.full((1, len(self.program.totals)), np.inf)
        factors[0, : len(caps)] = YIELD  # a weak point is not enough
        factors[0, main] = 1.0
        below[0, : len(caps)] = caps
        got = polish(self.program, np.concatenate([self.q[nearest], pool]), factors, below, rules)
        if not got.converged.any():
            return None
        best = int(np.argmin(np.where(got.converged, got.totals[:, main], np.inf)))
        return got[best : best + 1]

    def front(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the points that no other dominates, by the first objective."""
        values = self.values[:, : len(self.program.task.objectives)]
        kept = front_rows(values)
        return self.q[kept], values[kept]


def front_rows(shares: Float[np.ndarray, "points n_obj"]) -> Int[np.ndarray, " kept"]:
    """Return which points, as shares of the ranges, no other dominates or repeats within ``SAME``; best first first."""
    less = shares[:, None] <= shares[None] + SAME  # i no worse than j
    better = np.any(shares[:, None] < shares[None] - SAME, axis=2)
    no_worse = np.all(less, axis=2)
    dominated = np.any(no_worse & better, axis=0)
    exact = np.all(shares[:, None] <= shares[None], axis=2) & np.any(shares[:, None] < shares[None], axis=2)
    earlier = np.tri(len(shares), k=-1, dtype=bool).T
    repeats = np.any(no_worse & no_worse.T & earlier, axis=0)
    kept = np.flatnonzero(~dominated & ~repeats & ~np.any(exact, axis=0))
    return kept[np.argsort(shares[kept, 0], kind="stable")]


def polished_points(task: MotionTask, q: Float[np.ndarray, "points time dof"], ranges: np.ndarray) -> Polished:
    """Return motions that are at least as good as given ones in every objective, each from its own given motion.

    The first objective is minimised, the others may not rise. ``sums`` are divided by the ranges.
    """
    program, count = motion_program(task, ranges), len(ranges)
    motions = task.motion(q)
    values = np.stack([o(motions) * o.sign for o in task.objectives], axis=1) / ranges
    factors, caps = np.zeros((1, len(program.totals))), np.full((len(q), len(program.totals)), np.inf)
    factors[0, :count] = [1.0, *[YIELD] * (count - 1)]
    caps[:, 1:count] = values[:, 1:]
    found = polish(program, q, factors, caps, WARM)
    again = ~found.converged
    return found.merged(again, polish(program, q[again], factors, caps[again], COLD)) if again.any() else found


def _ends(task: MotionTask, *, starts: int, seed: int) -> tuple[np.ndarray, Polished, np.ndarray]:
    """Return (motions to start from, the ends of the front, ranges of the objectives)."""
    count, pool, best = len(task.objectives), [], []
    for objective in task.objectives:
        plan = planned(replace(task, objectives=(objective,)), starts=starts, seed=seed)
        pool += [optimum.motion.q for optimum in plan.optima[:POOL]]
        best.append(plan.best.motion.q)
    motions = task.motion(np.stack(best))
    signs = np.array([o.sign for o in task.objectives])
    payoff = np.stack([o(motions) for o in task.objectives], axis=1) * signs
    ideal, nadir = payoff.min(axis=0), payoff.max(axis=0)
    wide = nadir - ideal > 1e-9 * np.maximum(np.abs(ideal), np.abs(nadir))
    ranges = np.where(wide, nadir - ideal, np.maximum(np.abs(ideal), 1.0))
    program = motion_program(task, ranges)
    factors = np.zeros((count, len(program.totals)))
    factors[:, :count] = np.where(np.eye(count) > 0, 1.0, YIELD)
    ends = polish(program, np.stack(best), factors, rules=WARM)
    if not ends.converged.all():
        failed = task.objectives[int(np.argmin(ends.converged))].name
        raise EvaluationFailed(f"the end of the front where {failed} is best wanted to converge, but did not")
    unique: list[np.ndarray] = []
    for q in pool:
        if not unique or distance(task, q, np.stack(unique)).min() > APART:
            unique.append(q)
    return np.stack(unique), ends, ranges


def _between(task: MotionTask, cold: np.ndarray, ends: Polished, ranges: np.ndarray) -> list[np.ndarray]:
    """Return the optima that many starts lead to below some ε: a branch may belong to no objective's own optimum."""
    count = len(ranges)
    ideal, nadir = ends.totals[:, :count].min(axis=0), ends.totals[:, :count].max(axis=0)
    found = []
    for share in INNER:
        for main in range(count):
            caps = nadir + share * (ideal - nadir)
            caps[main] = np.inf
            factors = np.full(count, YIELD)
            factors[main] = 1.0
            got, _ = descended(task, cold, factors, caps, ranges)
            found.append(got.q[got.converged][:POOL])
    return found


def _fill_gaps(found: _Found, points: int) -> None:
    """Two objectives: half of the points evenly in the second, the rest where neighbours are farthest apart."""
    high, low = found.values[0, 1], found.values[1, 1]
    found.traced(np.linspace(high, low, max(points // 2, 6) + 1)[1:-1])
    closed: set[tuple[float, ...]] = set()
    while True:
        _, values = found.front()
        if len(values) >= points:
            return
        gaps = np.linalg.norm(np.diff(values, axis=0), axis=1)
        open_gaps = [i for i in np.argsort(-gaps) if (*values[i], *values[i + 1]) not in closed and gaps[i] > 10 * SAME]
        if not open_gaps:
            return
        i = open_gaps[0]
        middle, along = (values[i] + values[i + 1]) / 2, np.abs(values[i + 1] - values[i])
        # First across the longer side; a front with a jump may have a point for one ε and none for the other.
        tries = [(1, np.array([middle[0], np.inf])), (0, np.array([np.inf, middle[1]]))]
        if not any(found.add(main, caps, cold=False) for main, caps in (tries if along[0] > along[1] else tries[::-1])):
            closed.add((*values[i], *values[i + 1]))


def _fill_grid(found: _Found, points: int) -> None:
    """Three objectives and more: a grid of ε between the ends for all but the first."""
    ideal, nadir = found.values.min(axis=0), found.values.max(axis=0)
    count = len(found.program.task.objectives)
    side = int(np.ceil((2.0 * points) ** (1.0 / (count - 1))))
    levels = [np.linspace(nadir[k], ideal[k], side + 1)[1:] for k in range(1, count)]
    for caps in itertools.product(*levels):
        found.add(0, np.array([np.inf, *caps]), cold=True)


def _apart(task: MotionTask, got: Polished) -> Int[np.ndarray, " kept"]:
    """Return one of every motion that several starts led to, the best first."""
    kept: list[int] = []
    for i in np.argsort(got.totals[:, 0], kind="stable").tolist():
        if not kept or distance(task, got.q[i], got.q[kept]).min() > APART:
            kept.append(i)
    return np.array(kept, dtype=int)


def _known(value: np.ndarray, others: np.ndarray) -> bool:
    return bool((np.abs(others - value).max(axis=1) <= 10 * SAME).any())
