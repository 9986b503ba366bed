"""The sweep of ε-constraints, which adds points at the places where the front gains most."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, product
from typing import NamedTuple, TypeAlias

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

# Settings of ε-sweeps.


@dataclass(frozen=True, kw_only=True)
class EpsilonOptions:
    """Settings of a sweep; values are shares of the objectives' ranges."""

    end_tolerance: float = 1e-6  # largest loss of an objective at its end of the front, in favour of the others
    end_weight: float = 1e-3  # first weight of the other objectives at an end
    # ratio of the ends' ranges to the optima's, below which ends are searched again with their own ranges
    narrower: float = 0.5
    weight: float = 5e-4  # weight of the other objectives at any ε; without it a point may be only weakly optimal
    cold_points: int = 3  # number of first points that are also searched from cold starts (two objectives)
    cold_optima: int = 4  # number of best optima used of each cold search
    inner: float = 0.5  # ε of each objective's cold search, between nadir (0) and ideal (1) (more than two objectives)
    falls_short: float = 0.02  # missing share of the expected gain, from which on the second neighbour is a start too
    further: int = 4  # largest number of extra points to solve
    further_share: float = 0.5  # the same as a share of all points; the larger number counts
    grid: int = 256  # number of even steps in a gap to which ε is rounded
    nearest: int = 4  # number of nearest points from which every ε starts (more than two objectives)
    neighbours: int = 2  # number of neighbours whose basins are searched for each point
    rounds: int = 3  # largest number of rounds of such searches
    basin_iterations: int = 60  # number of iterations of such a search
    batch: int = 8  # number of points minimised between two calls of the observer
    # the front is one point if its ends differ by no more than this; the solver's last barrier may leave as much
    resolution: float = 1e-7  # difference of every objective, as a share of its size
    resolved_distance: float = 1e-3  # RMS distance in rad or arm lengths
    # solver settings for starts from a nearby point
    warm: InteriorPointOptions = InteriorPointOptions(barrier=1e-4, radius=0.02)
    # near, cold: solver settings of further attempts at ends: in a flat valley one attempt may lose the point, another
    # find a better one
    near: InteriorPointOptions = InteriorPointOptions(barrier=1e-6, radius=0.02)
    cold: InteriorPointOptions = InteriorPointOptions(barrier=0.1, radius=0.2)


OPTIONS = EpsilonOptions()


# Levels of ε, minimised in order, or earlier by workers.
#
# A sweep is sequential: each level follows from the results before. Often it can be predicted, and its result depends
# only on the level itself. Workers may therefore compute it earlier: the sweep stays the same bit for bit.


Key: TypeAlias = tuple[bytes, int, bytes, InteriorPointOptions]


class Level(NamedTuple):
    """A minimisation of one objective, with small weights of the others.

        minimise    F_main(y) + weight · Σ F_j(y)  from y = x
        subject to  F_j(y) ≤ ε_j

    ``upper`` is ε, inf for ``main``.
    """

    x: Point
    main: int
    upper: Float[np.ndarray, " n_obj"]
    barrier: InteriorPointOptions = OPTIONS.warm

    @property
    def key(self) -> Key:
        """A key that identifies the level."""
        return self.x.tobytes(), self.main, self.upper.tobytes(), self.barrier


# The sweep: its points and its progress.


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepProgress:
    """The progress of a sweep."""

    done: int  # number of points on the front so far, at most ``total``
    total: int  # number of points requested
    x: Points  # all points so far
    objectives: Float[np.ndarray, "points n_obj"]  # objectives of all points, minimised, in natural units
    front: Int[np.ndarray, " front"]  # rows of non-dominated points
    # upper bounds of the last minimisation, inf for the minimised objective; None without bounds
    epsilon: Float[np.ndarray, " n_obj"] | None
    ranges: Float[np.ndarray, " n_obj"]  # divisors of the objectives in the sweep
    solved: int  # number of solved levels
    ahead: float | None  # estimated number of further levels; None during cold searches
    phase: str  # current phase in words; "" while first points are placed


ObserveSweep: TypeAlias = Callable[[SweepProgress], object]


@dataclass(kw_only=True, eq=False)
class Sweep:
    """The state of a sweep."""

    program: Program
    n_obj: int
    x: Points
    objectives: Float[np.ndarray, "points objectives"]  # objectives of the points, divided by ``ranges``
    weights: Float[np.ndarray, "points n_obj"]  # weights of the objectives in the Lagrangian, NaN if unknown
    points: int
    solver: Solver
    observe: ObserveSweep | None
    ranges: Float[np.ndarray, " n_obj"]
    epsilon: Float[np.ndarray, " n_obj"] | None = None  # bounds of the last minimisation, None without bounds
    phase: str = ""
    cold_points: int = 0  # number of points that are still to be searched from cold starts
    further: float = 0  # estimated number of points that will replace others
    rounds: int = 0  # expected number of rounds of basin exchange
    solved: int = 0
    ahead: dict[Key, Solutions] = field(default_factory=dict)  # solutions of levels that workers minimised earlier
    # objectives already minimised without a new point between two neighbours (rows)
    tried: dict[tuple[int, int], list[int]] = field(default_factory=dict)
    gaps: dict[tuple[int, int], Gap] = field(default_factory=dict)  # gap between two neighbours (rows)

    def add(self, solutions: Solutions, weights: Float[np.ndarray, "#points n_obj"] | None = None) -> None:
        """Add points, dominated or not, with the objectives' weights in the Lagrangian."""
        weights = np.full((1, self.n_obj), np.nan) if weights is None else weights
        self.weights = np.concatenate([self.weights, np.broadcast_to(weights, (len(solutions), self.n_obj))])
        self.x = np.concatenate([self.x, solutions.x])
        self.objectives = np.concatenate([self.objectives, solutions.objectives])
        self._show()

    def _lagrangian(self, solutions: Solutions, weights: np.ndarray) -> Float[np.ndarray, "points n_obj"]:
        """Return the objectives' weights in the Lagrangian: ``weights`` plus the multipliers of their bounds."""
        return np.asarray(weights + solutions.bound_multipliers[:, : self.n_obj])

    def front(self) -> Int[np.ndarray, " front"]:
        """Return the rows of non-dominated points, sorted by the first objective."""
        return front_rows(self._values)

    def spread(self) -> Int[np.ndarray, " rows"]:
        """Return the rows of up to ``points`` points: of the most hypervolume (two objectives), or well spread."""
        rows = self.front()
        values = self._values[rows]
        return rows[best_rows(values, self.points) if self.n_obj == 2 else spread_rows(values, self.points)]

    @property
    def _values(self) -> Float[np.ndarray, "points n_obj"]:
        return self.objectives[:, : self.n_obj]

    def _show(self, done: int = 0, total: int = 0) -> None:
        """Show the progress: ``done`` of ``total`` current levels are minimised."""
        if self.observe is None:
            return
        front, ahead = self.front(), None
        if self.cold_points <= 0:  # estimate the number of remaining levels
            each = self.solved / max(len(front) - self.n_obj, 1)  # levels per point; the ends are not found by levels
            exchange = self.rounds * OPTIONS.neighbours * self.points
            levels = max(each, 1.0) * (max(self.points - len(front), 0) + self.further) + exchange
            ahead = levels + total - done
        self.observe(
            SweepProgress(
                done=min(len(front), self.points),
                total=self.points,
                x=self.x,
                objectives=self._values * self.ranges,
                front=front,
                epsilon=None if self.epsilon is None else self.epsilon * self.ranges,
                ranges=self.ranges,
                solved=self.solved - (total - done),
                ahead=ahead,
                phase=self.phase,
            )
        )

    def solve(self, levels: Sequence[Level]) -> Solutions:
        """Return the solutions of levels with a common ε; those minimised ahead are not solved again."""
        self.epsilon = levels[0].upper
        self.solved += len(levels)
        missing = [level for level in levels if level.key not in self.ahead]
        solutions = self.ahead | (self._minimise(missing, self._show) if missing else {})
        if not missing:
            self._show(len(levels), len(levels))
        return concatenate([solutions[level.key] for level in levels])

    def look_ahead(self, levels: Sequence[Level]) -> None:
        """Minimise levels that are likely to come, in workers (if any)."""
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

    def place_points(self, cold: ColdSearch, cold_points: int, further: int) -> None:
        """Add points where a two-objective front gains the most hypervolume.

        The first ``cold_points`` are also searched from cold starts; at most ``further`` points replace others.
        """
        self.cold_points, self.further = cold_points, further / 2
        while True:
            rows = self.front()
            # gaps that may contain new points: between neighbours, and between hull neighbours whose tangents agree.
            # In the latter there may be a branch below the points between the two
            hull = [(int(rows[i]), int(rows[j])) for i, j in hull_pairs(self._values[rows])]
            pairs = [*pairwise(rows.tolist()), *hull]
            pairs = [pair for pair in pairs if len(self.tried.get(pair, ())) < self.n_obj]
            pairs = [pair for pair in pairs if pair not in hull or not self._gap(pair).contradicts]
            gaps = [self._gap(pair) for pair in pairs]
            targets = next_targets(gaps, self._values[rows], self.points)
            if enough := len(rows) >= self.points:
                self.phase = "better places sought"
                targets = targets[: max(further, 0)]
                further -= len(targets)
                self.further = len(targets)
            if not targets:
                return
            likely = [self._levels(pairs[target.gap], target)[0] for target in targets]
            self.look_ahead(likely if enough else likely[: workers()])
            for target in targets if enough else targets[:1]:
                pair = pairs[target.gap]
                if len(self.tried.get(pair, ())) < self.n_obj:
                    # minimise to the target, below a bound on the longer side that was not tried before
                    ends, levels = self._values[list(pair)], self._levels(pair, target)
                    main, upper = levels[0].main, levels[0].upper
                    weights = main_weights(self.n_obj, np.array([main]), OPTIONS.weight)
                    solutions = self.solve(levels[:1])
                    corner = ends.max(axis=0)
                    expected = (1 - OPTIONS.falls_short) * np.prod(corner - target.values)
                    if gaps[target.gap].contradicts or not self._gain(solutions, corner) >= expected:
                        solutions = concatenate([solutions, self.solve(levels[1:])])
                    solutions = solutions[solutions.converged]
                    if self.cold_points > 0:
                        optima = cold.optima_below(self.program, main, upper, OPTIONS.weight)
                        if optima is not None:
                            solutions = concatenate([solutions, optima[optima.converged][: OPTIONS.cold_optima]])
                    if not self._add_new(solutions, weights, corner) or self._gain(solutions, corner) < expected / 2:
                        self.tried.setdefault(pair, []).append(main)
                    self.cold_points -= 1
                    self.further -= enough

    def search_jumps(self) -> None:
        """Solve again at both sides of possible jumps of the front.

        There may be a better branch. Each side gives the bounds of a search from the other side, with a high barrier
        that crosses ridges between valleys. If tangents contradict each other, a low barrier is tried too.
        """
        self.phase, self.cold_points, self.further, jumps = "jumps searched", 0, 0, list[tuple[int, list[Level]]]()
        for pair in (list(pair) for pair in pairwise(self.spread().tolist())):
            gap = gap_between(self._values[pair], self.weights[pair])
            if not (gap.contradicts or gap.is_concave):
                continue
            barriers = (OPTIONS.warm, OPTIONS.cold) if gap.contradicts else (OPTIONS.cold,)
            for (row, other), main in product((pair, pair[::-1]), range(2)):
                upper = np.where(np.arange(2) == main, np.inf, self._values[row])
                jumps.append((main, [Level(self.x[other], main, upper, barrier) for barrier in barriers]))
        self.look_ahead([level for _, levels in jumps for level in levels])
        for main, levels in jumps:
            solutions = concatenate([self.solve([level]) for level in levels])
            weights = main_weights(2, np.array([main]), OPTIONS.weight)
            self._add_new(solutions[solutions.converged], weights, levels[0].upper)

    def _gap(self, pair: tuple[int, int]) -> Gap:
        """Return the gap between two points, computed once: the points of rows never change."""
        if pair not in self.gaps:
            self.gaps[pair] = gap_between(self._values[list(pair)], self.weights[list(pair)])
        return self.gaps[pair]

    def _levels(self, pair: tuple[int, int], target: Target) -> list[Level]:
        """Return the levels to a target in a gap, from the nearer end first.

        They bound the longer side of the gap, or the other one if that was tried before.
        """
        ends, mains = self._values[list(pair)], self.tried.get(pair, ())
        main = next(k for k in np.argsort(np.abs(ends[0] - ends[1]), kind="stable").tolist() if k not in mains)
        # bounds are on an even grid, so that rounding errors of tangents do not move points
        low, width = ends.min(axis=0), np.ptp(ends, axis=0)
        share = np.clip(np.round((target.values - low) / width * OPTIONS.grid), 1, OPTIONS.grid - 1) / OPTIONS.grid
        upper = np.where(np.arange(self.n_obj) == main, np.inf, low + share * width)
        nearer = np.argsort(np.abs(ends - target.values)[:, 1 - main], kind="stable").tolist()
        return [Level(self.x[pair[i]], main, upper) for i in nearer]

    def _gain(self, solutions: Solutions, corner: Float[np.ndarray, " 2"]) -> float:
        """Return the largest hypervolume that a single solution has below a corner."""
        sides = np.maximum(corner - solutions.objectives[:, : self.n_obj], 0.0)
        return float(np.where(solutions.converged, np.prod(sides, axis=1), 0.0).max(initial=0.0))

    def _add_new(self, solutions: Solutions, weights: np.ndarray, corner: np.ndarray) -> bool:
        """Add new solutions; return whether one of them is on the front and below ``corner``."""
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
        """Add points in the front's widest gaps, until it has enough."""

        def add(main: int, upper: Float[np.ndarray, " n_obj"]) -> bool:
            """Add the best solution from nearby points; return whether it is new."""
            weights = main_weights(self.n_obj, np.array([main]), OPTIONS.weight)
            solutions = self.solve(self._levels_below(main, upper))
            best = int(np.argmin(np.where(solutions.converged, solutions.objectives[:, main], np.inf)))
            new = solutions.converged[best] and not is_duplicate(solutions.objectives[best], self.objectives)
            if new:
                self.add(solutions[best : best + 1], self._lagrangian(solutions[best : best + 1], weights))
            return bool(new)

        def look_ahead(bounds: Sequence[tuple[int, Float[np.ndarray, " n_obj"]]]) -> None:
            first = bounds[: max(workers() // OPTIONS.nearest, 1)]  # each occupies ``nearest`` workers
            self.look_ahead([level for main, upper in first for level in self._levels_below(main, upper)])

        fill_gaps(lambda: self._values[self.front()], add, self.points, look_ahead)

    def _levels_below(self, main: int, upper: Float[np.ndarray, " n_obj"]) -> list[Level]:
        """Return the levels that minimise ``main`` below ``upper``, from the nearest points."""
        off = np.abs(self._values - np.where(np.isfinite(upper), upper, self._values)).max(axis=1)
        nearest = np.argsort(off, kind="stable")[: OPTIONS.nearest]
        return [Level(x, main, upper) for x in self.x[nearest]]

    def exchange_basins(self) -> None:
        """Search the neighbours' basins of every point for a better point.

            minimise    Σ F(y)  from a neighbour's point
            subject to  F(y) ≤ F(x)

        If there are many valleys, a neighbour that was found later may be in a better one.
        """
        options, self.phase = OPTIONS.warm._replace(iterations=OPTIONS.basin_iterations), "neighbours' basins tried"
        tried = np.zeros((0, 2), dtype=int)
        for _ in range(OPTIONS.rounds):
            # pairs of each point of the spread and its nearest neighbours in the spread
            rows = self.spread()
            distances = np.linalg.norm(self._values[rows][:, None] - self._values[rows], axis=2)
            np.fill_diagonal(distances, np.inf)
            near = np.argsort(distances, axis=1)[:, : min(OPTIONS.neighbours, len(rows) - 1)]
            pairs = np.stack([np.repeat(rows, near.shape[1]), rows[near.ravel()]], axis=1)
            pairs = pairs[~(pairs[:, None] == tried).all(axis=2).any(axis=1)]
            if not len(pairs):
                return
            self.solved, self.rounds = self.solved + len(pairs), 0
            tried = np.concatenate([tried, pairs])
            upper = self._values[pairs[:, 0]]
            self.epsilon = upper[0] if len(upper) == 1 else None  # several levels have no common bounds
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
