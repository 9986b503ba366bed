"""Figures 3 to 12 as pictures, of either arm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from paretoik.review.palette import PAPER
from paretoik.review.pictures.fronts import stroboscopic
from studies.reporting import drawing
from studies.tringali_2021.trajectories import FAST, METHODS, Trajectory, spectral_radius

JOINTS = ("#0072bd", "#c92a2a", "#e0a100")  # blue, red and yellow, as in the paper
LINES = {"PMKE": (PAPER.ink, "--"), "LSV": (PAPER.ink, "-"), "global": ("#c92a2a", "-")}


def draw(folder: Path, trajectories: Sequence[Trajectory]) -> list[Path]:
    """Write every figure of every arm into a folder, and return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = []
    for masses in dict.fromkeys(one.masses for one in trajectories):
        series = [one for one in trajectories if one.masses == masses]
        drawn.append(folder / f"figure_03_{masses}.png")
        with drawing(drawn[-1], (8.0, 6.0)) as figure:
            _energies(figure, series)
        for one in series:
            for first, other in ((3, "LSV"), (8, "global")):
                drawn.append(folder / f"figure_{first + one.number:02d}_{masses}.png")
                with drawing(drawn[-1], (8.0, 9.0 if other == "LSV" else 6.4)) as figure:
                    _beside(figure, one, other, speeds=other == "LSV")
            if one.number == max(each.number for each in series):
                drawn.append(folder / f"figure_08_{masses}.png")
                with drawing(drawn[-1], (6.0, 4.0)) as figure:
                    _radii(figure, one)
    return drawn


def _energies(figure: Figure, trajectories: Sequence[Trajectory]) -> None:
    for axes, one in zip(figure.subplots(2, 2).ravel(), trajectories, strict=False):
        for name in METHODS:
            motion = one.motions[name]
            colour, style = LINES[name]
            spent = np.cumsum(motion.kinetic_energy * motion.weights)
            axes.plot(motion.time, spent, color=colour, linestyle=style, linewidth=1.3, label=name)
        axes.set_title(one.name)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("kinetic energy integral [J s]")
    figure.axes[0].legend(frameon=False)


def _beside(figure: Figure, one: Trajectory, other: str, *, speeds: bool) -> None:
    """Draw looking ahead on the left and another method on the right: postures, joint positions and velocities."""
    panels = figure.subplots(
        3 if speeds else 2, 2, sharex="row", sharey="row", height_ratios=[1.6] + [1.0] * (1 + speeds)
    )
    for column, name in enumerate(("PMKE", other)):
        motion = one.motions[name]
        stroboscopic(panels[0, column], motion, colour=JOINTS[0])
        panels[0, column].set_aspect("equal")
        panels[0, column].set_title(f"{one.name}, {name}")
        for row, (values, label) in enumerate(
            ((motion.q, "joint position [rad]"), (motion.dq, "joint velocity [rad/s]"))
        ):
            if row and not speeds:
                continue
            axes = panels[1 + row, column]
            shown = np.where(np.abs(values) > FAST, np.nan, values) if row else values  # no singularity, as in paper
            for joint, colour in enumerate(JOINTS):
                axes.plot(motion.time, shown[:, joint], color=colour, linewidth=1.3, label=f"joint {joint + 1}")
            axes.set_xlabel("time [s]")
            if column == 0:
                axes.set_ylabel(label)
    panels[1, 1].legend(frameon=False)


def _radii(figure: Figure, one: Trajectory) -> None:
    axes = figure.subplots()
    for name, style in (("PMKE", "--"), ("LSV", ":")):
        motion = one.motions[name]
        radii = spectral_radius(motion)
        axes.plot(motion.time, radii, color=PAPER.ink, linestyle=style, linewidth=1.3, label=name)
        axes.plot(motion.time[radii.argmin()], radii.min(), color=PAPER.quiet, marker="o", markersize=4)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("spectral radius of the inertia matrix [kg m²]")
    axes.set_title(one.name)
    axes.legend(frameon=False)
