"""Fronts by ε-constraints: one objective minimised, the others kept below ε, from several starts for every ε.

Source: Tringali & Cocuzza 2020, section 4.3, with inequalities in place of the printed equality, which returns
dominated points; Haimes et al. 1971.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from paretoik.errors import Infeasible, SolverFailed
from paretoik.nlp.compiled.interior_point import Rules
from paretoik.nlp.program import Solver
from paretoik.nlp.solutions import Solutions, concatenate
from paretoik.pareto.gap_filling import SAME, fill_gaps, front_rows, known, spread_rows
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.initial_motions import initial_motions
from paretoik.trajectory.levels import OPTIONS as LEVELS
from paretoik.trajectory.levels import level_programs, refine_levels
from paretoik.trajectory.plan import find_optima
from paretoik.trajectory.polish import check_solver, polish
from paretoik.trajectory.transcription import MotionProgram, joint_distance, motion_program

YIELD = 1e-6  # of its range: what an objective gives way for the others at an end of the front
WEIGHT = 5e-4  # of the other objectives at a given ε: with none, a point may be only weakly optimal
FIRST_WEIGHT = 1e-3  # of the others at an end, as far as it gives way by no more than that
NEAREST = 4  # points whose motions every ε starts from
SETTLING, BESIDE = 3, 2  # rounds at most in which points try motions of so many neighbours
INNER = (0.25, 0.5, 0.75)  # of the way from nadir to ideal: ε with cold starts of their own
TOGETHER = 16  # motions polished at once, in between somebody may look
POOL = 4  # optima of each objective that every ε starts from
COLD, WARM = Rules(barrier=0.1, radius=0.2), Rules(barrier=1e-4, radius=0.02)
NEAR = Rules(barrier=1e-6, radius=0.02)
FOLLOWING = WARM._replace(iterations=60)  # a branch that takes longer to the next level has ended


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
    solver: Solver = "auto",
) -> Points:
    """Return at least two and at most about ``points`` motions spread over the front, its ends among them.

    First the ends, and what many starts lead to below some ε; of two objectives every branch is then followed through
    falling and rising ε. The rest goes into the widest gaps: ε halfway between two neighbours, started from those near
    it. ``observe`` is called with points found and wanted.

    Raises as ``find_optima`` does.
    """
    check_solver(task, solver)
    pool, best, ranges = _alone(task, starts=starts, seed=seed, solver=solver)
    programs = level_programs(task, ranges, solver)
    ends = _ends(programs[-1], best)
    between = _between(programs, initial_motions(task, starts=-(-starts // 2), seed=seed), ends)
    found = _Found(programs[-1], np.concatenate([pool, *(got.x for got in between)]), ends, ranges, observe, points)
    for got in between:
        found.add_all(got)
    if len(ranges) == 2:  # half of the points along every branch, evenly in the second objective
        high, low = found.values[0, 1], found.values[1, 1]
        found.traced(np.linspace(high, low, max(points // 2, 6) + 1)[1:-1])
    fill_gaps(lambda: found.front()[1], found.add, points)
    if task.redundancy > 1:
        _settle(found, points)
    q, values = found.front()
    kept = spread_rows(values, points)
    return Points(q=q[kept], values=values[kept] * ranges, ranges=ranges)


class _Found:
    """The points so far, and how one more is found."""

    def __init__(
        self,
        program: MotionProgram,
        pool: np.ndarray,
        ends: Solutions,
        ranges: np.ndarray,
        observe: Callable[[int, int], object] | None,
        wanted: int,
    ) -> None:
        self.program, self.pool, self.ranges = program, pool, ranges
        self.q, self.values = ends.x, ends.objectives
        self.observe, self.wanted = observe, wanted

    def add(self, main: int, caps: np.ndarray) -> bool:
        """Minimise objective ``main`` below caps from the nearest points; return whether that is a new one."""
        got = self._best(main, caps, self._nearest(caps))
        if got is None or known(got.objectives[0], self.values):
            return False
        self.add_all(got)
        return True

    def traced(self, levels: np.ndarray) -> None:
        """Follow every optimum of the pool as its own branch, through falling and through rising ε of objective two.

        Two objectives. A branch that is dominated here may be the best one there: all that is found is kept.
        """
        task, factors = self.program.task, np.zeros((1, len(self.program.totals)))
        factors[0, :2] = 1.0, WEIGHT
        own = np.asarray(task.objectives[1](task.motion(self.pool))) * task.objectives[1].sign / self.ranges[1]
        falling, rising = levels[:, None], levels[::-1, None]
        within = own >= falling, own <= rising
        joins = [np.where(each.any(axis=0), each.argmax(axis=0), len(levels)) for each in within]
        q = [self.pool[:0], self.pool[:0]]
        for step, both in enumerate(zip(levels, levels[::-1], strict=True)):
            q = [np.concatenate([old, self.pool[join == step]]) for old, join in zip(q, joins, strict=True)]
            caps = np.full((len(q[0]) + len(q[1]), len(self.program.totals)), np.inf)
            caps[:, 1] = np.repeat(both, [len(q[0]), len(q[1])])
            got = polish(self.program, np.concatenate(q), factors, caps, FOLLOWING)
            for way, part in enumerate((got[: len(q[0])], got[len(q[0]) :])):
                kept = part[part.converged]
                kept = kept[_apart(task, kept)]
                self.add_all(kept)
                q[way] = kept.x

    def add_all(self, got: Solutions) -> None:
        """Keep points: whether they are part of the front is seen later."""
        self.q = np.concatenate([self.q, got.x])
        self.values = np.concatenate([self.values, got.objectives])
        if self.observe is not None:
            self.observe(len(self.front()[0]), self.wanted)

    def _nearest(self, caps: np.ndarray) -> np.ndarray:
        values = self.values[:, : len(caps)]
        apart = np.abs(values - np.where(np.isfinite(caps), caps, values)).max(axis=1)
        return np.argsort(apart, kind="stable")[:NEAREST]

    def _best(self, main: int, caps: np.ndarray, nearest: np.ndarray) -> Solutions | None:
        """Return the best motion below caps that these points' motions lead to."""
        factors, below = np.zeros((1, len(self.program.totals))), np.full((1, len(self.program.totals)), np.inf)
        factors[0, : len(caps)] = WEIGHT
        factors[0, main] = 1.0
        below[0, : len(caps)] = caps
        got = polish(self.program, self.q[nearest], factors, below, WARM)
        if not got.converged.any():
            return None
        best = int(np.argmin(np.where(got.converged, got.objectives[:, main], np.inf)))
        return got[best : best + 1]

    def front(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the points that no other dominates, by the first objective."""
        values = self.values[:, : len(self.program.task.objectives)]
        kept = front_rows(values)
        return self.q[kept], values[kept]


def polished_points(
    task: MotionTask,
    q: Float[np.ndarray, "points time dof"],
    ranges: np.ndarray,
    observe: Callable[[int, int], object] | None = None,
    solver: Solver = "auto",
) -> Solutions:
    """Return motions that are at least as good as given ones in every objective, each from its own given motion.

    The first objective is minimised, the others may not rise. ``sums`` are divided by the ranges. ``observe`` is called
    with motions done and wanted; where it returns true, the rest is left out.

    Raises InvalidInput where an objective or a limit has no derivative, or a kink for interior points.
    """
    check_solver(task, solver)
    program, count = motion_program(task, ranges, solver), len(ranges)
    motions = task.motion(q)
    values = np.stack([o(motions) * o.sign for o in task.objectives], axis=1) / ranges
    factors, caps = np.zeros((1, len(program.totals))), np.full((len(q), len(program.totals)), np.inf)
    factors[0, :count] = [1.0, *[YIELD] * (count - 1)]
    caps[:, 1:count] = values[:, 1:]
    parts = list[Solutions]()
    for first in range(0, len(q), TOGETHER):
        rows = slice(first, first + TOGETHER)
        found = polish(program, q[rows], factors, caps[rows], WARM)
        again = ~found.converged
        if again.any():
            found = found.replace_rows(again, polish(program, q[rows][again], factors, caps[rows][again], COLD))
        parts.append(found)
        if observe is not None and observe(min(first + TOGETHER, len(q)), len(q)):
            break
    return concatenate(parts)


def _alone(task: MotionTask, *, starts: int, seed: int, solver: Solver) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (motions to start from, the best of each objective alone, ranges of the objectives)."""
    pool, best = [], []
    for objective in task.objectives:
        plan = find_optima(replace(task, objectives=(objective,)), starts=starts, seed=seed, solver=solver)
        pool += [optimum.motion.q for optimum in plan.optima[:POOL]]
        best.append(plan.best.motion.q)
    motions = task.motion(np.stack(best))
    signs = np.array([o.sign for o in task.objectives])
    payoff = np.stack([o(motions) for o in task.objectives], axis=1) * signs
    ideal, nadir = payoff.min(axis=0), payoff.max(axis=0)
    wide = nadir - ideal > 1e-9 * np.maximum(np.abs(ideal), np.abs(nadir))
    ranges = np.where(wide, nadir - ideal, np.maximum(np.abs(ideal), 1.0))
    unique: list[np.ndarray] = []
    for q in pool:
        if not unique or joint_distance(task, q, np.stack(unique)).min() > LEVELS.distinct:
            unique.append(q)
    return np.stack(unique), np.stack(best), ranges


def _ends(program: MotionProgram, best: Float[np.ndarray, "n_obj time dof"]) -> Solutions:
    """Return the ends of the front: each objective at its best, the others as good as they can be there."""
    count = len(best)
    factors = np.zeros((count, len(program.totals)))
    factors[:, :count] = np.where(np.eye(count) > 0, 1.0, YIELD)
    ends = polish(program, best, factors, rules=WARM)
    for rules in (NEAR, COLD):  # from a flat valley one may get lost, or find a better one
        other = polish(program, best, factors, rules=rules)
        worth = [np.where(one.converged, np.sum(factors * one.objectives, axis=1), np.inf) for one in (ends, other)]
        better = worth[1] < worth[0] - SAME
        ends = ends.replace_rows(better, other[better])
    if not ends.converged.all():
        failed = program.task.objectives[int(np.argmin(ends.converged))].name
        raise SolverFailed(f"the end of the front where {failed} is best wanted to converge, but did not")
    own, weight = np.eye(count) > 0, np.full(count, FIRST_WEIGHT)
    for _ in range(2):  # how much an objective gives way grows with the square of the others' weight
        factors[:, :count] = np.where(own, 1.0, weight[:, None])
        finished = polish(program, ends.x, factors, rules=WARM)
        given = np.diagonal(finished.objectives) - np.diagonal(ends.objectives)
        weight = weight * np.sqrt(YIELD / np.maximum(given, YIELD)) / 2
        kept = finished.converged & (given <= YIELD)
        if kept.all():
            break
    return ends.replace_rows(kept, finished[kept])


def _between(programs: Sequence[MotionProgram], cold: np.ndarray, ends: Solutions) -> list[Solutions]:
    """Return the optima that many starts lead to below some ε: a branch may belong to no objective's own optimum."""
    count = len(programs[-1].task.objectives)
    ideal, nadir = ends.objectives[:, :count].min(axis=0), ends.objectives[:, :count].max(axis=0)
    found = []
    for share in INNER if count == 2 else INNER[1:2]:
        for main in range(count):
            caps = nadir + share * (ideal - nadir)
            caps[main] = np.inf
            factors = np.full(count, WEIGHT)
            factors[main] = 1.0
            with suppress(Infeasible):  # where all that is found leaves the path, this ε adds nothing
                got, _ = refine_levels(programs, cold, factors, caps)
                found.append(got[got.converged][:POOL])
    return found


def _settle(found: _Found, points: int) -> None:
    """Try for every point of the front whether the motions of its neighbours lead to one that is better in everything.

    Where the self-motion has several dimensions its valleys are many, and a neighbour that came later may lie in a
    better one.
    """
    for _ in range(SETTLING):
        q, values = found.front()
        kept = spread_rows(values, points)
        q, values = q[kept], values[kept]
        if len(q) < 2:
            return
        apart = np.linalg.norm(values[:, None] - values[None], axis=2)
        near = np.argsort(apart + np.where(np.eye(len(q)) > 0, np.inf, 0.0), axis=1)[:, : min(BESIDE, len(q) - 1)]
        factors = np.zeros((1, len(found.program.totals)))
        factors[0, : values.shape[1]] = 1.0
        caps = np.full((near.size, len(found.program.totals)), np.inf)
        caps[:, : values.shape[1]] = np.repeat(values, near.shape[1], axis=0)
        got = polish(found.program, q[near.ravel()], factors, caps, WARM)
        gained = np.repeat(values.sum(axis=1), near.shape[1]) - got.objectives[:, : values.shape[1]].sum(axis=1)
        better = got.converged & (gained > 10 * SAME)
        if not better.any():
            return
        found.add_all(got[better])


def _apart(task: MotionTask, got: Solutions) -> Int[np.ndarray, " kept"]:
    """Return one of every motion that several starts led to, the best first."""
    kept: list[int] = []
    for i in np.argsort(got.objectives[:, 0], kind="stable").tolist():
        if not kept or joint_distance(task, got.x[i], got.x[kept]).min() > LEVELS.distinct:
            kept.append(i)
    return np.array(kept, dtype=int)
