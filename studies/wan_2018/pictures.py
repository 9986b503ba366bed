"""Figures 6, 7, 10 and 11 as pictures, and the same of the quadratic program within limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from paretoik.resolution.protocol import ResolvedMotion
from paretoik.review.palette import PAPER
from studies.reporting import drawing
from studies.wan_2018.methods import AXES, Resolved, axis_errors, paper
from studies.wan_2018.tables import EVENTS, least_weight

TIMES = {event.column for events in EVENTS.values() for event in events if event.measure is not least_weight}
JOINTS = [f"joint {j + 1}" for j in range(7)]


class Panel(NamedTuple):
    """One panel: the label of its axis, the values (time, lines), and the lines' names."""

    label: str
    values: Callable[[ResolvedMotion], np.ndarray]
    lines: Sequence[str] = ()


def _normalised_positions(motion: ResolvedMotion) -> np.ndarray:
    lower, upper = motion.arm.position_limits.T
    return (2 * motion.q - upper - lower) / (upper - lower)


POSITIONS = Panel("normalised position", _normalised_positions, JOINTS)
VELOCITIES = Panel("normalised velocity", lambda motion: motion.traces.velocities / motion.arm.velocity_limits, JOINTS)
DAMPING = Panel("damping factor", lambda motion: motion.traces.damping[:, None])
ERRORS = Panel("error [m, rad]", axis_errors, tuple(AXES))
WEIGHTS = Panel("weight", lambda motion: motion.traces.weights, JOINTS)
REPULSION = Panel("repulsion [rad/s]", lambda motion: motion.traces.repulsion, JOINTS)
COEFFICIENT = Panel("coefficient", lambda motion: motion.traces.coefficients)
LIMITS = Panel("change by limits [rad/s]", lambda motion: motion.traces.repulsion, JOINTS)
POSITION_LIMITS = Panel("projected, position limits [rad/s]", lambda motion: motion.traces.projected[:, 0], JOINTS)
VELOCITY_LIMITS = Panel("projected, velocity limits [rad/s]", lambda motion: motion.traces.projected[:, -1], JOINTS)
FIGURES = {  # table, method and panels, in the paper's order
    "figure_06": ("Table 2", "WLN", (POSITIONS, VELOCITIES, DAMPING, ERRORS, WEIGHTS)),
    "figure_07": ("Table 2", "WGPM, as printed", (POSITIONS, VELOCITIES, REPULSION, DAMPING, ERRORS, WEIGHTS)),
    "figure_10": ("Table 3", "GPM", (POSITIONS, VELOCITIES, POSITION_LIMITS, VELOCITY_LIMITS, DAMPING, ERRORS)),
    "figure_11": (
        "Table 3",
        "WGPM, as printed",
        (POSITIONS, VELOCITIES, REPULSION, VELOCITY_LIMITS, DAMPING, COEFFICIENT, WEIGHTS, ERRORS),
    ),
    "table_2_quadratic_program": ("Table 2", "QP, positions", (POSITIONS, VELOCITIES, LIMITS, DAMPING, ERRORS)),
    "table_3_quadratic_program": ("Table 3", "QP, velocities too", (POSITIONS, VELOCITIES, LIMITS, DAMPING, ERRORS)),
}


def draw(folder: Path, tables: Sequence[Resolved]) -> list[Path]:
    """Draw every figure from the start nearest to the paper's into a folder; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    by_table = {one.table: one for one in tables}
    files = []
    for name, (table, method, panels) in FIGURES.items():
        resolved = by_table[table]
        files.append(folder / f"{name}.png")
        motion = resolved.motions[method][resolved.nearest_start()]
        number = name.partition("_quad")[0].replace("_0", "_").replace("_", " ").capitalize()
        instants = [value for (figure, event, _), value in paper().items() if figure == number and event in TIMES]
        rows = (len(panels) + 1) // 2
        with drawing(files[-1], (8.0, 2.1 * rows + 0.4)) as figure:
            grid = figure.subplots(rows, 2, sharex=True).ravel()
            for letter, axes, panel in zip("abcdefgh", grid, panels, strict=False):
                values = panel.values(motion)
                lines = axes.plot(motion.time[: len(values)], values, linewidth=1.0)
                for event in instants:
                    axes.axvline(event, color=PAPER.quiet, linestyle=":", linewidth=0.8)
                axes.set_title(f"{letter}) {panel.label}")
                if panel in (POSITIONS, ERRORS):
                    axes.legend(lines, panel.lines, frameon=False, fontsize=6.5, ncols=2)
            for axes in grid[len(panels) :]:
                axes.set_axis_off()
            for axes in grid[len(panels) - 2 : len(panels)]:
                axes.tick_params(labelbottom=True)
                axes.set_xlabel("time [s]")
            figure.suptitle(f"{number}, {method}" + ("; dotted: the times that the paper tells" if instants else ""))
    return files
