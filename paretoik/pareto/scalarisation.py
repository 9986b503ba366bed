"""Scalarisation: objectives divided by ranges, weighted, and bounded from above by ε."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Points
from paretoik.errors import Infeasible, SolverFailed
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import (
    CONVERGED,
    FEASIBLE,
    NO_PROGRESS,
    InteriorPointOptions,
    Program,
    Solutions,
    Solver,
    concatenate,
    violation_of,
)
from paretoik.runs.distribution import workers

Observe: TypeAlias = Callable[..., object]
"""Called with the numbers done and in total; a cold search of motions adds a summary of violations."""


def objective_sizes(program: Program, x: Points, n_obj: int) -> Float[np.ndarray, " n_obj"]:
    """Return the size of every objective at points.

    It is the largest |F|, or the largest first-order change of F in a step of RMS length 1 rad along the gradient if
    that is more: F may be almost 0 at optima. Auxiliary variables have no unit of length and do not count.
    """
    at = [program.linearise(one) for one in x]
    values = np.array([each.objectives[:n_obj] for each in at])
    slopes = [np.linalg.norm(each.gradients[:n_obj, : each.unknowns], axis=1) for each in at]
    changes = np.array([slope * each.unit for slope, each in zip(slopes, at, strict=True)])
    return np.asarray(np.maximum(np.abs(values), changes).max(axis=0))


def main_weights(n_obj: int, mains: Int[np.ndarray, " rows"], weight: float | np.ndarray) -> np.ndarray:
    """Return weights (rows, n_obj): 1 for main objectives, ``weight`` for others."""
    weights = np.repeat(np.broadcast_to(weight, len(mains))[:, None], n_obj, axis=1)
    weights[np.arange(len(mains)), mains] = 1.0
    return weights


def minimise_weighted(
    program: Program,
    x: Points,
    weights: Float[np.ndarray, "#points n_obj"],
    upper: Float[np.ndarray, "#points n_obj"] | None,
    barrier: InteriorPointOptions | Sequence[InteriorPointOptions],
    *,
    solver: Solver,
    batch: int | None = None,
    observe: Observe | None = None,
) -> Solutions:
    """Return the solution from each point.

        minimise    weights · F(x)
        subject to  F(x) ≤ upper (ε)

    Only the first n_obj objectives of the program are weighted and bounded.

    barrier: solver settings for all points, or one per point
    observe: function called after each batch of ``batch`` points, or with workers whenever they return some points
    """
    count, n_obj = len(x), weights.shape[1]
    upper = np.full((1, n_obj), np.inf) if upper is None else upper
    others = ((0, 0), (0, len(program.upper) - n_obj))
    weights = np.pad(np.broadcast_to(weights, (count, n_obj)), others)
    upper = np.pad(np.broadcast_to(upper, (count, n_obj)), others, constant_values=np.inf)
    if count > 1 and workers() > 1:
        shown = None if observe is None else lambda done: observe(done, count)
        return minimise(program, x, weights, upper, barrier, solver=solver, observe=shown)
    batch, parts = batch or max(count, 1), list[Solutions]()
    for first in range(0, max(count, 1), batch):
        rows = slice(first, first + batch)
        options = barrier if isinstance(barrier, InteriorPointOptions) else barrier[rows]
        parts.append(minimise(program, x[rows], weights[rows], upper[rows], options, solver=solver))
        if observe is not None:
            observe(min(first + batch, count), count)
    return concatenate(parts)


# Local minima from known points: a known point is never replaced by a worse one.


@dataclass(frozen=True, kw_only=True)
class WarmStartOptions:
    """Settings of minimisation from known points."""

    # tried in order until one leads to a better point; a barrier above 1e-3 may leave the basin of a point
    barriers: tuple[InteriorPointOptions, ...] = (
        InteriorPointOptions(barrier=1e-4, radius=0.02),
        InteriorPointOptions(barrier=1e-6, radius=0.02),
        InteriorPointOptions(barrier=1e-3, radius=0.02),
    )
    # largest loss by which a solution still shows that its start is optimal, as a share of the start's objective
    rounding: float = 1e-7


WARM_OPTIONS = WarmStartOptions()


def evaluate_points(program: Program, x: Points) -> Solutions:
    """Return points as solutions, with objectives and violations, none of them marked as optimal."""
    ends = [program.evaluate(one) for one in x]
    violation = [violation_of(program, *each) for each in ends]
    return Solutions(
        x=np.array(x),
        objectives=np.array([objectives for objectives, _, _ in ends]).reshape(len(x), len(program.upper)),
        bound_multipliers=np.full((len(x), len(program.upper)), np.nan),
        stationarity=np.full(len(x), np.inf),
        violation=np.array(violation),
        status=np.full(len(x), NO_PROGRESS),
        iterations=np.zeros(len(x), dtype=int),
    )


def minimise_from(
    program: Program, x: Points, weights: Float[np.ndarray, " n_obj"], *, solver: Solver = "auto"
) -> Solutions:
    """Return the local minima of weights · F that points lead to.

    No minimum is worse than a feasible start. If no barrier improves a feasible start, it is returned: as converged if
    a solution equals it within rounding, else with the status ``NO_PROGRESS``.
    """
    factors = np.pad(weights, (0, len(program.upper) - len(weights)))
    starts = evaluate_points(program, x)
    feasible = starts.violation <= FEASIBLE
    start_merit = np.where(feasible, starts.objectives @ factors, np.inf)
    solutions, best = starts[:], start_merit.copy()
    optimal, unsolved = np.zeros(len(x), dtype=bool), np.ones(len(x), dtype=bool)
    for barrier in WARM_OPTIONS.barriers:
        rows = np.flatnonzero(unsolved)
        if not len(rows):
            break
        ends = minimise_weighted(program, x[rows], weights[None], None, barrier, solver=solver)
        merit = np.where(ends.converged, ends.objectives @ factors, np.inf)
        better = np.zeros(len(x), dtype=bool)
        better[rows] = merit < best[rows]
        solutions = solutions.replace_rows(better, ends[better[rows]])
        best[rows] = np.minimum(best[rows], merit)
        near = merit <= start_merit[rows] + WARM_OPTIONS.rounding * np.abs(start_merit[rows])
        optimal[rows] |= near & np.isfinite(merit)
        unsolved = ~optimal
    solutions.status[optimal] = CONVERGED
    return solutions


def insert_best(optima: Solutions, others: Solutions, weights: Float[np.ndarray, " n_obj"]) -> Solutions:
    """Return the optima; before them the best feasible one of ``others``, if it is better than all optima."""
    feasible = others[others.violation <= FEASIBLE]
    if not len(feasible):
        return optima
    factors = np.pad(weights, (0, feasible.objectives.shape[1] - len(weights)))
    merit, optima_merit = feasible.objectives @ factors, optima.objectives[optima.converged] @ factors
    best = int(np.argmin(merit))
    better = merit[best] < optima_merit.min(initial=np.inf)
    return concatenate((feasible[best : best + 1], optima)) if better else optima


# Cold searches: local optima without known points, for ε-sweeps; and one that starts from given points.


@dataclass(frozen=True, kw_only=True)
class ColdSearchOptions:
    """Settings of cold searches."""

    starts: int = 48  # default number of starts
    weight: float = 1e-3  # weight of the other objectives when one is minimised; without it they may be unbounded
    initial: int = 4  # number of initial points, the best in an objective, from which its optima are searched
    batch: int = 4  # number of starts between two calls of the observer
    distinct: float = 0.01  # distance (rad or m, RMS) below which points are one
    # barrier, second_barrier: solver settings of the first and the second attempt
    barrier: InteriorPointOptions = InteriorPointOptions(barrier=1e-2)
    second_barrier: InteriorPointOptions = InteriorPointOptions(barrier=0.1)


COLD_OPTIONS = ColdSearchOptions()


@runtime_checkable
class ColdSearch(Protocol):
    """A formulation's search for local optima without known points."""

    @property
    def multimodal(self) -> bool:
        """Whether there are many local optima."""

    def optima(self, objective: int) -> Points:
        """Return the local optima of one objective alone, best first.

        Raises Infeasible or SolverFailed if none is found.
        """

    def optima_below(
        self, program: Program, main: int, upper: Float[np.ndarray, " n_obj"], weight: float
    ) -> Solutions | None:
        """Return an objective's optima from cold starts, with the others below ``upper``.

        The objectives of ``program`` are divided by their ranges; the others count with ``weight``.
        """


@dataclass(frozen=True, kw_only=True, eq=False)
class StartSearch:
    """A ``ColdSearch`` that minimises from given ``starts``."""

    program_of: Callable[[Float[np.ndarray, " n_obj"]], Program]
    starts: Points
    names: Sequence[str]
    solver: Solver = "auto"
    observe: Observe | None = None
    multimodal: bool = True

    @property
    def n_obj(self) -> int:
        """Number of objectives."""
        return len(self.names)

    def optima(self, objective: int) -> Points:
        """Return one objective's local optima, best first.

        The other objectives have a small weight. Raises SolverFailed if no start leads to a point within all limits.
        """
        natural = self.program_of(np.ones(self.n_obj))
        values = np.array([natural.evaluate(x)[0][: self.n_obj] for x in self.starts]).reshape(-1, self.n_obj)
        sizes = np.median(np.abs(values), axis=0) if len(values) else np.ones(self.n_obj)
        program = self.program_of(np.where(sizes > 0, sizes, 1.0))
        alone = replace(self, observe=naming_objective(self.observe, self.names, objective))
        solutions = alone.optima_below(program, objective, np.full(self.n_obj, np.inf), COLD_OPTIONS.weight)
        if not len(solutions):
            raise SolverFailed("epsilon_front: at least one start must lead to a point within all limits, got none")
        return solutions.x

    def optima_below(self, program: Program, main: int, upper: Float[np.ndarray, " n_obj"], weight: float) -> Solutions:
        """Return one objective's optima, best first, with the others below ``upper``."""
        weights = main_weights(self.n_obj, np.array([main]), weight)

        def solve(starts: Points, barrier: InteriorPointOptions) -> Solutions:
            return minimise_weighted(
                program,
                starts,
                weights,
                upper[None],
                barrier,
                solver=self.solver,
                batch=COLD_OPTIONS.batch,
                observe=self.observe,
            )

        solutions = solve(self.starts, COLD_OPTIONS.barrier)
        failed = ~solutions.converged
        if failed.any():
            solutions = solutions.replace_rows(failed, solve(self.starts[failed], COLD_OPTIONS.second_barrier))
        merit = np.where(solutions.converged, solutions.objectives[:, : self.n_obj] @ weights[0], np.inf)
        return solutions[np.argsort(merit, kind="stable")[: int(solutions.converged.sum())]]


def naming_objective(observe: Observe | None, names: Sequence[str], objective: int) -> Observe | None:
    """Return an observer that also gets the current objective in words."""
    words = f"{names[objective]} ({objective + 1} of {len(names)})"

    def show(done: int, total: int, summary: str = "") -> object:
        assert observe is not None
        return observe(done, total, f"{words}, {summary}" if summary else words)

    return None if observe is None else show


def optima_alone(
    program_of: Callable[[Float[np.ndarray, " n_obj"]], Program],
    cold: ColdSearch,
    objective: int,
    n_obj: int,
    initial: Float[np.ndarray, " initial *point"] | None,
    solver: Solver,
) -> Points:
    """Return one objective's optima, best first, also from feasible ``initial`` points.

    From initial points the other objectives have a small weight: without it, one of them could rise without bound along
    a direction in which the first does not change. Raises the errors of ``cold`` if there are no initial points.
    """
    if initial is None or not len(initial):
        return cold.optima(objective)
    natural = program_of(np.ones(n_obj))
    sizes = objective_sizes(natural, initial, n_obj)
    program = program_of(np.where(sizes > 0, sizes, 1.0))
    values = np.array([natural.evaluate(one)[0][objective] for one in initial])
    initial = initial[np.argsort(values, kind="stable")[: COLD_OPTIONS.initial]]
    weights = main_weights(n_obj, np.array([objective]), COLD_OPTIONS.weight)[0]
    x = minimise_from(program, initial, weights, solver=solver).x
    with suppress(Infeasible, SolverFailed):  # initial points are enough
        x = np.concatenate([cold.optima(objective), x])
    values = np.array([natural.evaluate(one)[0][objective] for one in x])
    rows = list[int]()
    for i in np.argsort(values, kind="stable").tolist():
        if not rows or program.distance(x[i], x[rows]).min() > COLD_OPTIONS.distinct:
            rows.append(i)
    return np.asarray(x[rows])
