"""Move along a front from a known point to a new one, the best optimum that is found.

The start's branch is followed. If it ends or bends back, or a known point is better, the branches of the nearest known
points that fulfil the wish are followed. If none leads to the wish, the program is solved from these points, from
points between them and the start, and last from farther points. If the front jumps, the best optimum may be in a valley
without any of these points: the program is also solved from a point behind the start (worse in the improved objective),
with a barrier high enough to leave a valley.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Point, Points
from paretoik.errors import EvaluationFailed
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import FEASIBLE, Goal, InteriorPointOptions, Program, violation_of
from paretoik.pareto.continuation import Continuation, can_follow, follow, guess_optimum
from paretoik.pareto.scalarisation import WARM_OPTIONS as WARM


@dataclass(frozen=True, kw_only=True)
class NavigationOptions:
    """Settings of moves; objectives are divided by their ranges."""

    augmentation: float = 5e-4  # weight ρ of the sum of all objectives
    share: float = 0.5  # largest ρ, as a share of the least weight: then a start is the optimum of its own goal
    neighbours: int = 3  # number of known points to start from
    farther: int = 12  # number of further known points to start from if the first ones lead to no optimum
    better: float = 1e-7  # smallest gain that makes one point better than another
    worthwhile: float = 0.02  # smallest share of the way for which a point of a branch that ends early is returned
    places: int = 3  # number of places between two points that are tested for a barrier
    height: float = 1e-6  # least height of a barrier: excess of an objective over both points
    # the solver's barriers, tried in order until one leads to an optimum
    barriers: tuple[InteriorPointOptions, ...] = WARM.barriers
    # solver settings with a barrier that leaves valleys, and few iterations
    high: InteriorPointOptions = InteriorPointOptions(barrier=1e-2, radius=0.02, iterations=50)


OPTIONS = NavigationOptions()

# The goal of a move: improve one objective by a given amount; only the payers may get worse.
#
#     minimise    F̂_m + ρ Σ F̂_j                                 F̂ = F / ranges, m the payer with the largest weight
#     subject to  F̂_i ≤ F̂_i(start) − s · by                     the improved objective
#                 F̂_p − F̂_m ≤ F̂_p(start) − F̂_m(start)           the other payers: equal shares of their ranges
#                 F̂_h ≤ F̂_h(start)                              all other objectives
#
# At s = 0 a Pareto-critical start is optimal, and its weights give the multipliers; unlike for a weighted sum, this is
# true on a concave front too. Source: Pascoletti & Serafini 1984; ρ is the augmentation of Wierzbicki 1980.


@dataclass(frozen=True, kw_only=True)
class Wish:
    """Wish to improve an objective by a share of its range; ``payers`` may get worse."""

    improve: int
    payers: tuple[int, ...]
    by: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Aim:
    """The goals from a start (``at_share(0)``) to the wish (``at_share(1)``)."""

    wish: Wish
    ranges: Float[np.ndarray, " n_obj"]
    start: Float[np.ndarray, " n_obj"]  # objectives at the start
    # weights of the objectives, divided by their ranges, at the start; their sum is 1
    weights: Float[np.ndarray, " n_obj"]
    objectives: int  # number of all objectives F of the program

    @property
    def main(self) -> int:
        """The payer that is minimised: the one with the largest weight."""
        return max(self.wish.payers, key=lambda payer: self.weights[payer])

    def at_share(self, share: float) -> Goal:
        """Return the goal at a share of the way to the wish."""
        count, main, wish = len(self.ranges), self.main, self.wish
        identity = np.eye(count, self.objectives) / np.append(self.ranges, np.ones(self.objectives - count))
        others = [k for k in range(count) if k != main]
        rows, upper = identity[others], (self.start / self.ranges)[others]
        for i, k in enumerate(others):
            if k == wish.improve:
                upper[i] -= share * wish.by
            elif k in wish.payers:
                rows[i] -= identity[main]
                upper[i] -= self.start[main] / self.ranges[main]
        scale = self.weights[list(wish.payers)].sum()
        smallest = float(self.weights.min() / scale) if scale > 0 else 0.0
        augmentation = min(OPTIONS.augmentation, OPTIONS.share * smallest)
        return Goal(weights=identity[main] + augmentation * identity.sum(axis=0), rows=rows, upper=upper)

    @property
    def predicted(self) -> Float[np.ndarray, " n_obj"]:
        """Changes that exchange rates predict, as shares of ranges.

        Those of the payers are inf if no payer has a weight.
        """
        wish, change = self.wish, np.zeros(len(self.ranges))
        change[wish.improve] = -wish.by
        payers, total = list(wish.payers), float(self.weights[list(wish.payers)].sum())
        change[payers] = wish.by * self.weights[wish.improve] / total if total > 0 else np.inf
        return change


# Moves along a front to a new point.


Between = Callable[[Point, Point, Float[np.ndarray, " shares"]], Float[np.ndarray, " between *point"]]
"""Returns the points at shares of the way from one point to another; impossible ones are left out."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FrontPoints:
    """A front's points, and their objectives in the program's own scale."""

    x: Points
    objectives: Float[np.ndarray, "points n_obj"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Destination:
    """The result of a move."""

    x: Point
    share: float  # share of the wish that the point fulfils
    followed: Continuation | None  # result of following the branch; None if that is not possible
    arrived: bool  # whether following the branch led to this point; else the program was solved again
    jump: bool  # whether there is a barrier between the start and the point


def move(program: Program, front: FrontPoints, start: int, aim: Aim, between: Between) -> Destination | None:
    """Return the result of a move from a known point; None if no optimum is found."""
    # follow the start's branch, and those of other points
    goal, neighbours = aim.at_share(1.0), _neighbours(front, start, aim)
    followed = _follow(program, front, start, goal)
    arrived = followed is not None and followed.share >= 1.0
    others = neighbours
    if followed is not None and arrived:
        # the best known point if it is better than the followed one, else the neighbours in other valleys
        count = front.objectives.shape[1]
        merit = float(goal.weights @ program.evaluate(followed.optimum.x)[0])
        merits = front.objectives @ goal.weights[:count]
        feasible = (front.objectives @ goal.rows[:, :count].T <= goal.upper + FEASIBLE).all(axis=1)
        better = np.flatnonzero(feasible & (merits < merit + OPTIONS.better))
        if len(better):
            others = [int(better[np.argmin(merits[better])])]
        else:
            ranges = np.ptp(front.objectives, axis=0)
            others = [i for i in neighbours if has_barrier(program, followed.optimum.x, front.x[i], between, ranges)]
    branches = [followed, *(_follow(program, front, i, goal) for i in others)]
    candidates = [each.optimum.x for each in branches if each is not None and each.share >= 1.0]
    best = _best(program, candidates, goal)
    # solve again if the move leaves its branch; then, or at a jump, also from the point behind the start
    leaves = not arrived or best is not candidates[0]
    if leaves:
        # starts of the solver: the branch's end, the start, the neighbours and points between
        starts = [front.x[start]]
        if followed is not None and 0.0 < followed.share < 1.0:
            starts.insert(0, followed.optimum.x)
        gains = _gains(front, aim)
        for i in neighbours if best is None else []:
            starts.append(front.x[i])
            share = aim.wish.by / max(float(gains[i]), 1e-300)
            if share < 1.0:
                starts += list(between(front.x[start], front.x[i], np.array([share])))
        candidates += _solve(program, starts, goal, OPTIONS.barriers)
    behind, is_curve = _behind(front, start, aim), len(aim.ranges) == 2  # points of a surface have no order
    if leaves or (is_curve and (others or has_barrier(program, front.x[start], front.x[behind], between, aim.ranges))):
        candidates += _solve(program, [front.x[behind]], goal, (OPTIONS.high,))
    best = _best(program, candidates, goal)
    if best is None:  # starts farther away
        farther = [front.x[i] for i in _nearest(front, aim) if i not in (start, *neighbours)][: OPTIONS.farther]
        best = _best(program, _solve(program, farther, goal, OPTIONS.barriers), goal)
    if best is not None:
        is_followed = arrived and best is candidates[0]
        jump = not is_followed and has_barrier(program, front.x[start], best, between, aim.ranges)
        return Destination(x=best, share=1.0, followed=followed, arrived=is_followed, jump=jump)
    # a part of the way is better than nothing
    if followed is not None and followed.share >= OPTIONS.worthwhile:
        return Destination(x=followed.optimum.x, share=followed.share, followed=followed, arrived=True, jump=False)
    return None


def reach(program: Program, x: Point, goal: Goal) -> Point | None:
    """Return the optimum of a goal from a nearby point; None if none is found."""
    return _best(program, _solve(program, [x], goal, OPTIONS.barriers), goal)


def has_barrier(
    program: Program, x: Point, other: Point, between: Between, ranges: Float[np.ndarray, " n_obj"]
) -> bool:
    """Return whether there is a barrier between two points.

    It is a place that is impossible, or worse in an objective than both points.
    """
    shares = np.arange(1, OPTIONS.places + 1) / (OPTIONS.places + 1)
    inner = between(x, other, shares)
    if len(inner) < len(shares):
        return True
    values = np.full((len(inner) + 2, len(ranges)), np.inf)  # inf remains if a function has no value there
    for row, one in zip(values, (x, *inner, other), strict=True):
        with suppress(EvaluationFailed):
            row[:] = program.evaluate(one)[0][: len(ranges)]
    corner = np.maximum(values[0], values[-1]) + OPTIONS.height * ranges
    return not bool((values[1:-1] <= corner).all())


def _follow(program: Program, front: FrontPoints, i: int, goal: Goal) -> Continuation | None:
    """Return how far a known point can be followed to a goal.

    The first bounds are the point's own values.
    """
    if not can_follow(program):
        return None
    count = front.objectives.shape[1]
    begin = goal.rows[:, :count] @ front.objectives[i]

    def at_share(share: float) -> Goal:
        return Goal(weights=goal.weights, rows=goal.rows, upper=begin + share * (goal.upper - begin))

    optimum = guess_optimum(program, front.x[i], at_share(0.0))
    return None if optimum is None else follow(program, optimum, at_share)


def _neighbours(front: FrontPoints, start: int, aim: Aim) -> list[int]:
    """Return the known points that improve the objective enough.

    The points with the least excess over the other bounds come first, the nearest first on a tie.
    """
    goal, near = aim.at_share(1.0), _nearest(front, aim)
    excess = (front.objectives @ goal.rows[:, : len(aim.ranges)].T - goal.upper).max(axis=1)
    enough = _gains(front, aim) >= aim.wish.by - OPTIONS.better
    order = sorted((i for i in near if enough[i] and i != start), key=lambda i: max(excess[i], 0.0))
    return order[: OPTIONS.neighbours]


def _nearest(front: FrontPoints, aim: Aim) -> list[int]:
    """Return all known points, the nearest to the start first."""
    return [int(i) for i in np.argsort(np.linalg.norm((front.objectives - aim.start) / aim.ranges, axis=1))]


def _gains(front: FrontPoints, aim: Aim) -> Float[np.ndarray, " points"]:
    """Return every point's gain in the improved objective, as a share of its range."""
    k = aim.wish.improve
    return np.asarray((aim.start[k] - front.objectives[:, k]) / aim.ranges[k])


def _behind(front: FrontPoints, start: int, aim: Aim) -> int:
    """Return the nearest known point behind the start, or else the start.

    It is worse in the improved objective and satisfies all other bounds: a move to the start could begin there.
    """
    goal = aim.at_share(0.0)
    others = goal.rows[:, aim.wish.improve] == 0.0
    excess = front.objectives @ goal.rows[others, : len(aim.ranges)].T - goal.upper[others]
    less = (_gains(front, aim) < -OPTIONS.better) & (excess <= OPTIONS.better).all(axis=1)
    return next((i for i in _nearest(front, aim) if less[i]), start)


def _solve(
    program: Program, points: Sequence[Point], goal: Goal, barriers: tuple[InteriorPointOptions, ...]
) -> list[Point]:
    """Return the optima that points lead to, each by the first barrier that converges."""
    optima, unsolved, starts = list[Point](), np.ones(len(points), dtype=bool), np.array(points)
    for options in barriers:
        rows = np.flatnonzero(unsolved)
        if not len(rows):
            break
        upper = np.tile(goal.upper, (len(rows), 1))
        solutions = minimise(program, starts[rows], goal.weights[None], upper, options, rows=goal.rows)
        optima += list(solutions.x[solutions.converged])
        unsolved[rows[solutions.converged]] = False
    return optima


def _best(program: Program, candidates: list[Point], goal: Goal) -> Point | None:
    """Return the feasible candidate with the least merit, if any."""
    best, lowest = None, np.inf
    for x in candidates:
        F, equalities, inequalities = program.evaluate(x)
        violation = violation_of(program, F, equalities, inequalities, goal.rows, goal.upper)
        merit = float(goal.weights @ F)
        if violation <= FEASIBLE and merit < lowest - OPTIONS.better:
            best, lowest = x, merit
    return best
