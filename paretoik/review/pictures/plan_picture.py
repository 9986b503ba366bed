"""A picture of a plan: the objective at starts and optima of every level, and the motions of the best optima."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from paretoik.review.palette import PAPER
from paretoik.review.pictures.plots import label_arm, picture, stroboscopic
from paretoik.review.recording.planned import PlannedLevel
from paretoik.trajectory.plan import Plan


def plan_picture(plan: Plan, levels: Sequence[PlannedLevel], label: str, unit: str, file: Path | str) -> None:
    """Write a PNG of a plan whose objective has a ``label`` and a ``unit``.

    Raises InvalidInput where the file cannot be written.
    """
    optima = plan.optima[: PAPER.motions]
    planar = optima[0].motion.arm.is_planar
    with picture(file, (11.0, 3.4)) as figure:
        parts: Any = figure.subfigures(1, 2, width_ratios=[1.0, 2.0])
        values, motions = parts
        _draw_levels(values.subplots(), plan, levels, label)
        kind: Any = {"aspect": "equal"} if planar else {"projection": "3d"}
        panels = np.atleast_1d(motions.subplots(1, len(optima), sharex=planar, sharey=planar, subplot_kw=kind))
        for rank, (axes, optimum) in enumerate(zip(panels, optima, strict=True)):
            stroboscopic(axes, optimum.motion, colour=PAPER.accent(rank))
            name = "best" if rank == 0 else f"optimum {rank}"
            axes.set_title(f"{name}: {optimum.objective:.4g} {unit}".rstrip(), color=PAPER.accent(rank))
            axes.locator_params(nbins=4)
            axes.set_xlabel("x [m]")
            if not planar:
                label_arm(axes, planar=False)
        if planar:
            panels[0].set_ylabel("y [m]")


def _draw_levels(axes: Axes, plan: Plan, levels: Sequence[PlannedLevel], label: str) -> None:
    """Draw the objective at the optima of every level, and at its starts as far as these are near."""
    for level in levels:
        axes.plot(
            np.full(len(level.starts), level.samples),
            level.starts,
            color=PAPER.grid,
            linestyle="none",
            marker="o",
            markersize=2.5,
            zorder=1,
            label="starts" if level is levels[-1] else None,
        )
        axes.plot(
            np.full(len(level.optima), level.samples),
            level.optima,
            color=PAPER.quiet,
            linestyle="none",
            marker="o",
            markersize=4,
            label="distinct optima" if level is levels[-1] else None,
        )
    samples = len(plan.best.motion.time)
    for rank, optimum in enumerate(plan.optima[: PAPER.motions]):
        size = 7 + 4 * (len(plan.optima[: PAPER.motions]) - 1 - rank)  # where they are one, each is a ring
        axes.plot(
            samples, optimum.objective, color=PAPER.accent(rank), marker="o", markersize=size, markeredgecolor="w"
        )
    values = np.concatenate([[each.objective for each in plan.optima], *(level.optima for level in levels)])
    low, high = float(values.min()), float(values.max())
    margin = 0.15 * (high - low) or 0.05 * abs(high) or 1.0
    axes.set(xlabel="samples of the level", ylabel=label, ylim=(low - margin, high + margin))
    axes.set_xticks(sorted({samples, *(level.samples for level in levels)}))
    if levels:
        axes.legend(frameon=False)
