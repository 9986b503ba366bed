"""Kinetic energy against torque norm, joint positions and velocities limited: Figure 14."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

import paretoik as pk
from paretoik.task.self_motion import branch_labels
from studies.reporting import Row
from studies.tringali_2020.reported import beside, paper
from studies.tringali_2020.simulations import as_printed, machine, with_arm

TABLE = "Figure 14"
OFF = 1e-3  # of the front's range: no weights find points farther above the hull
DRAWN = "the paper draws its front, without numbers"


@dataclass(frozen=True, kw_only=True, eq=False)
class TradeOff:
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
    return TradeOff(masses=masses, front=front, seconds=time.perf_counter() - started)


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
    off = int(off_hull(front).sum())
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
    return Row(table=table, row=row, column=column, unit=unit, ours=ours, reference=theirs, note=note)


def hull(front: pk.Front) -> list[int]:
    """Return which points, in order of the first objective, are on the lower convex hull: weights find only these."""
    points = front.shares
    corners: list[int] = []
    for i in np.argsort(points[:, 0], kind="stable").tolist():
        while len(corners) > 1 and _turn(points[corners[-2]], points[corners[-1]], points[i]) <= 0:
            corners.pop()
        corners.append(i)
    return corners


def _turn(before: np.ndarray, here: np.ndarray, after: np.ndarray) -> float:
    (a, b), (c, d) = here - before, after - here
    return float(a * d - b * c)


def off_hull(front: pk.Front) -> Bool[np.ndarray, " points"]:
    """Return which points lie above the lower convex hull by more than ``OFF`` of the range."""
    corners = front.shares[hull(front)]
    below = np.interp(front.shares[:, 0], corners[:, 0], corners[:, 1])
    return np.asarray(front.shares[:, 1] > below + OFF)
