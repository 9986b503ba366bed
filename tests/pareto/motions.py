"""Certificates of motions for tests."""

from __future__ import annotations

import numpy as np

from paretoik.pareto.certificates import certify
from paretoik.trajectory.transcription import motion_program


def certify_motions(task, q, ranges):
    """Return the certificates of motions on the path."""
    return certify(
        motion_program(task),
        np.asarray(q),
        ranges=np.asarray(ranges, dtype=float),
        signs=np.array([o.sign for o in task.objectives]),
        violation_between=task.violation_between(task.motion(np.asarray(q))),
    )[0]
