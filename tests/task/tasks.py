"""A task of the printed arm along a short line; each test changes a part of it."""

from __future__ import annotations

import numpy as np

import paretoik as pk
from paretoik import kinetic_energy, line
from paretoik.robot.arms import tringali_3r
from paretoik.task.motion_task import MotionTask
from paretoik.task.validation import motion_task, with_ends

ARM = tringali_3r()
LINE = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=21)
POSTURE = np.array([-0.6, 0.9, 0.8])


def task(path=LINE, arm=ARM, *, start="free", end_velocity=None, cyclic=False, **changed) -> MotionTask:
    given = {"objectives": [kinetic_energy], "differences": "backward", **changed}
    return with_ends(motion_task(arm, path, **given), start=start, end_velocity=end_velocity, cyclic=cyclic)


def from_posture(q=POSTURE, arm=ARM, samples=21):
    """Return a line that begins at the place of the arm's tool at posture q."""
    place = pk.Motion(arm=arm, time=np.arange(3.0), q=np.tile(q, (3, 1))).tool[0]
    return line(place, place + np.array([-0.05, 0.05]), duration=1.0, samples=samples)
