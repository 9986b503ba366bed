"""The paper's data: nine positions, two ways to drive one arm, and the printed numbers."""

from __future__ import annotations

from functools import partial

import numpy as np
from jaxtyping import Float

import paretoik as pk
from studies.reporting import Row, paper_numbers

# The text names p4, p5 and p6; that the nine are a grid of x and y, row by row, is a reading of Figure 6.
POSITIONS = {
    f"p{1 + 3 * row + column}": np.array([x, y])
    for row, y in enumerate((-0.10, -0.15, -0.20))
    for column, x in enumerate((0.10, 0.15, 0.20))
}
DIRECTIONS = 16
MECHANISMS = ("JAM", "DAM")
paper = partial(paper_numbers, "kim_2021")
UNPRINTED = "depends on masses and the base's angle, which the paper does not print"
ENERGY_UNPRINTED = "the paper prints no masses, no postures on the way, and no formula of its energy"


def actuation_of(mechanism: str) -> pk.capability.JointActuation | pk.capability.DistributedActuation:
    """Return motors at the joints ("JAM") or sliders along the links ("DAM"), as the library has them by default."""
    return pk.capability.kim_joint_motors() if mechanism == "JAM" else pk.capability.kim_sliders()


def speeds(mechanism: str, position: Float[np.ndarray, " 2"], directions: object = DIRECTIONS) -> np.ndarray:
    """Return the directional maxima [m/s] of the arm as the library has it by default, 0.5 kg a link."""
    return pk.directional_maxima(pk.arms.kim_3r(), actuation_of(mechanism), position, directions).values


def beside_paper(place: tuple[str, str, str], unit: str, ours: float, note: str = "") -> Row:
    """Return a row at its place (table, row, column), with the paper's number if it prints one."""
    table, row, column = place
    return Row(
        table=table, row=row, column=column, unit=unit, ours=float(ours), reference=paper().get(place), note=note
    )
