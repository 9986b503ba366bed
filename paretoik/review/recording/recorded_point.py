"""A point of a front as it is recorded: its objectives, what is said of it, and its motion as plain arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times, Values
from paretoik.review.even_rows import even_rows
from paretoik.review.recording.workcell import Workcell
from paretoik.task.limits import LIMITED
from paretoik.task.motion import Motion


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedMotion:
    """A motion as plain arrays: joint positions ``q`` (time, dof) at ``time`` (time,) [s].

    ``curves`` are joint quantities (time, dof) by kind of limit, in rad, s, N m and W, None where they are
    those of a ``Motion`` through these samples.
    """

    time: Times
    q: Float[np.ndarray, "time dof"]
    curves: Mapping[str, Float[np.ndarray, "time dof"]] | None = None

    @property
    def is_standing(self) -> bool:
        """Whether the arm stands still."""
        return not np.ptp(self.q, axis=0).any()


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedPoint:
    """A point that is drawn for itself: the chosen one, or the best of an objective, whose ``axis`` it then has.

    ``motion`` is None where there is none, or where it was not decoded to save time.
    """

    id: int
    objectives: Values
    axis: int | None = None
    motion: RecordedMotion | None = None


def record_motion(motion: Any, *, curves: bool, samples: int | None = None) -> RecordedMotion | None:
    """Return a single motion as plain arrays, with the curves of its joints or without.

    Of more than so many ``samples`` evenly spaced ones are taken. None of what is no motion of an arm.
    """
    if not isinstance(motion, Motion):
        return None
    count = len(motion.time)
    rows = even_rows(count, count if samples is None else samples)
    kinds = {kind: np.array(getattr(motion, name)[rows]) for kind, name in LIMITED.items()} if curves else None
    return RecordedMotion(time=np.array(motion.time[rows]), q=np.array(motion.q[rows]), curves=kinds)


def joint_curves(cell: Workcell, motion: RecordedMotion) -> Mapping[str, np.ndarray]:
    """Return the joint quantities (time, dof) of a motion by kind of limit."""
    if motion.curves is not None:
        return motion.curves
    full = Motion(
        arm=cell.arm,
        time=motion.time,
        q=motion.q,
        differences=cell.differences,
        cyclic=cell.cyclic,
        ends_at_rest=cell.ends_at_rest,
    )
    return {kind: np.asarray(getattr(full, name)) for kind, name in LIMITED.items()}
