"""Figures 5, 6, 8 and 9 as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paretoik.review.palette import PAPER
from studies.kim_2021.energies import Driven, Postures
from studies.kim_2021.maxima import POSITIONS, Polygons
from studies.kim_2021.trajectories import Trajectory
from studies.reporting import drawing

COLOURS = {"DAM": PAPER.accents[0], "JAM": PAPER.accents[1]}
JOINTS = (PAPER.ink, PAPER.accents[1], PAPER.accents[0])
LENGTH = 0.18  # m in the picture per m/s: polygons of neighbours at most touch


def draw(
    folder: Path, polygons: Sequence[Polygons], trajectories: dict[str, Trajectory], postures: dict[str, Postures]
) -> list[Path]:
    """Write every figure into a folder, and return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = [folder / f"figure_{number}.png" for number in (5, 6, 8, 9)]
    with drawing(drawn[0], (4.0, 5.4)) as figure:
        _outlines(figure, next(one for one in polygons if one.name == "p6"))
    with drawing(drawn[1], (6.4, 6.6)) as figure:
        _workspace(figure, polygons, trajectories)
    with drawing(drawn[2], (7.6, 6.0)) as figure:
        _arrivals(figure, trajectories)
    with drawing(drawn[3], (9.0, 8.4)) as figure:
        _efforts(figure, postures)
    return drawn


def _closed(points: np.ndarray) -> np.ndarray:
    return np.vstack([points, points[:1]]).T


def _outlines(figure: Figure, one: Polygons) -> None:
    axes = figure.subplots()
    for name, polygon, style in (("DAM", one.dam, "-"), ("JAM", one.jam, "--")):
        axes.plot(*_closed(1e3 * polygon.vertices), style, marker=".", color=COLOURS[name], label=name)
    slower = one.gain < 0
    for k, way in enumerate(1e3 * one.jam.vertices[slower]):
        axes.plot(*way, "o", color=PAPER.ink, fillstyle="none", markersize=9, label="" if k else "DAM is slower")
    axes.set_aspect("equal")
    axes.set_xlabel("x velocity [mm/s]")
    axes.set_ylabel("y velocity [mm/s]")
    axes.set_title("Fastest velocities at (200, −150) mm")
    figure.legend(frameon=False, ncols=3, loc="outside lower center")


def _workspace(figure: Figure, polygons: Sequence[Polygons], trajectories: dict[str, Trajectory]) -> None:
    axes = figure.subplots()
    for one in polygons:
        place = 1e3 * POSITIONS[one.name]
        for name, polygon in (("DAM", one.dam), ("JAM", one.jam)):
            outline = place + 1e3 * LENGTH * polygon.vertices
            axes.fill(*outline.T, color=COLOURS[name], alpha=0.12, linewidth=0)
            axes.plot(*_closed(outline), color=COLOURS[name], linewidth=1.2, label=name if one.name == "p1" else "")
        axes.annotate(one.name, (place[0], place[1]), xytext=(4, 4), textcoords="offset points", color=PAPER.ink)
    for name, each in trajectories.items():
        axes.plot(*1e3 * each.path.T, ":", color=COLOURS[name], linewidth=1.6, label=f"{name}, Figure 8")
    size = 50.0 * LENGTH
    axes.plot([66.0, 66.0 + size], [-232.0] * 2, color=PAPER.ink, linewidth=2)
    axes.annotate("50 mm/s", (66.0 + size, -232.0), xytext=(5, -3), textcoords="offset points", color=PAPER.ink)
    axes.set_aspect("equal")
    axes.set_xlabel("x [mm]")
    axes.set_ylabel("y [mm]")
    axes.set_title("Fastest velocities at nine positions")
    figure.legend(frameon=False, ncols=4, loc="outside lower center")


def _arrivals(figure: Figure, trajectories: dict[str, Trajectory]) -> None:
    panels = figure.subplots(3, 1, height_ratios=[1.0, 1.0, 1.3])
    for name, one in trajectories.items():
        run, colour = one.run, COLOURS[name]
        for axes, coordinate in zip(panels[:2], (0, 1), strict=True):
            axes.plot(run.times, 1e3 * run.positions[:, coordinate], color=colour)
            axes.plot(run.arrival, 1e3 * run.positions[-1, coordinate], "o", color=colour, markersize=4)
        panels[2].plot(*1e3 * one.path.T, color=colour, label=f"{name}, {run.arrival:.2f} s")
        panels[2].plot(*1e3 * one.geodesic.points.T, ":", color=PAPER.ink, linewidth=1.6)
    panels[2].plot([], [], ":", color=PAPER.ink, linewidth=1.6, label="fastest paths")
    panels[2].plot([100, 200], [-150, -150], color=PAPER.quiet, linewidth=0.8, label="straight line")
    for axes, (across, up) in zip(
        panels, (("time [s]", "x [mm]"), ("time [s]", "y [mm]"), ("x [mm]", "y [mm]")), strict=True
    ):
        axes.set_xlabel(across)
        axes.set_ylabel(up)
    figure.legend(frameon=False, ncols=4, loc="outside lower center")
    panels[0].set_title("From (100, −150) to (200, −150) mm; ellipses fitted to the grid")


def _efforts(figure: Figure, postures: dict[str, Postures]) -> None:
    panels = figure.subplots(3, 2, sharex="col")
    for column, name in enumerate(("DAM", "JAM")):
        driven = postures[name].driven
        _panel(panels[0, column], driven, driven.efforts, "thrust [N]" if name == "DAM" else "torque [N m]")
        _panel(panels[1, column], driven, np.rad2deg(driven.q[:, None]), "joint position [°]")
        if driven.sliders is not None:
            _panel(panels[2, column], driven, 1e3 * driven.sliders, "slider position [mm]")
        else:
            rates = np.rad2deg(driven.speeds)
            _panel(panels[2, column], driven, rates, "joint velocity [°/s]")
        panels[0, column].set_title(f"{name}: soonest without a jump, {postures[name].soonest.times[-1]:.2f} s")
        panels[2, column].set_xlabel("time [s]")
    handles = [panels[0, 0].plot([], [], color=colour, label=f"joint {j + 1}")[0] for j, colour in enumerate(JOINTS)]
    handles.append(panels[0, 0].plot([], [], "--", color=PAPER.quiet, label="back slider")[0])
    figure.legend(handles=handles, frameon=False, ncols=4, loc="outside upper center")


def _panel(axes: Axes, driven: Driven, values: np.ndarray, label: str) -> None:
    for motor, style in zip(range(values.shape[1]), ("-", "--"), strict=False):
        for joint, colour in enumerate(JOINTS):
            axes.plot(driven.times, values[:, motor, joint], style, color=colour, linewidth=1.3)
    axes.set_ylabel(label)
