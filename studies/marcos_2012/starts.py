"""Influence of the start, which the paper does not print: exact loops of 3R from the whole self-motion.

One start may explain the paper's column: the study looks for one that gives its number at w = 0.5, and compares the
loop from there at all other weights with the printed numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from scipy.optimize import brentq

from problems import marcos_2012
from problems.marcos_2012 import DISTANCES, RADIUS
from studies.marcos_2012.exact_loop import exact_steps
from studies.marcos_2012.loops import WEIGHTS, Cell
from studies.marcos_2012.tables import ALIKE, MEASURES, paper
from studies.reporting import Row

STARTS = 48  # angles of the first link
WEIGHT = 0.5
BENT = 0.05  # m: if a circle begins nearer than this to the second joint, two links cannot be told apart
LEAP = 1.0  # rad: a loop with a longer step has met a singularity
NARROW = 1e-5  # rad: tolerance of a start's angle
UNITS = [measure.unit for measure in MEASURES.values()]


@dataclass(frozen=True, kw_only=True)
class ExactMeasures:
    """The mean position error [m] and the drift [rad] of an exact loop."""

    error: float
    drift: float


def exact_measures(distance: float, start: Float[np.ndarray, " dof"], weight: float) -> ExactMeasures | None:
    """Return the results of the exact loop of 3R from a start, None if it meets a singularity."""
    loop = marcos_2012.loop(3, distance, weight=weight, start=start, as_printed=True)
    moved = exact_steps(loop.task, start, weight=weight, longest_step=loop.longest)
    if not np.abs(np.diff(moved, axis=0)).max() < LEAP:
        return None
    error, drift = (float(measure(loop.task.motion(moved))) for measure in MEASURES.values())
    return ExactMeasures(error=error, drift=drift)


def start_rows(starts: int = STARTS) -> list[Row]:
    """Return the range of either number of a cell, and how much of a column one start explains."""
    rows = []
    for distance in DISTANCES:
        angles = np.linspace(-np.pi, np.pi, starts, endpoint=False).tolist()
        measures = {(angle, side): _exact_at(distance, angle, side) for side in (1, -1) for angle in angles}
        finite = [each for each in measures.values() if each is not None]
        for k, table in enumerate(("Table 1", "Table 2")):
            values = [each.drift if k else each.error for each in finite]
            printed = _printed(table, distance, WEIGHT)
            inside = "lies" if min(values) <= printed <= max(values) else "does NOT lie"
            rows.append(
                Row(
                    table="what the start decides: the exact loop of 3R from all over the self-motion",
                    row=f"{table}, r = {distance}, w = {WEIGHT}",
                    column="least",
                    unit=UNITS[k],
                    ours=min(values),
                    reference=printed,
                    note=f"to {max(values):.3g} over {len(values)} starts: the printed number {inside} between",
                )
            )
        rows += _explained_rows(distance, measures)
    return rows


def _explained_rows(distance: float, measures: dict[tuple[float, int], ExactMeasures | None]) -> list[Row]:
    """Return how much of the paper's columns a start explains that gives its error at w = 0.5.

    The error crosses the printed one between some of the angles that were tried; the crossing that explains most of the
    other cells is reported.
    """
    printed = np.array([[_printed(table, distance, w) for w in WEIGHTS] for table in ("Table 1", "Table 2")])
    target = _printed("Table 1", distance, WEIGHT)

    def above(angle: float, side: int) -> float:
        value = _exact_at(distance, angle, side)
        return np.nan if value is None else value.error - target

    columns = []
    for side in (1, -1):
        for low, high in pairwise(sorted(angle for angle, which in measures if which == side)):
            here, there = measures[low, side], measures[high, side]
            if here is None or there is None or (here.error - target) * (there.error - target) > 0:
                continue
            angle = float(brentq(above, low, high, args=(side,), xtol=NARROW))
            loops = [_exact_at(distance, angle, side, weight) for weight in WEIGHTS]
            if None not in loops:
                columns.append(
                    (angle, side, np.array([[one.error, one.drift] for one in loops if one]).T / printed - 1)
                )
    if not columns:
        return []
    angle, side, deviation = max(columns, key=lambda column: np.sum(np.abs(column[2][0]) <= ALIKE))
    q = posture(distance, angle, side)
    assert q is not None
    rows = []
    for k, table in enumerate(("Table 1", "Table 2")):
        agrees = np.abs(deviation[k]) <= ALIKE
        others = ", ".join(
            f"w = {w} ({1 + a:.3g} times)" for w, a, good in zip(WEIGHTS, deviation[k], agrees, strict=True) if not good
        )
        rows.append(
            Row(
                table=f"the start that gives the printed error at w = {WEIGHT}: its other cells within {ALIKE:.0%}",
                row=f"{table}, r = {distance}, 3R",
                column="cells",
                unit="",
                ours=int(agrees.sum()),
                reference=len(WEIGHTS),
                source="cells",
                note=f"q₀ = {np.array2string(q, precision=3)}, one of {len(columns)}; others: {others or 'none'}",
            )
        )
    return rows


def _exact_at(distance: float, angle: float, side: int, weight: float = WEIGHT) -> ExactMeasures | None:
    start = posture(distance, angle, side)
    return None if start is None else exact_measures(distance, start, weight)


def _printed(table: str, distance: float, weight: float) -> float:
    return paper()[table, Cell(links=3, distance=distance, blocked=False, weight=weight).row, "3R"]


def posture(distance: float, angle: float, side: int) -> Float[np.ndarray, " dof"] | None:
    """Return the posture of three unit links at a circle's beginning, by the angle of the first and the elbow's side.

    None if it does not exist, or if two links nearly fold onto each other or align.
    """
    displacement = np.array([distance + RADIUS, 0.0]) - np.array([np.cos(angle), np.sin(angle)])
    length = float(np.hypot(*displacement))
    if not BENT < length < 2.0 - BENT:
        return None
    direction, half_angle = np.arctan2(displacement[1], displacement[0]), np.arccos(length / 2)
    return np.array([angle, direction - side * half_angle - angle, side * 2 * half_angle])
