"""A picture of a closed loop: its motion, its joints, and the chosen point of every step's front."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from paretoik.front.front import Front
from paretoik.review.joint_units import joint_units
from paretoik.review.palette import PAPER
from paretoik.review.pictures.plots import label, label_arm, picture, stroboscopic
from paretoik.task.limits import JOINT_UNITS


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
        stroboscopic(axes, motion)
        label_arm(axes, planar=planar)
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
