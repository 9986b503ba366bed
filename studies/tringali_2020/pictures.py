"""Figures 1 and 3 to 14 as pictures, of either arm."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from paretoik.review.palette import PAPER
from paretoik.review.pictures.fronts import stroboscopic
from studies.reporting import drawing
from studies.tringali_2020.candidates import FITTED_FROM, Decline
from studies.tringali_2020.simulations import Simulation, paper
from studies.tringali_2020.trade_off import TradeOff, hull

JOINTS = ("#0072bd", "#c92a2a", "#e0a100")  # blue, red and yellow, as in the paper
PANELS = (  # of Figures 4, 6, 8, 10 and 12: kind of limit, attribute of a motion, label
    ("position", "q", "joint position [rad]"),
    ("velocity", "dq", "joint velocity [rad/s]"),
    ("torque", "torque", "joint torque [N m]"),
    ("power", "power", "joint power [W]"),
)


def draw(
    folder: Path,
    simulations: Mapping[str, Sequence[Simulation]],
    falling: Sequence[Decline],
    trades: Sequence[TradeOff],
    names: Mapping[str, str],
) -> list[Path]:
    """Write every figure of every arm given into a folder, and return the files; ``names`` are the paper's optima."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn: list[Path] = []

    def write(number: int, masses: str, size: tuple[float, float], paint: Callable[[Figure], None]) -> None:
        drawn.append(folder / f"figure_{number:02d}_{masses}.png")
        with drawing(drawn[-1], size) as figure:
            paint(figure)

    for decline in falling:
        write(1, decline.masses, (6.0, 4.2), partial(_candidates, decline=decline))
    for masses, (first, *others) in simulations.items():
        width = 2.6 * max(len(first.plan.optima), 2) + 0.6
        write(3, masses, (width, 3.4), partial(_optima, simulation=first, names=names))
        for simulation in (first, *others):
            write(2 + 2 * simulation.number, masses, (8.0, 9.0), partial(_motion, simulation=simulation))
            write(3 + 2 * simulation.number, masses, (8.0, 5.4), partial(_energies, simulation=simulation))
    for trade_off in trades:
        write(14, trade_off.masses, (6.6, 4.6), partial(_front, trade_off=trade_off))
    return drawn


def _candidates(figure: Figure, decline: Decline) -> None:
    axes = figure.subplots()
    counts, above = decline.counts, decline.above
    axes.fill_between(counts, above.min(axis=0), above.max(axis=0), color=PAPER.accents[1], alpha=0.15, linewidth=0)
    axes.plot(
        counts,
        np.exp(np.log(above).mean(axis=0)),
        color=PAPER.accents[1],
        label=f"mean and range of {len(above)} seeds",
    )
    reach = counts[counts >= FITTED_FROM]
    exponent, factor = decline.lines.mean(axis=0)
    printed = paper()["Figure 1", "least kinetic energy", "logarithm of the factor"]
    rate = paper()["Figure 1", "least kinetic energy", "exponent"]
    for label, power, scale, colour, style in (
        (f"ours: exponent {exponent:.2f}", exponent, factor, PAPER.accents[1], "--"),
        (f"paper: exponent {rate:.2f}", rate, printed, PAPER.accents[0], "-."),
    ):
        axes.plot(reach, np.exp(scale) * reach**power, color=colour, linestyle=style, label=label)
    axes.set(xscale="log", yscale="log", xlabel="number of candidates")
    axes.set_ylabel("best candidate above the best optimum [J s]")
    axes.legend(frameon=False)
    axes.set_title(f"Figure 1: kinetic energy of the best candidate, {decline.masses} masses")


def _optima(figure: Figure, simulation: Simulation, names: Mapping[str, str]) -> None:
    optima, named = simulation.plan.optima, dict(names)
    panels = np.atleast_1d(figure.subplots(1, len(optima), sharex=True, sharey=True, subplot_kw={"aspect": "equal"}))
    for axes, optimum in zip(panels, optima, strict=True):
        name = named.pop(optimum.label, None)
        stroboscopic(axes, optimum.motion, colour=PAPER.accents[1] if name else PAPER.quiet)
        words = "not in the paper" if name is None else f"the paper's {name}"
        axes.set_title(f"{words}\nbends {optimum.label}, {optimum.objective:.4f} J s")
        axes.set_xlabel("x [m]")
        axes.locator_params(nbins=4)
    panels[0].set_ylabel("y [m]")
    figure.suptitle(f"Figure 3: optima of simulation 1, {simulation.masses} masses", fontsize=10.5)


def _motion(figure: Figure, simulation: Simulation) -> None:
    parts: Any = figure.subfigures(2, 1, height_ratios=[1.0, 1.35])
    above, below = parts
    motion, bounds = simulation.motion, simulation.problem.task.bounds
    axes = above.subplots(subplot_kw={"aspect": "equal"})
    stroboscopic(axes, motion)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_title("the arm at eight instants, the later the darker, and the way of its tool")
    panels = below.subplots(2, 2, sharex=True)
    for panel, (kind, values, label) in zip(panels.flat, PANELS, strict=True):
        _series(panel, motion.time, getattr(motion, values), label)
        if kind in bounds:
            _limits(panel, bounds[kind][0], unlike=kind == "position")
    for panel in panels[1]:
        panel.set_xlabel("time [s]")
    below.align_ylabels()
    lines, words = panels[0, 0].get_legend_handles_labels()
    below.legend(lines, words, loc="outside upper center", ncols=4, frameon=False)
    _title(figure, simulation, 2)


def _series(axes: Axes, time: np.ndarray, values: np.ndarray, label: str) -> None:
    for joint, colour in enumerate(JOINTS):
        axes.plot(time, values[:, joint], color=colour, linewidth=1.5, label=f"joint {joint + 1}")
    axes.set_ylabel(label)


def _limits(axes: Axes, bounds: np.ndarray, *, unlike: bool) -> None:
    """Draw limits (dof, 2) dashed; if they differ between joints, label them, in degrees."""
    for number, value in enumerate(np.unique(bounds)):
        dashed = axes.axhline(value, color=PAPER.ink, linestyle=(0, (5, 3)), linewidth=0.9)
        if number == 0:
            dashed.set_label("limit")
        if unlike:
            joints = [str(j + 1) for j in range(len(bounds)) if value in bounds[j]]
            whose = f"joint{'s' if len(joints) > 1 else ''} {', '.join(joints)}"
            axes.annotate(
                whose,
                (1.0, value),
                (4, 0),
                xycoords=("axes fraction", "data"),
                textcoords="offset points",
                va="center",
                fontsize=8,
            )
    axes.margins(y=0.12)


def _energies(figure: Figure, simulation: Simulation) -> None:
    motion = simulation.motion
    table = "Table 6" if simulation.number == 5 else "Table 5"
    torque = np.sum(motion.torque**2, axis=-1)
    series = {
        "kinetic energy [J]": (motion.kinetic_energy, None),
        "power of all joints [W]": (motion.power.sum(axis=-1), None),
        "kinetic energy integral [J s]": (np.cumsum(motion.kinetic_energy * motion.weights), "kinetic energy"),
        "torque norm integral [N²m²s]": (np.cumsum(torque * motion.weights), "torque norm"),
    }
    panels = figure.subplots(2, 2, sharex=True)
    for axes, (label, (values, column)) in zip(panels.flat, series.items(), strict=True):
        axes.plot(motion.time, values, color=PAPER.accents[1], linewidth=1.6)
        axes.set_ylabel(label)
        if column is not None:
            theirs = paper()[table, simulation.name, column]
            axes.axhline(theirs, color=PAPER.accents[0], linestyle="--", linewidth=1.2)
            words = f"the paper's at the end: {theirs:g}"
            axes.annotate(words, (0.0, theirs), (0, 3), textcoords="offset points", color=PAPER.accents[0], va="bottom")
            axes.margins(y=0.1)
            axes.set_xlabel("time [s]")
    figure.align_ylabels()
    _title(figure, simulation, 3)


def _title(figure: Figure | SubFigure, simulation: Simulation, first: int) -> None:
    objective = simulation.problem.task.objectives[0].name.replace("_", " ")
    number = first + 2 * simulation.number
    words = f"Figure {number}: simulation {simulation.number}, least {objective}, {simulation.masses} masses"
    figure.suptitle(words, fontsize=10.5)


def _front(figure: Figure, trade_off: TradeOff) -> None:
    front, axes = trade_off.front, figure.subplots()
    x, y = front.objectives.T
    corners = front.objectives[hull(front)]
    axes.plot(*corners.T, color=PAPER.quiet, linestyle="--", linewidth=0.9, label="convex hull: all that weights find")
    axes.plot(
        x, y, color=PAPER.accents[1], linestyle="none", marker="o", markersize=5, label=f"{len(front)} certified points"
    )
    for simulation, marker in ((2, "s"), (3, "D")):
        place = [paper()["Table 5", f"simulation {simulation}", what] for what in ("kinetic energy", "torque norm")]
        words = f"paper, simulation {simulation}"
        axes.plot(*place, color=PAPER.accents[0], linestyle="none", marker=marker, markerfacecolor="none", label=words)
    axes.set(xlabel=f"kinetic energy [{front.units[0]}]", ylabel=f"torque norm [{front.units[1]}]")
    axes.legend(frameon=False)
    axes.set_title(f"Figure 14: energy against torque, {trade_off.masses} masses")
