"""What pictures and summaries say of limits that motions of a front exceed between their samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paretoik.formulations.protocol import is_loop, task_of
from paretoik.front.front import Front
from paretoik.task.motion import Motion


def describe_limits_between(front: Front, rows: Sequence[int] | None = None) -> str:
    """Return which limit, at which joint and time, motions violate most between samples, and what helps.

    "" where none does, or the problem cannot say it; ``rows`` are those of the points that are looked at, else all.
    """
    motions, task = front.motions, task_of(front.problem)
    if task is None or not isinstance(motions, Motion) or is_loop(front):
        return ""
    message = task.describe_between(motions if rows is None else motions[np.asarray(rows, dtype=int)])
    return f"{message}, or refine" if message and front.certificates is None else message
