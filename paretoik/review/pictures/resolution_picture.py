"""A picture of a resolved motion: the arm beside the path that it was to follow, its joints, and its errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from paretoik.resolution.traces import ResolvedMotion
from paretoik.review.joint_units import joint_units
from paretoik.review.palette import PAPER
from paretoik.review.pictures.plots import label_arm, picture, stroboscopic
from paretoik.task.limits import JOINT_UNITS
from paretoik.task.task import error_unit


def resolution_picture(motion: ResolvedMotion, criteria: list[str], file: Path | str) -> None:
    """Write a PNG of a single motion; raises InvalidInput where the file cannot be written."""
    planar = motion.arm.is_planar
    with picture(file, (11.0, 3.6)) as figure:
        parts: Any = figure.subfigures(1, 3, width_ratios=[1.2, 1.0, 1.0])
        arm, joints, steps = parts
        axes = arm.subplots(subplot_kw={"aspect": "equal"} if planar else {"projection": "3d"})
        stroboscopic(axes, motion)
        for task in motion.tasks:
            path = task.path.positions[:, : 2 if planar else 3]
            axes.plot(*path.T, color=PAPER.accents[0], linewidth=1.0, linestyle="--", label="wanted")
        label_arm(axes, planar=planar)
        axes.legend(frameon=False, loc="upper right")
        axes = joints.subplots()
        for j, (joint, name) in enumerate(zip(motion.q.T, motion.arm.joint_names, strict=True)):
            axes.plot(motion.time, joint, color=PAPER.accent(j), linewidth=1.2, label=name)
        axes.set(xlabel="time [s]", ylabel=f"joint position [{joint_units(motion.arm, JOINT_UNITS['position'])}]")
        axes.legend(frameon=False)
        above, below = steps.subplots(2, 1, sharex=True)
        _draw_errors(above, motion)
        _draw_criteria(below, motion, criteria)
        below.set_xlabel("time [s]")


def _draw_errors(axes: Axes, motion: ResolvedMotion) -> None:
    """Draw the largest task error of every sample, and mark the steps that were not simply done."""
    errors = np.abs(motion.traces.errors).max(axis=-1)
    shown = np.maximum(errors, 1e-16)
    axes.semilogy(motion.time, shown, color=PAPER.accents[1], linewidth=1.2)
    for number, status in enumerate(sorted(set(motion.traces.status.tolist()) - {"done"})):
        at = np.flatnonzero(motion.traces.status == status) + 1
        axes.semilogy(
            motion.time[at], shown[at], color=PAPER.accent(number + 2), linestyle="none", marker=".", label=status
        )
        axes.legend(frameon=False)
    axes.set_ylabel(f"error [{error_unit(motion.tasks)}]")


def _draw_criteria(axes: Axes, motion: ResolvedMotion, criteria: list[str]) -> None:
    """Draw how fast each criterion drives the joints; without criteria the damping."""
    if not criteria:
        axes.plot(motion.time[1:], motion.traces.damping, color=PAPER.accents[1], linewidth=1.2)
        axes.set_ylabel("damping")
        return
    for number, name in enumerate(criteria):
        speed = np.linalg.norm(motion.traces.projected[:, number], axis=-1)
        axes.plot(motion.time[1:], speed, color=PAPER.accent(number), linewidth=1.2, label=name)
    axes.set_ylabel("joint speed from\ncriteria [rad/s]")
    axes.legend(frameon=False)
