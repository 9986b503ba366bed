"""Points of a front refined by gradients: each to a local optimum that is no worse in any objective."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.arrays import Points
from paretoik.errors import EvaluationFailed, SolverFailed
from paretoik.interruption import Interrupted, check_interruption
from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import Program, Solver
from paretoik.nlp.solutions import Solutions
from paretoik.pareto.certificates import criticality_at
from paretoik.pareto.scalarisation import Observe
from paretoik.pareto.violation import violation_at
from paretoik.pareto.warm_start import evaluate_points


@dataclass(frozen=True, kw_only=True)
class RefineOptions:
    """How points are refined; objectives are divided by their ranges.

    ``weight`` is that of the sum of all objectives beside the first: no gain is left that costs next to nothing. A
    point is left as it is where its criticality is at most ``critical`` and its violation at most ``violation``. So
    many points are refined at a time as ``batch`` says: in between somebody may look, or end it. ``warm`` is tried
    first, ``near`` and ``cold`` where that does not converge, or where an objective rises by more than ``rise``, a
    share of its range.
    """

    weight: float = 0.1
    critical: float = 1e-8
    violation: float = 1e-8
    rise: float = 1e-9
    batch: int = 4
    warm: InteriorPointOptions = InteriorPointOptions(barrier=1e-4, radius=0.02)
    near: InteriorPointOptions = InteriorPointOptions(barrier=1e-6, radius=0.02)
    cold: InteriorPointOptions = InteriorPointOptions(barrier=0.1, radius=0.2)


OPTIONS = RefineOptions()


def refine(
    program: Program, x: Points, n_obj: int, *, solver: Solver = "auto", observe: Observe | None = None
) -> tuple[Points, Bool[np.ndarray, " points"]]:
    """Return points, none worse than it was, and which are local optima now.

    The first objectives of the program are those of the front, divided by their ranges. The first is minimised, every
    other to gain as much, so that each point goes straight ahead and none to where its neighbours go (Pascoletti &
    Serafini 1984). Points that are critical stay, and so do those from which no solver finds better. Where ``observe``
    returns true, and after a signal, the others stay as they are.
    """
    x, converged = x.copy(), np.zeros(len(x), dtype=bool)
    weights = np.zeros((1, len(program.upper)))
    weights[0, :n_obj] = OPTIONS.weight
    weights[0, 0] += 1.0
    ahead = np.eye(n_obj, len(program.upper))
    ahead[1:, 0] = -1.0  # F_j − F_0
    for first in range(0, len(x), OPTIONS.batch):
        rows = np.arange(first, min(first + OPTIONS.batch, len(x)))
        try:
            _refine_rows(program, x, converged, rows, weights, ahead, solver)
        except Interrupted:
            break
        if observe is not None and observe(int(rows[-1]) + 1, len(x)):
            break
    return x, converged


def _refine_rows(
    program: Program,
    x: Points,
    converged: Bool[np.ndarray, " points"],
    rows: Int[np.ndarray, " rows"],
    weights: Float[np.ndarray, "1 objectives"],
    ahead: Float[np.ndarray, "n_obj objectives"],
    solver: Solver,
) -> None:
    """Refine some of the points in place. Raises Interrupted after a signal, with what converged by then kept."""
    for i in rows:
        check_interruption()
        converged[i] = _is_critical(program, x[i], len(ahead))
    for barrier in (OPTIONS.warm, OPTIONS.near, OPTIONS.cold):
        rest = rows[~converged[rows]]
        if not len(rest):
            return
        upper = np.array([ahead @ program.evaluate(one)[0] for one in x[rest]])
        try:
            solutions = minimise(program, x[rest], weights, upper, barrier, rows=ahead, solver=solver)
        except Interrupted as stop:
            if stop.partial is not None:
                _keep(program, x, converged, rest, stop.partial, len(ahead))
            raise
        _keep(program, x, converged, rest, solutions, len(ahead))


def _keep(
    program: Program,
    x: Points,
    converged: Bool[np.ndarray, " points"],
    rows: Int[np.ndarray, " rows"],
    solutions: Solutions,
    n_obj: int,
) -> None:
    """Replace points by solutions that are no worse: where these are feasible, although not yet optimal, too."""
    better = _no_worse(program, x[rows], solutions, n_obj)
    feasible = solutions.violation <= OPTIONS.violation
    good = better & (solutions.converged | (feasible & np.isfinite(solutions.objectives).all(axis=1)))
    x[rows[good]] = solutions.x[good]
    converged[rows[good]] = solutions.converged[good]


def _no_worse(program: Program, x: Points, solutions: Solutions, n_obj: int) -> Bool[np.ndarray, " points"]:
    """Return which solutions are no worse in any objective than the points they came of, where these are feasible."""
    before = evaluate_points(program, x)
    rise = (solutions.objectives - before.objectives)[:, :n_obj].max(axis=1)
    return (rise <= OPTIONS.rise) | (before.violation > OPTIONS.violation)


def _is_critical(program: Program, x: np.ndarray, n_obj: int) -> bool:
    try:
        at = program.linearise(x)
        if violation_at(program, at) > OPTIONS.violation:
            return False
        return criticality_at(program, at, np.ones(n_obj)).value <= OPTIONS.critical
    except (SolverFailed, EvaluationFailed):
        return False
