"""What the start decides, which the paper does not print: exact loops of three links from all over the self-motion."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.redundancy.extended_jacobian import exact_steps
from problems import marcos_2012
from problems.marcos_2012 import DISTANCES, RADIUS
from studies.marcos_2012.loops import Cell
from studies.marcos_2012.tables import MEASURES, paper
from studies.reporting import Row

STARTS = 48  # angles of the first link
WEIGHT = 0.5
BENT = 0.05  # m: of a circle's beginning nearer than this to the second joint there is no telling two links apart
LEAP = 1.0  # rad: a loop with a longer step has met a singularity


def start_rows(starts: int = STARTS) -> list[Row]:
    """Return the least and the most that either number of a cell can be, by where the arm begins."""
    rows = []
    for distance in DISTANCES:
        cell = Cell(links=3, distance=distance, blocked=False, weight=WEIGHT)
        loop = marcos_2012.loop(3, distance, weight=WEIGHT, start=np.ones(3), as_printed=True)
        found = []
        for q in postures(np.array([distance + RADIUS, 0.0]), starts):
            moved = exact_steps(loop.task.arm, loop.task.targets, q, weight=WEIGHT)
            if np.abs(np.diff(moved, axis=0)).max() < LEAP:
                found.append(loop.task.motion(moved))
        for table, measure in zip(("Table 1", "Table 2"), MEASURES.values(), strict=True):
            values = [float(measure(motion)) for motion in found]
            printed = paper()[table, cell.row, "3R"]
            inside = "lies" if min(values) <= printed <= max(values) else "does NOT lie"
            rows.append(
                Row(
                    table="what the start decides: the exact loop of 3R from all over the self-motion",
                    row=f"{table}, {cell.row}",
                    column="least",
                    unit=measure.unit,
                    ours=min(values),
                    paper=printed,
                    note=f"to {max(values):.3g} over {len(values)} starts: the printed number {inside} between",
                )
            )
    return rows


def postures(target: Float[np.ndarray, " 2"], count: int) -> list[Float[np.ndarray, " dof"]]:
    """Return postures of three unit links that reach a target, by the angle of the first, elbow up and down."""
    found = []
    for angle in np.linspace(-np.pi, np.pi, count, endpoint=False):
        left = target - np.array([np.cos(angle), np.sin(angle)])
        apart = float(np.hypot(*left))
        if not BENT < apart < 2.0 - BENT:
            continue
        ahead, bend = np.arctan2(left[1], left[0]), np.arccos(apart / 2)
        found += [np.array([angle, ahead - side * bend - angle, side * 2 * bend]) for side in (1, -1)]
    return found
