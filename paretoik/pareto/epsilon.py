"""Fronts of any program by ε-constraints: one objective minimised, the others kept below ε, from several starts each.

Source: Tringali & Cocuzza 2020, section 4.3, with inequalities in place of the printed equality, which returns
dominated points; Haimes et al. 1971.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Points
from paretoik.errors import SolverFailed
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import Program, Solver
from paretoik.nlp.solutions import Solutions, concatenate
from paretoik.pareto.cold_search import ColdSearch
from paretoik.pareto.gap_filling import POINT_TOLERANCE, fill_gaps, front_rows, known, spread_rows
from paretoik.pareto.ranges import objective_sizes, ranges_of

Observe = Callable[[int, int], object]


@dataclass(frozen=True, kw_only=True)
class EpsilonOptions:
    """How a front is swept; objectives are divided by their ranges, so that values here are shares of these.

    ``end_tolerance`` is what an objective gives way for the others at an end of the front, ``end_weight`` the weight of
    the others there at first; ``weight`` theirs at any ε: with none a point may be only weakly optimal. ``inner`` are
    the places between nadir and ideal where cold starts are led below an ε. Every ε starts from the ``nearest`` points.
    Of each objective so many optima are followed as branches as ``pool`` says; one that takes more than
    ``branch_iterations`` to the next level has ended. Each point tries the basins of its ``neighbours``, in at most so
    many ``rounds``. So many points are led at a time as ``batch`` says. Points nearer than ``distinct`` (rad or m, RMS)
    are one. Where the ends are within ``resolved_distance`` (rad or m, RMS) and ``resolution`` of every objective's
    size, the front is one point: that is what a solver's last barrier leaves open.

    The barriers: ``warm`` from a point near by; ``cold`` and ``near`` where ends are tried once more: from a flat
    valley one may get lost, or find a better one.
    """

    end_tolerance: float = 1e-6
    end_weight: float = 1e-3
    weight: float = 5e-4
    inner: tuple[float, ...] = (0.25, 0.5, 0.75)
    nearest: int = 4
    pool: int = 4
    branch_iterations: int = 60
    neighbours: int = 2
    rounds: int = 3
    batch: int = 8
    distinct: float = 0.01
    resolution: float = 1e-7
    resolved_distance: float = 1e-3
    warm: InteriorPointOptions = InteriorPointOptions(barrier=1e-4, radius=0.02)
    near: InteriorPointOptions = InteriorPointOptions(barrier=1e-6, radius=0.02)
    cold: InteriorPointOptions = InteriorPointOptions(barrier=0.1, radius=0.2)


OPTIONS = EpsilonOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class EpsilonPoints:
    """Points of a front with their objectives, minimised, and the ranges that these were divided by on the way."""

    x: Points
    objectives: Float[np.ndarray, "points n_obj"]
    ranges: Float[np.ndarray, " n_obj"]


def epsilon_points(
    program_of: Callable[[Float[np.ndarray, " n_obj"]], Program],
    cold: ColdSearch,
    n_obj: int,
    *,
    points: int,
    solver: Solver = "auto",
    observe: Observe | None = None,
    options: EpsilonOptions = OPTIONS,
) -> EpsilonPoints:
    """Return at most so many points, but all ends, spread over the front, and the ranges of the objectives.

    ``program_of`` returns the program with its objectives divided by what it is given. First the ends, and what cold
    starts lead to below some ε; of two objectives every branch is then followed through falling and rising ε. The rest
    goes into the widest gaps: ε halfway between two neighbours, started from those near it. ``observe`` is called with
    points found and wanted.

    Raises what ``cold`` does, and SolverFailed where an end does not converge.
    """
    natural = program_of(np.ones(n_obj))
    alone = [cold.optima(k) for k in range(n_obj)]
    best = np.stack([optima[0] for optima in alone])
    payoff = np.stack([natural.evaluate(x)[0][:n_obj] for x in best])
    sizes = objective_sizes(natural, best, n_obj)
    near = natural.distance(best[0], best) <= options.resolved_distance
    if near.all() and (np.ptp(payoff, axis=0) <= options.resolution * sizes).all():
        return EpsilonPoints(x=best[:1], objectives=payoff[:1], ranges=np.where(sizes > 0, sizes, 1.0))
    ranges = ranges_of(payoff, sizes)
    program = program_of(ranges)
    pool = np.concatenate([optima[: options.pool] for optima in alone])
    pool = pool[_distinct_rows(program, pool, options)]
    ends = _ends(program, best, solver, options)
    sweep = _Sweep(program, pool, ends, points, solver, observe, options)
    for solutions in _inner(program, cold, ends, options):
        sweep.pool = np.concatenate([sweep.pool, solutions.x])
        sweep.add(solutions)
    if n_obj == 2:  # half of the points along every branch, evenly in the second objective
        high, low = ends.objectives[0, 1], ends.objectives[1, 1]
        sweep.follow_branches(np.linspace(high, low, max(points // 2, 6) + 1)[1:-1])
    fill_gaps(lambda: sweep.front()[1], sweep.minimise_below, points)
    if cold.multimodal:
        sweep.exchange_basins()
    x, values = sweep.front()
    rows = spread_rows(values, points)
    return EpsilonPoints(x=x[rows], objectives=values[rows] * ranges, ranges=ranges)


def _distinct_rows(program: Program, x: Points, options: EpsilonOptions) -> Int[np.ndarray, " rows"]:
    """Return which points are farther than ``distinct`` from all before them."""
    rows = list[int]()
    for i, one in enumerate(x):
        if not rows or program.distance(one, x[rows]).min() > options.distinct:
            rows.append(i)
    return np.array(rows, dtype=int)


def _factors(program: Program, n_obj: int, main: int | np.ndarray, weight: float | np.ndarray) -> np.ndarray:
    """Return weights (rows, objectives): 1 for the main objective of each row, ``weight`` for the others."""
    mains = np.atleast_1d(main)
    factors = np.zeros((len(mains), len(program.upper)))
    factors[:, :n_obj] = np.asarray(weight)[..., None]
    factors[np.arange(len(mains)), mains] = 1.0
    return factors


def _bounds(program: Program, upper: Float[np.ndarray, "rows n_obj"]) -> np.ndarray:
    bounds = np.full((len(upper), len(program.upper)), np.inf)
    bounds[:, : upper.shape[1]] = upper
    return bounds


def _ends(program: Program, best: Points, solver: Solver, options: EpsilonOptions) -> Solutions:
    """Return the ends of the front: each objective at its best, the others as good as they can be there."""
    count = len(best)
    mains = np.arange(count)
    factors = _factors(program, count, mains, options.end_tolerance)
    ends = minimise(program, best, factors, options=options.warm, solver=solver)
    for barrier in (options.near, options.cold):
        again = minimise(program, best, factors, options=barrier, solver=solver)
        merits = [np.where(each.converged, np.sum(factors * each.objectives, axis=1), np.inf) for each in (ends, again)]
        better = merits[1] < merits[0] - POINT_TOLERANCE
        ends = ends.replace_rows(better, again[better])
    if not ends.converged.all():
        failed = program.objective_names[int(np.argmin(ends.converged))]
        raise SolverFailed(f"the end of the front where {failed} is best wanted to converge, but did not")
    weight = np.full(count, options.end_weight)
    for _ in range(2):  # how much an objective gives way grows with the square of the others' weight
        finished = minimise(
            program, ends.x, _factors(program, count, mains, weight), options=options.warm, solver=solver
        )
        loss = np.diagonal(finished.objectives) - np.diagonal(ends.objectives)
        weight = weight * np.sqrt(options.end_tolerance / np.maximum(loss, options.end_tolerance)) / 2
        accepted = finished.converged & (loss <= options.end_tolerance)
        if accepted.all():
            break
    return ends.replace_rows(accepted, finished[accepted])


def _inner(program: Program, cold: ColdSearch, ends: Solutions, options: EpsilonOptions) -> list[Solutions]:
    """Return the optima that cold starts lead to below some ε: a branch may belong to no objective's own optimum."""
    count = len(ends)
    ideal, nadir = ends.objectives[:, :count].min(axis=0), ends.objectives[:, :count].max(axis=0)
    batches = []
    for share in options.inner if count == 2 else options.inner[1:2]:
        for main in range(count):
            upper = np.where(np.arange(count) == main, np.inf, nadir + share * (ideal - nadir))
            solutions = cold.optima_below(program, main, upper, options.weight)
            if solutions is not None:
                batches.append(solutions[solutions.converged][: options.pool])
    return batches


class _Sweep:
    """The points so far, and how one more is found."""

    def __init__(
        self,
        program: Program,
        pool: Points,
        ends: Solutions,
        wanted: int,
        solver: Solver,
        observe: Observe | None,
        options: EpsilonOptions,
    ) -> None:
        self.program, self.pool, self.n_obj, self.wanted = program, pool, len(ends), wanted
        self.x, self.objectives = ends.x, ends.objectives
        self.solver, self.observe, self.options = solver, observe, options

    def add(self, solutions: Solutions) -> None:
        """Keep points: whether they are part of the front is seen later."""
        self.x = np.concatenate([self.x, solutions.x])
        self.objectives = np.concatenate([self.objectives, solutions.objectives])
        self._show()

    def _show(self) -> None:
        if self.observe is not None:
            self.observe(min(len(self.front()[0]), self.wanted), self.wanted)

    def _minimise(self, x: Points, factors: np.ndarray, upper: np.ndarray, barrier: InteriorPointOptions) -> Solutions:
        """Minimise from points, a batch at a time: in between somebody may look."""
        parts, upper = list[Solutions](), np.broadcast_to(upper, (len(x), upper.shape[1]))
        for first in range(0, max(len(x), 1), self.options.batch):
            rows = slice(first, first + self.options.batch)
            parts.append(minimise(self.program, x[rows], factors, upper[rows], barrier, solver=self.solver))
            self._show()
        return concatenate(parts)

    def front(self) -> tuple[Points, Float[np.ndarray, "front n_obj"]]:
        """Return the points that no other dominates, by the first objective."""
        values = self.objectives[:, : self.n_obj]
        rows = front_rows(values)
        return self.x[rows], values[rows]

    def minimise_below(self, main: int, upper: Float[np.ndarray, " n_obj"]) -> bool:
        """Minimise objective ``main`` below ``upper`` from the nearest points; return whether that is a new one."""
        best = self._best_below(main, upper)
        if best is None or known(best.objectives[0], self.objectives):
            return False
        self.add(best)
        return True

    def _best_below(self, main: int, upper: np.ndarray) -> Solutions | None:
        starts = self.x[self._nearest(upper)]
        factors = _factors(self.program, self.n_obj, main, self.options.weight)
        bounds = _bounds(self.program, upper[None])
        solutions = self._minimise(starts, factors, bounds, self.options.warm)
        if not solutions.converged.any():
            return None
        best = int(np.argmin(np.where(solutions.converged, solutions.objectives[:, main], np.inf)))
        return solutions[best : best + 1]

    def _nearest(self, upper: np.ndarray) -> Int[np.ndarray, " nearest"]:
        values = self.objectives[:, : self.n_obj]
        off = np.abs(values - np.where(np.isfinite(upper), upper, values)).max(axis=1)
        return np.argsort(off, kind="stable")[: self.options.nearest]

    def follow_branches(self, levels: Float[np.ndarray, " levels"]) -> None:
        """Follow every optimum of the pool as its own branch, through falling and through rising ε of objective two.

        Two objectives. A branch that is dominated here may be the best one there: all that is found is kept.
        """
        second = np.array([self.program.evaluate(x)[0][1] for x in self.pool])
        falling, rising = levels[:, None], levels[::-1, None]
        within = second >= falling, second <= rising
        joins = [np.where(each.any(axis=0), each.argmax(axis=0), len(levels)) for each in within]
        x = [self.pool[:0], self.pool[:0]]
        options = self.options.warm._replace(iterations=self.options.branch_iterations)
        for step, both in enumerate(zip(levels, levels[::-1], strict=True)):
            x = [np.concatenate([old, self.pool[join == step]]) for old, join in zip(x, joins, strict=True)]
            counts = [len(each) for each in x]
            upper = _bounds(self.program, np.stack([np.full(sum(counts), np.inf), np.repeat(both, counts)], axis=1))
            factors = _factors(self.program, 2, 0, self.options.weight)
            solutions = self._minimise(np.concatenate(x), factors, upper, options)
            for way, part in enumerate((solutions[: counts[0]], solutions[counts[0] :])):
                branches = part[part.converged]
                branches = branches[np.argsort(branches.objectives[:, 0], kind="stable")]
                branches = branches[_distinct_rows(self.program, branches.x, self.options)]
                self.add(branches)
                x[way] = branches.x

    def exchange_basins(self) -> None:
        """Try for every point of the front whether its neighbours' basins hold one that is better in everything.

        Where there are many valleys, a neighbour that came later may lie in a better one.
        """
        for _ in range(self.options.rounds):
            x, values = self.front()
            rows = spread_rows(values, self.wanted)
            x, values = x[rows], values[rows]
            if len(x) < 2:
                return
            off = np.linalg.norm(values[:, None] - values[None], axis=2) + np.where(np.eye(len(x)) > 0, np.inf, 0.0)
            near = np.argsort(off, axis=1)[:, : min(self.options.neighbours, len(x) - 1)]
            factors = np.zeros((1, len(self.program.upper)))
            factors[0, : self.n_obj] = 1.0
            upper = _bounds(self.program, np.repeat(values, near.shape[1], axis=0))
            solutions = self._minimise(x[near.ravel()], factors, upper, self.options.warm)
            before = np.repeat(values.sum(axis=1), near.shape[1])
            gain = before - solutions.objectives[:, : self.n_obj].sum(axis=1)
            better = solutions.converged & (gain > 10 * POINT_TOLERANCE)
            if not better.any():
                return
            self.add(solutions[better])
