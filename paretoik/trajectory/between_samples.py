"""What happens between the samples of a motion."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask


def violation_between(task: MotionTask, motions: Motion, *, refinement: int = 4) -> Float[np.ndarray, " points"]:
    """Return the worst violation of the interpolated and projected motions on a grid ``refinement`` times finer."""
    fine = task.resample(refinement * (len(task.times) - 1) + 1)
    between = fine.motion(motions.at(fine.times))
    return np.maximum(fine.violations(between).max(axis=1, initial=0.0), 0.0)
