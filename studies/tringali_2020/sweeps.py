"""The front as the paper sweeps it: evenly spaced ε between the ends, for either objective (Eqs. 21, 22).

The paper has ε as an equality; here that is an option next to the inequality, and a row shows its cost. Every ε starts
from all optima of both single objectives.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.front.indicators import hypervolume, non_dominated
from paretoik.nlp.minimise import minimise
from paretoik.pareto.sweep import OPTIONS
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.transcription import motion_program
from studies.reporting import Row
from studies.tringali_2020.simulations import Simulation, as_printed, with_arm
from studies.tringali_2020.trade_off import TABLE, TradeOff

BEYOND = 0.1  # of the ranges, beyond the worse end: the reference point of the hypervolume
LEFT_OPEN = 1e-6  # of the ranges: tolerance of solvers


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """The points of a sweep of ``levels`` for each objective, those that exist, and its seconds."""

    objectives: Float[np.ndarray, "points 2"]
    levels: int
    seconds: float


def sweep(
    task: MotionTask,
    starts: Float[np.ndarray, "starts time dof"],
    ends: Float[np.ndarray, "2 2"],
    *,
    levels: int,
    equality: bool,
) -> Sweep:
    """Return the best of each objective with the other below, or equal to, each of ``levels`` ε between its ends.

    ``ends`` are the objectives (one row each) of each one's own optimum.
    """
    begin, ranges = time.perf_counter(), np.ptp(ends, axis=0)
    program, points = motion_program(task, ranges), list[np.ndarray]()
    x = np.tile(starts, (levels, 1, 1))
    for main, other in ((0, 1), (1, 0)):
        epsilon = np.linspace(ends[other, other], ends[main, other], levels + 1)[1:] / ranges[other]
        rows = np.eye(2)[[other, other]] * [[1.0], [-1.0]]  # F ≤ ε, −F ≤ −ε
        bounds = np.stack([epsilon, -epsilon if equality else np.full(levels, np.inf)], axis=1)
        solutions = minimise(
            program, x, np.eye(2)[[main]], np.repeat(bounds, len(starts), axis=0), OPTIONS.warm, rows=rows
        )
        for of_level in np.arange(len(x)).reshape(levels, -1):
            converged = of_level[solutions.converged[of_level]]
            if len(converged):
                best = converged[np.argmin(solutions.objectives[converged, main])]
                points.append(solutions.objectives[best] * ranges)
    return Sweep(objectives=np.array(points).reshape(-1, 2), levels=levels, seconds=time.perf_counter() - begin)


def sweep_rows(simulations: list[Simulation], trade_off: TradeOff, *, points: int) -> list[Row]:
    """Return the hypervolume of one arm's sweeps with ε as bound and as equality, and our front's."""
    alone = simulations[1:3]  # the optima of either objective within the same limits
    task = with_arm(as_printed("energy_torque"), trade_off.masses).task
    ends = np.array([[float(each(one.motion)) for each in task.objectives] for one in alone])
    starts = np.concatenate([np.stack([optimum.motion.q for optimum in one.plan.optima]) for one in alone])
    ranges, worst = np.ptp(ends, axis=0), ends.max(axis=0)

    def share(F: np.ndarray) -> float:
        return hypervolume(F / ranges, worst / ranges + BEYOND)

    rows, ours = [], share(trade_off.front.objectives)
    for name, equality in (("below", False), ("equal", True)):
        swept = sweep(task, starts, ends, levels=points // 2, equality=equality)
        F, count = swept.objectives, 2 * swept.levels
        dominated = len(F) - int(non_dominated(F / ranges, LEFT_OPEN).sum())
        rows.append(
            Row(
                table=f"{TABLE}, {trade_off.masses} masses",
                row=f"{count} evenly spaced ε, {name}",
                column="hypervolume",
                unit="",
                ours=share(F),
                reference=ours,
                source="ours",
                note=f"{100 * (share(F) / ours - 1):+.2f} % relative to our {len(trade_off.front)} points; "
                f"{len(F)} of {count} solved, {dominated} of them dominated or repeated; {swept.seconds:.2f} s"
                + ("; Eqs. 21 and 22 as printed" if equality else ""),
            )
        )
    return rows
