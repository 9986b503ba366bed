"""The timeline ``replay``: one generation after the other, and in those that have motions the arm moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paretoik.arrays import Times
from paretoik.review.even_rows import even_rows
from paretoik.review.recording.recorded_point import RecordedPoint


@dataclass(frozen=True, kw_only=True)
class ReplayOptions:
    """How long [s] a generation lasts that moves, and one that does not; how many move at most, and samples of each."""

    moving: float = 1.0
    standing: float = 0.1
    generations: int = 60
    samples: int = 41


OPTIONS = ReplayOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class ReplayClock:
    """When each of some generations begins [s], which of them move, and when all are over."""

    begins: Times
    moving: frozenset[int]
    end: float

    @staticmethod
    def of(generations: Sequence[Sequence[RecordedPoint]]) -> ReplayClock:
        """Return the clock of the points of generations: those that move are spread evenly over those with motions."""
        able = [i for i, points in enumerate(generations) if is_moving(points)]
        moving = frozenset(able[i] for i in even_rows(len(able), OPTIONS.generations))
        lengths = [OPTIONS.moving if i in moving else OPTIONS.standing for i in range(len(generations))]
        ends = np.cumsum([0.0, *lengths])
        return ReplayClock(begins=ends[:-1], moving=moving, end=float(ends[-1]))


def replay_times(point: RecordedPoint, points: Sequence[RecordedPoint], begin: float) -> tuple[np.ndarray, Times]:
    """Return rows of a point's motion and when the arm is there, so that the longest of ``points`` takes its slot."""
    motion = point.motion
    assert motion is not None
    longest = max(float(each.motion.time[-1] - each.motion.time[0]) for each in points if each.motion is not None)
    rows = even_rows(len(motion.time), OPTIONS.samples)
    share = (motion.time[rows] - motion.time[0]) / max(longest, 1e-12)
    return rows, begin + 0.9 * OPTIONS.moving * share


def is_moving(points: Sequence[RecordedPoint]) -> bool:
    """Say whether points have motions in which an arm does not stand still."""
    return any(point.motion is not None and not point.motion.is_standing for point in points)


def has_motions(points: Sequence[RecordedPoint]) -> bool:
    """Say whether points have motions."""
    return any(point.motion is not None for point in points)
