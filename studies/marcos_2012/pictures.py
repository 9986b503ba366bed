"""Figures 2 to 9 as pictures: arms, joints over time, and the fronts of the first two steps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from paretoik.review.palette import PAPER
from paretoik.review.pictures.fronts import stroboscopic
from problems.marcos_2012 import DISTANCES
from studies.marcos_2012.tables import Cell, CellLoop
from studies.reporting import drawing

MOTIONS = {False: (2, 3), True: (6, 7)}  # figures of arms and joints, by whether there are obstacles
FRONTS = {(False, 0.7): 4, (False, 2.0): 5, (True, 0.7): 8, (True, 2.0): 9}
ENDS = (0.0, 1.0)


def draw(folder: Path, loops: Sequence[CellLoop]) -> list[Path]:
    """Draw every figure of the given loops of four links into a folder; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    by_cell = {one.cell: one for one in loops}
    drawn: list[Path] = []

    def select(distance: float, blocked: bool, weights: Sequence[float]) -> list[CellLoop]:
        selection = [Cell(links=4, distance=distance, blocked=blocked, weight=w) for w in weights]
        return [by_cell[cell] for cell in selection if cell in by_cell]

    for blocked, (arms, joints) in MOTIONS.items():
        pair = select(DISTANCES[0], blocked, ENDS)
        if len(pair) == len(ENDS):
            drawn.append(folder / f"figure_{arms}.png")
            with drawing(drawn[-1], (8.0, 4.0)) as figure:
                _arms(figure, pair)
            drawn.append(folder / f"figure_{joints}.png")
            with drawing(drawn[-1], (8.0, 3.4)) as figure:
                _joints(figure, pair)
    for (blocked, distance), number in FRONTS.items():
        for one in select(distance, blocked, ENDS[:1]):
            drawn.append(folder / f"figure_{number}.png")
            with drawing(drawn[-1], (8.0, 3.4)) as figure:
                _fronts(figure, one)
    return drawn


def _arms(figure: Figure, pair: Sequence[CellLoop]) -> None:
    for axes, one in zip(figure.subplots(1, len(pair), sharey=True), pair, strict=True):
        stroboscopic(axes, one.run.motion)
        axes.set(title=f"w = {one.cell.weight}", xlabel="x [m]", aspect="equal")
    figure.axes[0].set_ylabel("y [m]")


def _joints(figure: Figure, pair: Sequence[CellLoop]) -> None:
    for axes, one in zip(figure.subplots(1, len(pair), sharey=True), pair, strict=True):
        for j, joint in enumerate(one.run.q.T):
            axes.plot(one.run.task.times, joint, color=PAPER.accent(j), label=f"joint {j + 1}")
        axes.set(title=f"w = {one.cell.weight}", xlabel="time [s]")
    figure.axes[0].set_ylabel("joint position [rad]")
    figure.axes[-1].legend(frameon=False)


def _fronts(figure: Figure, one: CellLoop) -> None:
    for axes, record in zip(figure.subplots(1, 2), (one.run.fronts[1], one.run.fronts[2]), strict=True):
        F = record.front.F
        axes.plot(*F.T, linestyle="none", marker=".", markersize=3, color=PAPER.ink)
        for axis, name in enumerate("ab"):
            best = F[int(np.argmin(F[:, axis]))]
            axes.plot(*best, marker="o", color=PAPER.accents[axis])
            axes.annotate(name, best, textcoords="offset points", xytext=(5, 5), color=PAPER.accents[axis])
        axes.set(title=f"t = {one.run.task.times[record.sample]:.3f} s", xlabel="f₁ [rad²/s²]", ylabel="f₂ [m]")
