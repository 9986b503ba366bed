"""The points of a generation that a recording shows for themselves, and their motions, as far as there is time."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from paretoik.formulations.protocol import decode
from paretoik.front.marked_rows import marked_rows
from paretoik.review.recording.recorded_point import RecordedPoint, record_motion
from paretoik.search.ask_tell import Search
from paretoik.search.endings import Progress
from paretoik.search.islands import Islands


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """How many motions are decoded for a recording.

    Decoding takes at most a ``share`` of the run's time. Those of so many generations as ``dense`` are decoded one
    after the other, of as many after them every second, then every fourth, and so on. ``samples`` is the most of each.
    """

    share: float = 0.01
    dense: int = 60
    samples: int = 401


OPTIONS = MotionOptions()


class GenerationMotions:
    """Finds in each generation of a search the best point of every objective and the compromise."""

    def __init__(self, search: Search | Islands) -> None:
        self._search = search
        self._shown: list[int] = []  # ids whose motions were decoded last
        self._decoded = 0
        self._next = 0
        self._spent, self._started = 0.0, time.monotonic()
        self._moves = True

    def points(self, progress: Progress) -> tuple[RecordedPoint, ...]:
        """Return the points, with motions where these have changed and there was time to decode them."""
        if not len(progress.front):
            return ()
        marked = marked_rows(progress.front, progress.ids)
        signs = np.where(self._search.maximised, -1.0, 1.0)
        points = tuple(
            RecordedPoint(id=int(progress.ids[row]), objectives=progress.front[row] * signs, axis=axis)
            for row, axis in marked
        )
        ids = [point.id for point in points]
        if not self._moves or ids == self._shown or not self._is_due(progress.generation):
            return points
        started = time.monotonic()
        points = self._with_motions(points, [row for row, _ in marked])
        self._spent += time.monotonic() - started
        self._shown, self._decoded = ids, self._decoded + 1
        self._next = progress.generation + 2 ** (self._decoded // OPTIONS.dense)
        return points

    def _is_due(self, generation: int) -> bool:
        elapsed = time.monotonic() - self._started
        return generation >= self._next and self._spent <= OPTIONS.share * elapsed

    def _with_motions(self, points: tuple[RecordedPoint, ...], rows: list[int]) -> tuple[RecordedPoint, ...]:
        members = self._search.archive.members
        assert members is not None
        unique, place = np.unique(rows, return_inverse=True)
        motions = decode(self._search.problem, members.X[unique])
        if motions is None:
            self._moves = False
            return points
        return tuple(
            replace(point, motion=record_motion(motions[int(i)], curves=False, samples=OPTIONS.samples))
            for point, i in zip(points, place, strict=True)
        )
