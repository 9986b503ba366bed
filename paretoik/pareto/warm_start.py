"""Local minima from points that are known already: none of them is lost, whatever the barriers do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.program import Program, Solver
from paretoik.nlp.solutions import CONVERGED, NO_PROGRESS, Solutions, concatenate
from paretoik.nlp.violation import violation_of
from paretoik.pareto.scalarisation import minimise_weighted


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


OPTIONS = WarmStartOptions()


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
    return None if x is None else np.asarray(x[evaluate_points(program, x).violation <= OPTIONS.violation])


def minimise_from(
    program: Program, x: Points, weights: Float[np.ndarray, " n_obj"], *, solver: Solver = "auto"
) -> Solutions:
    """Return the local minima of weights · F that points lead to; none is worse than its start where that is feasible.

    A feasible start from which no barrier leads to anything better is returned as it is: as converged where a solution
    is as good to rounding, else as one that no step makes better.
    """
    factors = np.pad(weights, (0, len(program.upper) - len(weights)))
    starts = evaluate_points(program, x)
    feasible = starts.violation <= OPTIONS.violation
    start_merit = np.where(feasible, starts.objectives @ factors, np.inf)
    solutions, best = starts[:], start_merit.copy()
    optimal, unsolved = np.zeros(len(x), dtype=bool), np.ones(len(x), dtype=bool)
    for barrier in OPTIONS.barriers:
        rows = np.flatnonzero(unsolved)
        if not len(rows):
            break
        ends = minimise_weighted(program, x[rows], weights[None], None, barrier, solver=solver)
        merit = np.where(ends.converged, ends.objectives @ factors, np.inf)
        better = np.zeros(len(x), dtype=bool)
        better[rows] = merit < best[rows]
        solutions = solutions.replace_rows(better, ends[better[rows]])
        best[rows] = np.minimum(best[rows], merit)
        near = merit <= start_merit[rows] + OPTIONS.rounding * np.abs(start_merit[rows])
        optimal[rows] |= near & np.isfinite(merit)
        unsolved = ~optimal
    solutions.status[optimal] = CONVERGED
    return solutions


def insert_best(optima: Solutions, others: Solutions, weights: Float[np.ndarray, " n_obj"]) -> Solutions:
    """Return optima, and of feasible others the best in front of them where it is better than all."""
    feasible = others[others.violation <= OPTIONS.violation]
    if not len(feasible):
        return optima
    factors = np.pad(weights, (0, feasible.objectives.shape[1] - len(weights)))
    merit, optima_merit = feasible.objectives @ factors, optima.objectives[optima.converged] @ factors
    best = int(np.argmin(merit))
    better = merit[best] < optima_merit.min(initial=np.inf)
    return concatenate((feasible[best : best + 1], optima)) if better else optima
