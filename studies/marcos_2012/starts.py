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
from studies.marcos_2012.tables import ALIKE, MEASURES, WEIGHTS, Cell, paper
from studies.reporting import Row

STARTS = 48  # angles of the first link
WEIGHT = 0.5
BENT = 0.05  # m: if a circle begins nearer than this to the second joint, two links cannot be told apart
LEAP = 1.0  # rad: a loop with a longer step has met a singularity
NARROW = 1e-5  # rad: tolerance of a start's angle
TABLES = ("Table 1", "Table 2")


@dataclass(frozen=True, kw_only=True)
class ExactMeasures:
    """The mean position error [m] and the drift [rad] of an exact loop."""

    error: float
    drift: float


def start_rows(starts: int = STARTS) -> list[Row]:
    """Return how much of the paper's columns a start explains that gives its error at w = 0.5.

    The error crosses the printed one between some of the angles that were tried; the crossing that explains most of the
    other cells is reported.
    """
    rows, angles = [], np.linspace(-np.pi, np.pi, starts, endpoint=False).tolist()
    for distance in DISTANCES:
        printed = np.array([[_printed(table, distance, w) for w in WEIGHTS] for table in TABLES])
        target, columns = _printed(TABLES[0], distance, WEIGHT), []

        def above(angle: float, side: int, distance: float = distance, target: float = target) -> float:
            value = _exact_at(distance, angle, side)
            return np.nan if value is None else value.error - target

        for side in (1, -1):
            errors = [above(angle, side) for angle in angles]
            for (low, here), (high, there) in pairwise(zip(angles, errors, strict=True)):
                if not here * there <= 0:
                    continue
                angle = float(brentq(above, low, high, args=(side,), xtol=NARROW))
                loops = [_exact_at(distance, angle, side, weight) for weight in WEIGHTS]
                if None not in loops:
                    off = np.array([[one.error, one.drift] for one in loops if one]).T / printed - 1
                    columns.append((angle, side, off))
        if not columns:
            continue
        angle, side, deviation = max(columns, key=lambda column: np.sum(np.abs(column[2][0]) <= ALIKE))
        title = f"the start that gives the printed error at w = {WEIGHT}: its other cells within {ALIKE:.0%}"
        for table, off in zip(TABLES, deviation, strict=True):
            agrees = np.abs(off) <= ALIKE
            differ = zip(WEIGHTS, off, agrees, strict=True)
            others = ", ".join(f"w = {w} ({1 + a:.3g} times)" for w, a, good in differ if not good) or "none"
            note = f"q₀ = {np.array2string(posture(distance, angle, side), precision=3)}, one of {len(columns)}; "  # type: ignore[arg-type]
            row, cells = f"{table}, r = {distance}, 3R", int(agrees.sum())
            note += f"others: {others}"
            rows.append(Row(title, row, "cells", "", cells, reference=len(WEIGHTS), source="cells", note=note))
    return rows


def _exact_at(distance: float, angle: float, side: int, weight: float = WEIGHT) -> ExactMeasures | None:
    """Return the results of the exact loop of 3R from a start, None without one or if it meets a singularity."""
    start = posture(distance, angle, side)
    if start is None:
        return None
    loop = marcos_2012.loop(3, distance, weight=weight, start=start, as_printed=True)
    moved = exact_steps(loop.task, start, weight=weight, longest_step=loop.longest)
    if not np.abs(np.diff(moved, axis=0)).max() < LEAP:
        return None
    error, drift = (float(measure(loop.task.motion(moved))) for measure in MEASURES.values())
    return ExactMeasures(error=error, drift=drift)


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
