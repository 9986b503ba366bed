"""Fronts of any program by ε-constraints: one objective minimised, the others kept below ε, from several starts each.

Source: Tringali & Cocuzza 2020, section 4.3, with inequalities in place of the printed equality, which returns
dominated points; Haimes et al. 1971.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Points
from paretoik.errors import SolverFailed
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.program import Program, Solver
from paretoik.nlp.solutions import Solutions
from paretoik.pareto.cold_search import ColdSearch, optima_alone
from paretoik.pareto.gap_filling import POINT_TOLERANCE, fill_gaps, front_rows, is_duplicate, spread_rows
from paretoik.pareto.refine import refine
from paretoik.pareto.scalarisation import Observe, main_weights, minimise_weighted, objective_sizes, ranges_of
from paretoik.pareto.warm_start import evaluate_points, feasible_points
from paretoik.stop_flag import Interrupted


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


def epsilon_points(
    program_of: Callable[[Float[np.ndarray, " n_obj"]], Program],
    cold: ColdSearch,
    n_obj: int,
    *,
    points: int,
    initial: Float[np.ndarray, " initial *point"] | None = None,
    solver: Solver = "auto",
    observe: Observe | None = None,
) -> tuple[Points, Float[np.ndarray, " n_obj"]]:
    """Return at most so many points, but all ends, spread over the front, and the ranges of the objectives.

    ``program_of`` returns the program with its objectives divided by its argument. First the ends, and what cold
    starts lead to below some ε; of two objectives every branch is then followed through falling and rising ε. The rest
    goes into the widest gaps: ε halfway between two neighbours, started from those near it. ``initial`` points within
    all limits lead to ends, branches and points as well: none of them dominates what is returned.

    After a signal the points so far are returned. Raises what ``cold`` does, SolverFailed where an end does not
    converge, and Interrupted where a signal comes before there is any point.
    """
    natural = program_of(np.ones(n_obj))
    initial = feasible_points(natural, initial)
    alone = list[Points]()
    with suppress(Interrupted):
        for k in range(n_obj):
            alone.append(optima_alone(program_of, cold, k, n_obj, initial, solver))
    if not alone:
        raise Interrupted
    best = np.stack([optima[0] for optima in alone])
    payoff = np.stack([natural.evaluate(x)[0][:n_obj] for x in best])
    sizes = objective_sizes(natural, best, n_obj)
    near = natural.distance(best[0], best) <= OPTIONS.resolved_distance
    if near.all() and (np.ptp(payoff, axis=0) <= OPTIONS.resolution * sizes).all():
        return best[:1], np.where(sizes > 0, sizes, 1.0)
    ranges = ranges_of(payoff, sizes)
    if len(alone) < n_obj:
        return best, ranges
    program = program_of(ranges)
    pool = np.concatenate([optima[: OPTIONS.pool] for optima in alone])
    try:
        ends = _ends(program, best, solver)
    except Interrupted:
        return best, ranges
    if initial is not None and len(initial):
        initial = refine(program, initial, n_obj, solver=solver)[0]
        pool = np.concatenate([pool, initial[: OPTIONS.pool]])
    sweep = _Sweep(
        program=program,
        n_obj=n_obj,
        x=ends.x,
        objectives=ends.objectives,
        pool=pool[_distinct_rows(program, pool)],
        points=points,
        solver=solver,
        observe=observe,
    )
    with suppress(Interrupted):
        if initial is not None and len(initial):
            sweep.add(evaluate_points(program, initial))
        for solutions in _inner_optima(program, cold, ends):
            sweep.pool = np.concatenate([sweep.pool, solutions.x])
            sweep.add(solutions)
        if n_obj == 2:  # half of the points along every branch, evenly in the second objective
            high, low = ends.objectives[0, 1], ends.objectives[1, 1]
            sweep.follow_branches(np.linspace(high, low, max(points // 2, 6) + 1)[1:-1])
        fill_gaps(lambda: sweep.front()[1], sweep.minimise_below, points)
        if cold.multimodal:
            sweep.exchange_basins()
    x, values = sweep.front()
    return x[spread_rows(values, points)], ranges


def _distinct_rows(program: Program, x: Points) -> Int[np.ndarray, " rows"]:
    """Return which points are farther than ``distinct`` from all before them."""
    rows = list[int]()
    for i, one in enumerate(x):
        if not rows or program.distance(one, x[rows]).min() > OPTIONS.distinct:
            rows.append(i)
    return np.array(rows, dtype=int)


def _ends(program: Program, best: Points, solver: Solver) -> Solutions:
    """Return the ends of the front: each objective at its best, the others as good as they can be there."""
    count = len(best)

    def solve(x: Points, weight: float | np.ndarray, barrier: InteriorPointOptions) -> tuple[Solutions, np.ndarray]:
        weights = main_weights(count, np.arange(count), weight)
        solutions = minimise_weighted(program, x, weights, None, barrier, solver=solver)
        merit = np.sum(weights * solutions.objectives[:, :count], axis=1)
        return solutions, np.where(solutions.converged, merit, np.inf)

    ends, merit = solve(best, OPTIONS.end_tolerance, OPTIONS.warm)
    for barrier in (OPTIONS.near, OPTIONS.cold):
        again, new_merit = solve(best, OPTIONS.end_tolerance, barrier)
        better = new_merit < merit - POINT_TOLERANCE
        ends, merit = ends.replace_rows(better, again[better]), np.where(better, new_merit, merit)
    weight = OPTIONS.end_tolerance
    while not ends.converged.all() and weight < OPTIONS.end_weight:  # a flat valley, steeper with more of the others
        weight *= 10.0
        again, _ = solve(best, weight, OPTIONS.cold)
        missing = ~ends.converged & again.converged
        ends = ends.replace_rows(missing, again[missing])
    if not ends.converged.all():
        failed = program.objective_names[int(np.argmin(ends.converged))]
        raise SolverFailed(f"the end of the front where {failed} is best wanted to converge, but did not")
    weights = np.full(count, OPTIONS.end_weight)
    for _ in range(2):  # how much an objective gives way grows with the square of the others' weight
        finished = solve(ends.x, weights, OPTIONS.warm)[0]
        loss = np.diagonal(finished.objectives) - np.diagonal(ends.objectives)
        weights = weights * np.sqrt(OPTIONS.end_tolerance / np.maximum(loss, OPTIONS.end_tolerance)) / 2
        accepted = finished.converged & (loss <= OPTIONS.end_tolerance)
        if accepted.all():
            break
    return ends.replace_rows(accepted, finished[accepted])


def _inner_optima(program: Program, cold: ColdSearch, ends: Solutions) -> list[Solutions]:
    """Return the optima that cold starts lead to below some ε: a branch may belong to no objective's own optimum."""
    count = len(ends)
    ideal, nadir = ends.objectives[:, :count].min(axis=0), ends.objectives[:, :count].max(axis=0)
    batches = []
    for share in OPTIONS.inner if count == 2 else OPTIONS.inner[1:2]:
        for main in range(count):
            upper = np.where(np.arange(count) == main, np.inf, nadir + share * (ideal - nadir))
            solutions = cold.optima_below(program, main, upper, OPTIONS.weight)
            if solutions is not None:
                batches.append(solutions[solutions.converged][: OPTIONS.pool])
    return batches


@dataclass(kw_only=True, eq=False)
class _Sweep:
    """The points so far with their objectives, and how more are added; ``pool`` are starts of branches."""

    program: Program
    n_obj: int
    x: Points
    objectives: Float[np.ndarray, "points objectives"]
    pool: Float[np.ndarray, " pool *point"]
    points: int
    solver: Solver
    observe: Observe | None

    def add(self, solutions: Solutions) -> None:
        """Add points, whether they are part of the front or not."""
        self.x = np.concatenate([self.x, solutions.x])
        self.objectives = np.concatenate([self.objectives, solutions.objectives])
        self._show()

    def _show(self, *_: int) -> None:
        if self.observe is not None:
            self.observe(min(len(self.front()[0]), self.points), self.points)

    def _minimise(self, x: Points, weights: np.ndarray, upper: np.ndarray, barrier: InteriorPointOptions) -> Solutions:
        return minimise_weighted(
            self.program, x, weights, upper, barrier, solver=self.solver, batch=OPTIONS.batch, observe=self._show
        )

    def front(self) -> tuple[Points, Float[np.ndarray, "front n_obj"]]:
        """Return the points that no other dominates, by the first objective."""
        values = self.objectives[:, : self.n_obj]
        rows = front_rows(values)
        return self.x[rows], values[rows]

    def minimise_below(self, main: int, upper: Float[np.ndarray, " n_obj"]) -> bool:
        """Minimise objective ``main`` below ``upper`` from the nearest points; return whether that is a new one."""
        values = self.objectives[:, : self.n_obj]
        off = np.abs(values - np.where(np.isfinite(upper), upper, values)).max(axis=1)
        starts = self.x[np.argsort(off, kind="stable")[: OPTIONS.nearest]]
        weights = main_weights(self.n_obj, np.array([main]), OPTIONS.weight)
        solutions = self._minimise(starts, weights, upper[None], OPTIONS.warm)
        best = int(np.argmin(np.where(solutions.converged, solutions.objectives[:, main], np.inf)))
        if not solutions.converged[best] or is_duplicate(solutions.objectives[best], self.objectives):
            return False
        self.add(solutions[best : best + 1])
        return True

    def follow_branches(self, levels: Float[np.ndarray, " levels"]) -> None:
        """Follow every optimum of the pool as its own branch, through falling and through rising ε of objective two.

        Two objectives. A branch that is dominated here may be the best one there: all solutions are added.
        """
        second = np.array([self.program.evaluate(x)[0][1] for x in self.pool])
        falling, rising = levels[:, None], levels[::-1, None]
        within = second >= falling, second <= rising
        joins = [np.where(each.any(axis=0), each.argmax(axis=0), len(levels)) for each in within]
        x = [self.pool[:0], self.pool[:0]]
        barrier = OPTIONS.warm._replace(iterations=OPTIONS.branch_iterations)
        weights = main_weights(2, np.array([0]), OPTIONS.weight)
        for step, both in enumerate(zip(levels, levels[::-1], strict=True)):
            x = [np.concatenate([old, self.pool[join == step]]) for old, join in zip(x, joins, strict=True)]
            counts = [len(each) for each in x]
            upper = np.stack([np.full(sum(counts), np.inf), np.repeat(both, counts)], axis=1)
            solutions = self._minimise(np.concatenate(x), weights, upper, barrier)
            for direction, part in enumerate((solutions[: counts[0]], solutions[counts[0] :])):
                branches = part[part.converged]
                branches = branches[np.argsort(branches.objectives[:, 0], kind="stable")]
                branches = branches[_distinct_rows(self.program, branches.x)]
                self.add(branches)
                x[direction] = branches.x

    def exchange_basins(self) -> None:
        """Try for every point of the front whether its neighbours' basins hold one that is better in everything.

        Where there are many valleys, a neighbour that came later may lie in a better one.
        """
        options = OPTIONS.warm._replace(iterations=OPTIONS.branch_iterations)
        tried = np.zeros((0, 2), dtype=int)
        for _ in range(OPTIONS.rounds):
            pairs = self._neighbours()
            pairs = pairs[~(pairs[:, None] == tried).all(axis=2).any(axis=1)]
            if not len(pairs):
                return
            tried = np.concatenate([tried, pairs])
            upper = self.objectives[pairs[:, 0], : self.n_obj]
            solutions = self._minimise(self.x[pairs[:, 1]], np.ones((1, self.n_obj)), upper, options)
            gain = np.sum(upper - solutions.objectives[:, : self.n_obj], axis=1)
            better = solutions.converged & (gain > 10 * POINT_TOLERANCE)
            if not better.any():
                return
            self.add(solutions[better])

    def _neighbours(self) -> Int[np.ndarray, "pairs 2"]:
        """Return pairs of rows: every point that spreads over the front, and one of the nearest others of these."""
        rows = front_rows(self.objectives[:, : self.n_obj])
        rows = rows[spread_rows(self.objectives[rows, : self.n_obj], self.points)]
        values = self.objectives[rows, : self.n_obj]
        distances = np.linalg.norm(values[:, None] - values, axis=2)
        np.fill_diagonal(distances, np.inf)
        near = np.argsort(distances, axis=1)[:, : min(OPTIONS.neighbours, len(rows) - 1)]
        return np.stack([np.repeat(rows, near.shape[1]), rows[near.ravel()]], axis=1)
