"""Local optima from nothing: what ε-sweeps ask for, and it for programs whose starts are points like any other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.errors import Infeasible, SolverFailed
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.program import Program, Solver
from paretoik.nlp.solutions import Solutions
from paretoik.pareto.scalarisation import Observe, main_weights, minimise_weighted, objective_sizes
from paretoik.pareto.warm_start import minimise_from


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


OPTIONS = ColdSearchOptions()


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
        solutions = alone.optima_below(program, objective, np.full(self.n_obj, np.inf), OPTIONS.weight)
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
                batch=OPTIONS.batch,
                observe=self.observe,
            )

        solutions = solve(self.starts, OPTIONS.barrier)
        failed = ~solutions.converged
        if failed.any():
            solutions = solutions.replace_rows(failed, solve(self.starts[failed], OPTIONS.second_barrier))
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
    initial = initial[np.argsort(values, kind="stable")[: OPTIONS.initial]]
    weights = main_weights(n_obj, np.array([objective]), OPTIONS.weight)[0]
    x = minimise_from(program, initial, weights, solver=solver).x
    with suppress(Infeasible, SolverFailed):  # the initial points will do
        x = np.concatenate([cold.optima(objective), x])
    values = np.array([natural.evaluate(one)[0][objective] for one in x])
    rows = list[int]()
    for i in np.argsort(values, kind="stable").tolist():
        if not rows or program.distance(x[i], x[rows]).min() > OPTIONS.distinct:
            rows.append(i)
    return np.asarray(x[rows])
