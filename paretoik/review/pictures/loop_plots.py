"""A picture of a closed loop: its motion, its joints, and the chosen point of every step's front."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.patches import Circle as Disc
from matplotlib.patches import Polygon

from paretoik.front.front import Front
from paretoik.review.joint_units import joint_units
from paretoik.review.palette import PAPER
from paretoik.review.pictures.plots import label, picture, stroboscopic
from paretoik.task.limits import JOINT_UNITS
from paretoik.task.obstacles import Box, Circle, Obstacle


def loop_picture(motion: Any, values: np.ndarray, ranges: np.ndarray, front: Front, file: Path | str) -> None:
    """Write a PNG of a closed loop's ``motion``, and of the values chosen between each step's best and worst.

    ``values`` (steps, n_obj) and ``ranges`` (steps, n_obj, 2: best, worst) are in the objectives' own signs; ``front``
    has their names and units. Raises InvalidInput where the file cannot be written.
    """
    with picture(file, (11.0, 3.6)) as figure:
        parts: Any = figure.subfigures(1, 3, width_ratios=[1.2, 1.0, 1.2])
        arm, joints, chosen = parts
        planar = motion.arm.is_planar
        axes = arm.subplots(subplot_kw={"aspect": "equal"} if planar else {"projection": "3d"})
        if planar:
            obstacle_patches(axes, motion.obstacles)
        stroboscopic(axes, motion)
        axes.set(xlabel="x [m]", ylabel="y [m]")
        axes = joints.subplots()
        for j, (joint, name) in enumerate(zip(motion.q.T, motion.arm.joint_names, strict=True)):
            axes.plot(motion.time, joint, color=PAPER.accent(j), linewidth=1.2, label=name)
        axes.set(xlabel="time [s]", ylabel=f"joint position [{joint_units(motion.arm, JOINT_UNITS['position'])}]")
        axes.legend(frameon=False)
        rows = np.atleast_1d(chosen.subplots(values.shape[1], 1, sharex=True))
        for axis, axes in enumerate(rows):
            low, high = np.sort(ranges[:, axis], axis=1).T
            axes.fill_between(motion.time[1:], low, high, color=PAPER.quiet, alpha=0.3, linewidth=0)
            axes.plot(motion.time[1:], values[:, axis], color=PAPER.accents[1], linewidth=1.2)
            if low.min() > 0:
                axes.set_yscale("log")
            axes.set_ylabel(label(front, axis), fontsize=8)
        rows[0].set_title("chosen, within the front of each step")
        rows[-1].set_xlabel("time [s]")


def obstacle_patches(axes: Any, obstacles: tuple[Obstacle, ...]) -> None:
    """Draw the obstacles of a planar arm that lie in its plane: circles and rectangles."""
    for obstacle in obstacles:
        if isinstance(obstacle, Circle):
            axes.add_patch(Disc(tuple(obstacle.center), obstacle.radius, facecolor=PAPER.quiet, alpha=0.5))
        elif isinstance(obstacle, Box):
            corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
            corners[:, :2] *= obstacle.half_sizes[:2]
            axes.add_patch(Polygon(obstacle.pose.apply(corners)[:, :2], facecolor=PAPER.quiet, alpha=0.5))
