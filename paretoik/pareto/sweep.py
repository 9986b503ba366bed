"""A sweep of ε-constraints: the points so far, and how more are added where the front gains the most."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise, product
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Point, Points
from paretoik.nlp.program import InteriorPointOptions, Program, Solutions, Solver, concatenate
from paretoik.pareto.placement import (
    POINT_TOLERANCE,
    Gap,
    Target,
    best_rows,
    fill_gaps,
    front_rows,
    gap_between,
    hull_pairs,
    is_duplicate,
    next_targets,
    spread_rows,
)
from paretoik.pareto.scalarisation import ColdSearch, Observe, main_weights, minimise_weighted
from paretoik.runs.distribution import workers

# How fronts are swept by ε-constraints.


@dataclass(frozen=True, kw_only=True)
class EpsilonOptions:
    """How a front is swept; objectives are divided by their ranges, so that values here are shares of these.

    ``end_tolerance`` is what an objective gives way for the others at an end of the front, ``end_weight`` the weight of
    the others there at first. Where a range of the ends is ``narrower`` than that of the objectives' own optima, by so
    much of it, they are sought once more with objectives divided by the ends' ranges. ``weight`` is that of the others
    at any ε: with none a point may be only weakly optimal. Where the ends are within ``resolved_distance`` (rad or
    lengths of the arm, RMS) and ``resolution`` of every objective's size, the front is one point: that is what a
    solver's last barrier leaves open.

    Of two objectives the first ``cold_points`` are sought from cold starts too, as a branch may belong to no
    objective's own optimum, and the best ``cold_optima`` of each search looked at. The second neighbour's motion is a
    start where that of the nearer one ``falls_short`` of the expected gain, by a share of it. So many points more than
    wanted are solved at most as ``further`` says, or ``further_share`` of these. Bounds of points are at even places of
    a gap, ``grid`` in number. Of more objectives each is sought from cold starts once, at ``inner``
    between nadir and ideal, and every ε starts from the ``nearest`` points. Each point tries the basins of its
    ``neighbours``, in at most so many ``rounds`` of ``basin_iterations`` each. So many points are minimised at a time
    as ``batch`` says.

    The barriers: ``warm`` from a point near by; ``cold`` and ``near`` where ends are tried once more: from a flat
    valley one may get lost, or find a better one.
    """

    end_tolerance: float = 1e-6
    end_weight: float = 1e-3
    narrower: float = 0.5
    weight: float = 5e-4
    cold_points: int = 3
    cold_optima: int = 4
    inner: float = 0.5
    falls_short: float = 0.02
    further: int = 4
    further_share: float = 0.5
    grid: int = 256
    nearest: int = 4
    neighbours: int = 2
    rounds: int = 3
    basin_iterations: int = 60
    batch: int = 8
    resolution: float = 1e-7
    resolved_distance: float = 1e-3
    warm: InteriorPointOptions = InteriorPointOptions(barrier=1e-4, radius=0.02)
    near: InteriorPointOptions = InteriorPointOptions(barrier=1e-6, radius=0.02)
    cold: InteriorPointOptions = InteriorPointOptions(barrier=0.1, radius=0.2)


OPTIONS = EpsilonOptions()


# Levels of ε, each minimised when its turn comes, or by workers ahead of that.
#
# A sweep is sequential: where a level goes depends on those before. It often can be foretold, and as what a level
# leads to follows from the level alone, workers may be there first: the sweep comes to the same, bit for bit.


Key: TypeAlias = tuple[bytes, int, bytes, InteriorPointOptions]


class Level(NamedTuple):
    """The objective ``main`` is minimised from a point ``x``, the others below ``upper`` and with little weight."""

    x: Point
    main: int
    upper: Float[np.ndarray, " n_obj"]
    barrier: InteriorPointOptions = OPTIONS.warm

    @property
    def key(self) -> Key:
        """What tells it from others."""
        return self.x.tobytes(), self.main, self.upper.tobytes(), self.barrier


@dataclass(frozen=True, kw_only=True, eq=False)
class LevelSolver:
    """Minimises levels of a ``program``; ``ahead`` has what workers have minimised before its turn."""

    program: Program
    n_obj: int
    solver: Solver
    ahead: dict[Key, Solutions] = field(default_factory=dict)

    def solve(self, levels: Sequence[Level], observe: Observe | None = None) -> Solutions:
        """Return where levels lead, workers having been there or not; ``observe`` looks on."""
        missing = [level for level in levels if level.key not in self.ahead]
        solutions = self.ahead | (self._minimise(missing, observe) if missing else {})
        if observe is not None and not missing:
            observe(len(levels), len(levels))
        return concatenate([solutions[level.key] for level in levels])

    def look_ahead(self, levels: Sequence[Level]) -> None:
        """Let workers, if there are any, minimise levels that are likely to come, once the first of them is due."""
        missing = {level.key: level for level in levels if level.key not in self.ahead}
        if workers() > 1 and len(missing) > 1 and levels[0].key in missing:
            self.ahead.update(self._minimise(list(missing.values()), None))

    def _minimise(self, levels: Sequence[Level], observe: Observe | None) -> dict[Key, Solutions]:
        solutions = minimise_weighted(
            self.program,
            np.stack([level.x for level in levels]),
            main_weights(self.n_obj, np.array([level.main for level in levels]), OPTIONS.weight),
            np.stack([level.upper for level in levels]),
            [level.barrier for level in levels],
            solver=self.solver,
            batch=OPTIONS.batch,
            observe=observe,
        )
        return {level.key: solutions[i : i + 1] for i, level in enumerate(levels)}


SweepPhase: TypeAlias = Literal["", "gap filling", "jump search", "basin exchange"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepProgress:
    """How far a sweep has come: ``done`` of ``total`` points, and all that it has found.

    ``x`` are all points, ``objectives`` (points, n_obj) minimised and not divided by anything, ``front`` the rows that
    no other dominates; ``epsilon`` (n_obj,) are the bounds under which was minimised, inf for what was minimised, None
    where nothing was bounded. Objectives are divided by ``ranges`` when points are sought. ``solved`` levels were
    minimised, about ``ahead`` are to come; None while points are sought from cold starts. ``phase`` is how the front is
    improved once its points are placed: "gap filling" adds further ones that replace others, "jump search" looks for
    better branches beside jumps of the front, "basin exchange" tries every point in the basins of its neighbours. It is
    "" before.
    """

    done: int
    total: int
    x: Points
    objectives: Float[np.ndarray, "points n_obj"]
    front: Int[np.ndarray, " front"]
    epsilon: Float[np.ndarray, " n_obj"] | None
    ranges: Float[np.ndarray, " n_obj"]
    solved: int
    ahead: float | None
    phase: SweepPhase


ObserveSweep: TypeAlias = Callable[[SweepProgress], object]


@dataclass(kw_only=True, eq=False)
class Sweep:
    """The points so far, with their objectives and the weights of these in the Lagrangian, NaN where unknown.

    Objectives are divided by ``ranges``; ``epsilon`` are the bounds of what was minimised last, None without any.
    ``tried`` has the objectives that were minimised between two neighbours (rows) without a new point, ``gaps`` what
    is taken to lie between them. ``cold_points`` are still to be sought from cold starts, about ``further`` ones will
    replace others, and ``rounds`` of basin exchange are expected.
    """

    program: Program
    n_obj: int
    x: Points
    objectives: Float[np.ndarray, "points objectives"]
    weights: Float[np.ndarray, "points n_obj"]
    points: int
    solver: Solver
    observe: ObserveSweep | None
    ranges: Float[np.ndarray, " n_obj"]
    epsilon: Float[np.ndarray, " n_obj"] | None = None
    phase: SweepPhase = ""
    cold_points: int = 0
    further: float = 0
    rounds: int = 0
    solved: int = 0
    tried: dict[tuple[int, int], list[int]] = field(default_factory=dict)
    gaps: dict[tuple[int, int], Gap] = field(default_factory=dict)

    def add(self, solutions: Solutions, weights: Float[np.ndarray, "#points n_obj"] | None = None) -> None:
        """Add points, whether they are part of the front or not; ``weights`` are their objectives', if known."""
        weights = np.full((1, self.n_obj), np.nan) if weights is None else weights
        self.weights = np.concatenate([self.weights, np.broadcast_to(weights, (len(solutions), self.n_obj))])
        self.x = np.concatenate([self.x, solutions.x])
        self.objectives = np.concatenate([self.objectives, solutions.objectives])
        self._show()

    def _lagrangian(self, solutions: Solutions, weights: np.ndarray) -> Float[np.ndarray, "points n_obj"]:
        """Return the weights of the objectives in the Lagrangian where ``weights`` are minimised below bounds."""
        return np.asarray(weights + solutions.bound_multipliers[:, : self.n_obj])

    def front(self) -> Int[np.ndarray, " front"]:
        """Return the rows that no other dominates, by the first objective."""
        return front_rows(self._values)

    def spread(self) -> Int[np.ndarray, " rows"]:
        """Return the rows of as many points of the front as are wanted: of two objectives with most hypervolume."""
        rows = self.front()
        values = self._values[rows]
        return rows[best_rows(values, self.points) if self.n_obj == 2 else spread_rows(values, self.points)]

    @property
    def _values(self) -> Float[np.ndarray, "points n_obj"]:
        return self.objectives[:, : self.n_obj]

    def _ahead(self, count: int) -> float | None:
        """Return about how many levels are still to be minimised if the front has so many points."""
        if self.cold_points > 0:
            return None
        each = self.solved / max(count - self.n_obj, 1)  # ends are not found by levels
        exchange = self.rounds * OPTIONS.neighbours * self.points
        return max(each, 1.0) * (max(self.points - count, 0) + self.further) + exchange

    def _show(self, done: int = 0, total: int = 0) -> None:
        """Show how far the sweep is, with ``done`` of the ``total`` levels that are minimised now."""
        if self.observe is None:
            return
        front, ahead = self.front(), None
        if (levels := self._ahead(len(front))) is not None:
            ahead = levels + total - done
        epsilon = None if self.epsilon is None else self.epsilon * self.ranges
        self.observe(
            SweepProgress(
                done=min(len(front), self.points),
                total=self.points,
                x=self.x,
                objectives=self._values * self.ranges,
                front=front,
                epsilon=epsilon,
                ranges=self.ranges,
                solved=self.solved - (total - done),
                ahead=ahead,
                phase=self.phase,
            )
        )

    def _solve(self, levels: Sequence[Level]) -> Solutions:
        """Return where levels lead that have one ε."""
        self.epsilon = levels[0].upper
        self.solved += len(levels)
        return self._level_solver.solve(levels, self._show)

    @cached_property
    def _level_solver(self) -> LevelSolver:
        return LevelSolver(program=self.program, n_obj=self.n_obj, solver=self.solver)

    def place_points(self, cold: ColdSearch, cold_points: int, further: int) -> None:
        """Add points where the front of two objectives gains the most hypervolume, until it has enough.

        The first ``cold_points`` are sought from cold starts as well; at most ``further`` ones replace others.
        """
        self.cold_points, self.further = cold_points, further / 2
        while True:
            rows = self.front()
            pairs, gaps = self._gaps(rows)
            targets = next_targets(gaps, self._values[rows], self.points)
            if enough := len(rows) >= self.points:
                self.phase = "gap filling"
                targets = targets[: max(further, 0)]
                further -= len(targets)
                self.further = len(targets)
            if not targets:
                return
            likely = [self._levels(pairs[target.gap], target)[0] for target in targets]
            self._level_solver.look_ahead(likely if enough else likely[: workers()])
            for target in targets if enough else targets[:1]:
                pair = pairs[target.gap]
                if len(self.tried.get(pair, ())) < self.n_obj:
                    self._place(pair, gaps[target.gap], target, cold if self.cold_points > 0 else None)
                    self.cold_points -= 1
                    self.further -= enough

    def search_jumps(self) -> None:
        """Try the points beside what may be a jump of the front from both sides: a better branch may pass there.

        Where tangents contradict each other from the other side near by, always over the ridges between valleys, with a
        high barrier.
        """
        self.phase, self.cold_points, self.further, jumps = "jump search", 0, 0, list[tuple[int, list[Level]]]()
        for pair in (list(pair) for pair in pairwise(self.spread().tolist())):
            gap = gap_between(self._values[pair], self.weights[pair])
            if not (gap.contradicts or gap.is_concave):
                continue
            barriers = (OPTIONS.warm, OPTIONS.cold) if gap.contradicts else (OPTIONS.cold,)
            for (row, other), main in product((pair, pair[::-1]), range(2)):
                upper = np.where(np.arange(2) == main, np.inf, self._values[row])
                jumps.append((main, [Level(self.x[other], main, upper, barrier) for barrier in barriers]))
        self._level_solver.look_ahead([level for _, levels in jumps for level in levels])
        for main, levels in jumps:
            solutions = concatenate([self._solve([level]) for level in levels])
            weights = main_weights(2, np.array([main]), OPTIONS.weight)
            self._add_new(solutions[solutions.converged], weights, levels[0].upper)

    def _gaps(self, rows: Int[np.ndarray, " front"]) -> tuple[list[tuple[int, int]], list[Gap]]:
        """Return the gaps that may hold new points, and their ends: those between neighbours, and those of the hull.

        Between neighbours on the hull whose tangents agree there may be a branch below the points that they enclose.
        """
        hull = [(int(rows[i]), int(rows[j])) for i, j in hull_pairs(self._values[rows])]
        pairs = [*pairwise(rows.tolist()), *hull]
        pairs = [pair for pair in pairs if len(self.tried.get(pair, ())) < self.n_obj]
        pairs = [pair for pair in pairs if pair not in hull or not self._gap(pair).contradicts]
        return pairs, [self._gap(pair) for pair in pairs]

    def _gap(self, pair: tuple[int, int]) -> Gap:
        """Return the gap between two rows, which never change."""
        if pair not in self.gaps:
            self.gaps[pair] = gap_between(self._values[list(pair)], self.weights[list(pair)])
        return self.gaps[pair]

    def _place(self, pair: tuple[int, int], gap: Gap, target: Target, cold: ColdSearch | None) -> None:
        """Minimise across the longer side of a gap, to the target on that, or else across the other side."""
        ends, levels = self._values[list(pair)], self._levels(pair, target)
        main, upper = levels[0].main, levels[0].upper
        weights = main_weights(self.n_obj, np.array([main]), OPTIONS.weight)
        solutions = self._solve(levels[:1])
        expected, corner = (1 - OPTIONS.falls_short) * np.prod(ends.max(axis=0) - target.values), ends.max(axis=0)
        if gap.contradicts or not self._gain(solutions, corner) >= expected:
            solutions = concatenate([solutions, self._solve(levels[1:])])
        solutions = solutions[solutions.converged]
        optima = None if cold is None else cold.optima_below(self.program, main, upper, OPTIONS.weight)
        if optima is not None:
            solutions = concatenate([solutions, optima[optima.converged][: OPTIONS.cold_optima]])
        if not self._add_new(solutions, weights, corner) or self._gain(solutions, corner) < expected / 2:
            self.tried.setdefault(pair, []).append(main)

    def _levels(self, pair: tuple[int, int], target: Target) -> list[Level]:
        """Return how a gap's longer side, or else the other, is crossed to a target: from its nearer end, the other."""
        ends, mains = self._values[list(pair)], self.tried.get(pair, ())
        main = next(k for k in np.argsort(np.abs(ends[0] - ends[1]), kind="stable").tolist() if k not in mains)
        upper = np.where(np.arange(self.n_obj) == main, np.inf, _on_grid(target.values, ends))
        nearer = np.argsort(np.abs(ends - target.values)[:, 1 - main], kind="stable").tolist()
        return [Level(self.x[pair[i]], main, upper) for i in nearer]

    def _gain(self, solutions: Solutions, corner: Float[np.ndarray, " 2"]) -> float:
        """Return the most hypervolume that one of the solutions has below a corner."""
        sides = np.maximum(corner - solutions.objectives[:, : self.n_obj], 0.0)
        return float(np.where(solutions.converged, np.prod(sides, axis=1), 0.0).max(initial=0.0))

    def _add_new(self, solutions: Solutions, weights: np.ndarray, corner: np.ndarray) -> bool:
        """Add those that are new; return whether one of them is a point of the front below a corner."""
        before, new = self._values[self.front()], False
        for i, value in enumerate(solutions.objectives):
            if is_duplicate(value, self.objectives):
                continue
            self.add(solutions[i : i + 1], self._lagrangian(solutions[i : i + 1], weights))
            values = value[: self.n_obj]
            dominated = (before <= values + POINT_TOLERANCE).all(axis=1).any()
            new |= bool((values < corner).all() and not dominated)
        return new

    def fill_gaps(self) -> None:
        """Add points in the widest gaps of the front, until it has enough."""
        fill_gaps(lambda: self._values[self.front()], self._minimise_below, self.points, self._look_below)

    def _look_below(self, bounds: Sequence[tuple[int, Float[np.ndarray, " n_obj"]]]) -> None:
        """Let workers minimise objectives below bounds ahead, the first ones, as many as there are workers for."""
        first = bounds[: max(workers() // OPTIONS.nearest, 1)]
        self._level_solver.look_ahead([level for main, upper in first for level in self._levels_below(main, upper)])

    def _levels_below(self, main: int, upper: Float[np.ndarray, " n_obj"]) -> list[Level]:
        """Return how objective ``main`` is minimised below ``upper``, from the nearest points."""
        off = np.abs(self._values - np.where(np.isfinite(upper), upper, self._values)).max(axis=1)
        nearest = np.argsort(off, kind="stable")[: OPTIONS.nearest]
        return [Level(x, main, upper) for x in self.x[nearest]]

    def _minimise_below(self, main: int, upper: Float[np.ndarray, " n_obj"]) -> bool:
        """Minimise objective ``main`` below ``upper`` from the nearest points; return whether that is a new one."""
        weights = main_weights(self.n_obj, np.array([main]), OPTIONS.weight)
        solutions = self._solve(self._levels_below(main, upper))
        best = int(np.argmin(np.where(solutions.converged, solutions.objectives[:, main], np.inf)))
        if not solutions.converged[best] or is_duplicate(solutions.objectives[best], self.objectives):
            return False
        self.add(solutions[best : best + 1], self._lagrangian(solutions[best : best + 1], weights))
        return True

    def exchange_basins(self) -> None:
        """Try for every point of the front whether its neighbours' basins hold one that is better in everything.

        Where there are many valleys, a neighbour that came later may lie in a better one.
        """
        options, self.phase = OPTIONS.warm._replace(iterations=OPTIONS.basin_iterations), "basin exchange"
        tried = np.zeros((0, 2), dtype=int)
        for _ in range(OPTIONS.rounds):
            pairs = self._neighbours()
            pairs = pairs[~(pairs[:, None] == tried).all(axis=2).any(axis=1)]
            if not len(pairs):
                return
            self.solved, self.rounds = self.solved + len(pairs), 0
            tried = np.concatenate([tried, pairs])
            upper = self._values[pairs[:, 0]]
            self.epsilon = upper[0] if len(upper) == 1 else None  # else each has bounds of its own
            solutions = minimise_weighted(
                self.program,
                self.x[pairs[:, 1]],
                np.ones((1, self.n_obj)),
                upper,
                options,
                solver=self.solver,
                batch=OPTIONS.batch,
                observe=self._show,
            )
            gain = np.sum(upper - solutions.objectives[:, : self.n_obj], axis=1)
            better = solutions.converged & (gain > 10 * POINT_TOLERANCE)
            if not better.any():
                return
            self.add(solutions[better], self._lagrangian(solutions[better], np.ones((1, self.n_obj))))

    def _neighbours(self) -> Int[np.ndarray, "pairs 2"]:
        """Return pairs of rows: every point that spreads over the front, and one of the nearest others of these."""
        rows = self.spread()
        values = self._values[rows]
        distances = np.linalg.norm(values[:, None] - values, axis=2)
        np.fill_diagonal(distances, np.inf)
        near = np.argsort(distances, axis=1)[:, : min(OPTIONS.neighbours, len(rows) - 1)]
        return np.stack([np.repeat(rows, near.shape[1]), rows[near.ravel()]], axis=1)


def _on_grid(values: Float[np.ndarray, " 2"], ends: Float[np.ndarray, "2 2"]) -> Float[np.ndarray, " 2"]:
    """Return values between two ends at the nearest of even places: there the rounding of tangents moves no point."""
    low, width = ends.min(axis=0), np.ptp(ends, axis=0)
    share = np.clip(np.round((values - low) / width * OPTIONS.grid), 1, OPTIONS.grid - 1) / OPTIONS.grid
    return np.asarray(low + share * width)
