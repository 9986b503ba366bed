"""How far a motion exceeds its limits, judged by its positions ``at(t)`` on a grid finer than its samples.

Velocities and accelerations are differences of positions at distances of ``STEP`` of a sample's interval. All positions
are on one side of the instant, towards the middle of the interval; at a sample both sides are judged. The curve is
smooth between samples, but its acceleration may have kinks there, which differences across a sample would round off.
Shorter steps would show the error of Newton's method onto the path (1e-12), divided by their square.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paretoik.task.differences import Derivatives
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask

FINER = 50
STEP = 1 / 40  # of an interval: five of them fit into half of it
FORWARD = {  # weights of six neighbours for the first and second derivative (Fornberg 1988, table 3)
    1: (-137 / 60, 5.0, -5.0, 10 / 3, -5 / 4, 1 / 5),
    2: (15 / 4, -77 / 6, 107 / 6, -13.0, 61 / 12, -5 / 6),
}


def worst_violation(task: MotionTask, motion: Motion, finer: int = FINER) -> tuple[float, str]:
    """Return a motion's largest violation of a limit, a share of its range, and its place in words."""
    step = STEP * float(np.diff(task.times).min())
    share = np.arange(finer + 1) / finer
    times = task.times[:-1, None] + np.diff(task.times)[:, None] * share
    halves = times[:, share < 0.5].ravel(), times[:, share >= 0.5].ravel()
    judged = [motion_at(motion, half, side * step) for half, side in zip(halves, (1, -1), strict=True)]
    values = [float(task.violations(each).max(initial=0.0)) for each in judged]
    worst = int(np.argmax(values))
    return values[worst], task.describe_violation(judged[worst])


def motion_at(motion: Motion, times: np.ndarray, step: float) -> Motion:
    """Return a motion's positions at times, and velocities and accelerations by differences of positions."""
    ahead = (times[:, None] + step * np.arange(6)).ravel()
    places = motion.at(np.clip(ahead, motion.time[0], motion.time[-1])).reshape(len(times), 6, -1)
    dq, ddq = (np.einsum("k,tkj->tj", FORWARD[order], places) / step**order for order in (1, 2))
    rates = Derivatives(dq=dq, ddq=ddq, jerk=np.zeros_like(dq), velocity_bounds=dq.copy())
    return replace(motion, time=times, q=places[:, 0], cyclic=False, derivatives=rates)
