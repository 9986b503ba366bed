"""Objectives made one: divided by their ranges, weighted, and bounded from above by ε."""

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
"""Called with what is done and with all there is to do; by a cold search of motions also with what they violate."""


def objective_sizes(program: Program, x: Points, n_obj: int) -> Float[np.ndarray, " n_obj"]:
    """Return the size of every objective at points: the largest of |F|, and of what F changes by in a step of length 1.

    The second is to first order, along the gradient (rad, RMS): optima may have values of nothing but rounding. What an
    objective owes to auxiliary variables has no such length and does not count.
    """
    at = [program.linearise(one) for one in x]
    values = np.array([each.objectives[:n_obj] for each in at])
    slopes = [np.linalg.norm(each.gradients[:n_obj, : each.unknowns], axis=1) for each in at]
    changes = np.array([slope * each.unit for slope, each in zip(slopes, at, strict=True)])
    return np.asarray(np.maximum(np.abs(values), changes).max(axis=0))


def main_weights(n_obj: int, mains: Int[np.ndarray, " rows"], weight: float | np.ndarray) -> np.ndarray:
    """Return weights (rows, n_obj): 1 for each row's main objective, ``weight``, one or (rows,), for the others."""
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
    """Return where points lead when weights · F is minimised with F below ``upper``; ``observe`` looks on batchwise.

    Only the first n_obj of the program's F are weighted and bounded. ``barrier`` is for all, or one a point. Workers
    are given all points at once, and looked on as they return them.
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


# Local minima from points that are known already: none of them is lost, whatever the barriers do.


@dataclass(frozen=True, kw_only=True)
class WarmStartOptions:
    """How points to start from are minimised.

    ``barriers`` are tried in turn, the next where one leads to nothing better: a barrier above 1e-3 may leave the basin
    of a point. A point counts as feasible up to ``violation``, a share of a limit's range. A solution that is worse by
    at most ``rounding``, a share of the objective's size, says that its start is optimal.
    """

    barriers: tuple[InteriorPointOptions, ...] = (
        InteriorPointOptions(barrier=1e-4, radius=0.02),
        InteriorPointOptions(barrier=1e-6, radius=0.02),
        InteriorPointOptions(barrier=1e-3, radius=0.02),
    )
    violation: float = 1e-8
    rounding: float = 1e-7


WARM_OPTIONS = WarmStartOptions()


def evaluate_points(program: Program, x: Points) -> Solutions:
    """Return points as they are, with their objectives and violations; none of them is said to be optimal."""
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


def feasible_points(program: Program, x: Points | None) -> Float[np.ndarray, " feasible *point"] | None:
    """Return the points within all limits; None for none."""
    return None if x is None else np.asarray(x[evaluate_points(program, x).violation <= WARM_OPTIONS.violation])


def minimise_from(
    program: Program, x: Points, weights: Float[np.ndarray, " n_obj"], *, solver: Solver = "auto"
) -> Solutions:
    """Return the local minima of weights · F that points lead to; none is worse than its start where that is feasible.

    A feasible start from which no barrier leads to anything better is returned as it is: as converged where a solution
    is as good to rounding, else as one that no step makes better.
    """
    factors = np.pad(weights, (0, len(program.upper) - len(weights)))
    starts = evaluate_points(program, x)
    feasible = starts.violation <= WARM_OPTIONS.violation
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
    """Return optima, and of feasible others the best in front of them where it is better than all."""
    feasible = others[others.violation <= WARM_OPTIONS.violation]
    if not len(feasible):
        return optima
    factors = np.pad(weights, (0, feasible.objectives.shape[1] - len(weights)))
    merit, optima_merit = feasible.objectives @ factors, optima.objectives[optima.converged] @ factors
    best = int(np.argmin(merit))
    better = merit[best] < optima_merit.min(initial=np.inf)
    return concatenate((feasible[best : best + 1], optima)) if better else optima


# Local optima from nothing: what ε-sweeps ask for, and it for programs whose starts are points like any other.


@dataclass(frozen=True, kw_only=True)
class ColdSearchOptions:
    """So many ``starts`` there are where nobody says how many.

    ``weight`` is that of the other objectives where one is minimised alone: alone they may have no least value.

    So many starts are led at a time as ``batch`` says: in between somebody may look. Points nearer than ``distinct``
    (rad or m, RMS) are one. Of initial points so many lead to optima of an objective, the best in it.
    """

    starts: int = 48
    weight: float = 1e-3
    initial: int = 4
    batch: int = 4
    distinct: float = 0.01
    barrier: InteriorPointOptions = InteriorPointOptions(barrier=1e-2)
    second_barrier: InteriorPointOptions = InteriorPointOptions(barrier=0.1)


COLD_OPTIONS = ColdSearchOptions()


@runtime_checkable
class ColdSearch(Protocol):
    """How a formulation finds local optima from nothing; with ``multimodal`` basins many neighbours differ."""

    multimodal: bool

    def optima(self, objective: int) -> Points:
        """Return the local optima of one objective alone, best first.

        Raises Infeasible or SolverFailed where there is none.
        """

    def optima_below(
        self, program: Program, main: int, upper: Float[np.ndarray, " n_obj"], weight: float
    ) -> Solutions | None:
        """Return what cold starts lead to for one objective, the others below ``upper``; None where nowhere.

        Objectives are those of ``program``, divided by their ranges; the others count with ``weight``.
        """


@dataclass(frozen=True, kw_only=True, eq=False)
class StartSearch:
    """Minimises from every one of ``starts``; a ``ColdSearch``. ``names`` are those of the objectives."""

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
        """Return the local optima of one objective, nearly alone, best first.

        Raises SolverFailed where no start leads to a point within all limits.
        """
        natural = self.program_of(np.ones(self.n_obj))
        values = np.array([natural.evaluate(x)[0][: self.n_obj] for x in self.starts]).reshape(-1, self.n_obj)
        sizes = np.median(np.abs(values), axis=0) if len(values) else np.ones(self.n_obj)
        program = self.program_of(np.where(sizes > 0, sizes, 1.0))
        alone = replace(self, observe=naming_objective(self.observe, self.names, objective))
        solutions = alone.optima_below(program, objective, np.full(self.n_obj, np.inf), COLD_OPTIONS.weight)
        if not len(solutions):
            raise SolverFailed("epsilon_front: a start that leads to a point within all limits wanted, found none")
        return solutions.x

    def optima_below(self, program: Program, main: int, upper: Float[np.ndarray, " n_obj"], weight: float) -> Solutions:
        """Return what the starts lead to for one objective, the others below ``upper``, best first."""
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
    """Return an observer that is told which objective of how many is planned."""
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
    """Return the local optima of one objective alone, best first; also those that feasible ``initial`` points lead to.

    From these the other objectives count a little: without, one of them may rise beyond all bounds where a direction
    costs the first nothing.
    Raises what ``cold`` does where there are no initial points.
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
    with suppress(Infeasible, SolverFailed):  # the initial points will do
        x = np.concatenate([cold.optima(objective), x])
    values = np.array([natural.evaluate(one)[0][objective] for one in x])
    rows = list[int]()
    for i in np.argsort(values, kind="stable").tolist():
        if not rows or program.distance(x[i], x[rows]).min() > COLD_OPTIONS.distinct:
            rows.append(i)
    return np.asarray(x[rows])
