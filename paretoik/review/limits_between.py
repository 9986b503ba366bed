"""What pictures and summaries say of limits that motions of a front exceed between their samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paretoik.formulations.protocol import is_loop
from paretoik.front.front import Front
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask


def describe_limits_between(front: Front, rows: Sequence[int] | None = None) -> str:
    """Return which limit, at which joint and time, motions violate most between samples, and what helps.

    "" where none does, or the problem cannot say it; ``rows`` are those of the points that are looked at, else all.
    """
    motions, task = front.motions, getattr(front.problem, "task", None)
    if not isinstance(motions, Motion) or not isinstance(task, MotionTask) or is_loop(front):
        return ""
    return task.describe_between(motions if rows is None else motions[np.asarray(rows, dtype=int)])
