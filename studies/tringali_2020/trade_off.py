"""Kinetic energy against torque norm, joint positions and velocities limited: Figure 14."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.front.hypervolume import hypervolume, non_dominated
from paretoik.nlp.minimise import minimise
from paretoik.pareto.sweep import OPTIONS
from paretoik.task.motion_task import MotionTask
from paretoik.task.self_motion import branch_labels
from paretoik.trajectory.transcription import motion_program
from studies.reporting import Row
from studies.tringali_2020.simulations import Simulation, as_printed, beside, machine, paper, with_arm

TABLE = "Figure 14"
OFF = 1e-3  # of the front's range: no weights find points farther above the hull
DRAWN = "the paper draws its front, without numbers"


class TradeOff(NamedTuple):
    """The front with the arm of these masses, and the seconds it took."""

    masses: str
    front: pk.Front
    seconds: float


def solve_trade_off(masses: str, *, points: int, starts: int, rehearsed: bool = True) -> TradeOff:
    """Return the front of one arm; ``rehearsed``: a short one that compiles comes first, untimed."""
    problem = with_arm(as_printed("energy_torque"), masses)
    if rehearsed:
        with suppress(pk.ParetoikError):  # a few starts may find nothing
            pk.epsilon_front(problem, points=2, starts=4)
    started = time.perf_counter()
    front = pk.epsilon_front(problem, points=points, starts=starts)
    return TradeOff(masses, front, time.perf_counter() - started)


def figure_14(trade_off: TradeOff) -> list[Row]:
    """Return the rows of one arm: the ends, the simulations with the same objectives, and certificates."""
    front, masses, (energy, torque) = trade_off.front, trade_off.masses, trade_off.front.objectives.T
    certificates = front.certificates
    assert certificates is not None
    assert isinstance(front.motions, pk.Motion)
    rows = []
    for name, end, simulation in (("energy end", 0, 2), ("torque end", -1, 3)):
        for column, unit, values in (("kinetic energy", "J s", energy), ("torque norm", "N²m²s", torque)):
            theirs = paper()["Table 5", f"simulation {simulation}", column]
            note = f"{100 * (values[end] / theirs - 1):+.2f} %; theirs: simulation {simulation}; {DRAWN}"
            rows.append(_row(masses, name, column, unit, float(values[end]), note, theirs))
    minima, bends = int(np.sum(certificates.status == "minimum")), sorted(set(branch_labels(front.motions)))
    corners = front.shares[hull(front)]
    off = int(np.sum(front.shares[:, 1] > np.interp(front.shares[:, 0], *corners.T) + OFF))
    weights = "the paper: if the front is not convex, ε-constraints find what weights cannot"
    worst, between = float(certificates.violation.max()), float(certificates.violation_between.max())
    inequality = "ε as an inequality; what the printed equality costs: below"
    rows += [
        _row(masses, "front", "points", "", len(front), f"{inequality}; bends {', '.join(bends)}"),
        _row(masses, "front", "certified minima", "", minima, "by second-order certificates; locally"),
        _row(masses, "front", "worst criticality", "", float(certificates.criticality.max()), "share of the ranges"),
        _row(masses, "front", "worst violation", "", max(worst, 0.0), f"{between:.1e} between samples"),
        _row(masses, "front", "points off the convex hull", "", off, weights),
        _row(masses, "front", "time", "s", trade_off.seconds, f"ours: {machine()}"),
    ]
    return rows


def _row(masses: str, row: str, column: str, unit: str, ours: float, note: str, theirs: float | None = None) -> Row:
    table = beside(TABLE, masses, row, column, unit, ours).table
    return Row(table, row, column, unit, ours, reference=theirs, note=note)


def hull(front: pk.Front) -> list[int]:
    """Return which points, in order of the first objective, are on the lower convex hull: weights find only these."""
    points = front.shares
    corners: list[int] = []
    for i in np.argsort(points[:, 0], kind="stable").tolist():
        while len(corners) > 1:
            (a, b), (c, d) = np.diff(points[[*corners[-2:], i]], axis=0)
            if a * d - b * c > 0:  # it turns left
                break
            corners.pop()
        corners.append(i)
    return corners


BEYOND = 0.1  # of the ranges, beyond the worse end: the reference point of the hypervolume
LEFT_OPEN = 1e-6  # of the ranges: tolerance of solvers


class Sweep(NamedTuple):
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
    return Sweep(np.array(points).reshape(-1, 2), levels, time.perf_counter() - begin)


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
        note = (
            f"{100 * (share(F) / ours - 1):+.2f} % relative to our {len(trade_off.front)} points; "
            f"{len(F)} of {count} solved, {dominated} of them dominated or repeated; {swept.seconds:.2f} s"
            + ("; Eqs. 21 and 22 as printed" if equality else "")
        )
        table = f"{TABLE}, {trade_off.masses} masses"
        row = f"{count} evenly spaced ε, {name}"
        rows.append(Row(table, row, "hypervolume", "", share(F), reference=ours, source="ours", note=note))
    return rows
