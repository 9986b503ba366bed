"""Local optima from nothing: what ε-sweeps ask for, and it for programs whose starts are points like any other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.errors import SolverFailed
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import Program, Solver
from paretoik.nlp.solutions import Solutions, concatenate


@dataclass(frozen=True, kw_only=True)
class ColdSearchOptions:
    """``weight`` is that of the other objectives where one is minimised alone: alone they may have no least value.

    So many starts are led at a time as ``batch`` says: in between somebody may look.
    """

    weight: float = 1e-3
    batch: int = 4
    barrier: InteriorPointOptions = InteriorPointOptions(barrier=1e-2)


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
    """Minimises from every one of ``starts``; a ``ColdSearch``."""

    program_of: Callable[[Float[np.ndarray, " n_obj"]], Program]
    starts: Points
    n_obj: int
    solver: Solver = "auto"
    observe: Callable[[int, int], object] | None = None
    multimodal: bool = True

    def optima(self, objective: int) -> Points:
        """Return the local optima of one objective, nearly alone, best first.

        Raises SolverFailed where no start leads to a point within all limits.
        """
        starts = self.starts[np.isfinite(self.starts).reshape(len(self.starts), -1).all(axis=1)]
        natural = self.program_of(np.ones(self.n_obj))
        values = np.array([natural.evaluate(x)[0][: self.n_obj] for x in starts]).reshape(-1, self.n_obj)
        sizes = np.median(np.abs(values), axis=0) if len(starts) else np.ones(self.n_obj)
        program = self.program_of(np.where(sizes > 0, sizes, 1.0))
        solutions = self._minimise(program, starts, objective, np.full(self.n_obj, np.inf), OPTIONS.weight)
        if not len(solutions):
            raise SolverFailed("epsilon_front: a start that leads to a point within all limits wanted, found none")
        return solutions.x

    def optima_below(self, program: Program, main: int, upper: Float[np.ndarray, " n_obj"], weight: float) -> Solutions:
        """Return what the starts lead to for one objective, the others below ``upper``, best first."""
        starts = self.starts[np.isfinite(self.starts).reshape(len(self.starts), -1).all(axis=1)]
        return self._minimise(program, starts, main, upper, weight)

    def _minimise(self, program: Program, starts: Points, main: int, upper: np.ndarray, weight: float) -> Solutions:
        factors, bounds = np.zeros((1, len(program.upper))), np.full((1, len(program.upper)), np.inf)
        factors[0, : self.n_obj] = weight
        factors[0, main] = 1.0
        bounds[0, : self.n_obj] = upper
        parts = list[Solutions]()
        for first in range(0, max(len(starts), 1), OPTIONS.batch):
            x = starts[first : first + OPTIONS.batch]
            parts.append(minimise(program, x, factors, bounds, OPTIONS.barrier, solver=self.solver))
            if self.observe is not None:
                self.observe(first + len(x), len(starts))
        solutions = concatenate(parts)
        merit = np.where(solutions.converged, solutions.objectives @ factors[0], np.inf)
        return solutions[np.argsort(merit, kind="stable")[: int(solutions.converged.sum())]]
