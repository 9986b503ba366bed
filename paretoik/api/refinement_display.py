"""What the recording sees of a refinement: the front before it and after it, and where each point came from."""

from __future__ import annotations

from typing import Any

import numpy as np

from paretoik.api.run_session import RunSession
from paretoik.arrays import Objectives
from paretoik.front import indicators
from paretoik.front.front import Front
from paretoik.front.hypervolume_curve import HypervolumeCurve
from paretoik.front.marked_rows import marked_rows
from paretoik.review.recording.recorded_end import front_point
from paretoik.review.recording.recorded_point import RecordedPoint
from paretoik.review.recording.recorder import Generation
from paretoik.review.recording.workcell import workcell_of


class RefinementDisplay:
    """Records a front as it was, at 0 of the timeline ``refinement``, and as it became, at 1."""

    def __init__(self, session: RunSession, front: Front, problem: Any) -> None:
        self._session, self._front, self._hypervolume = session, front, HypervolumeCurve()
        session.start(
            names=front.names,
            units=front.units,
            maximised=front.maximised,
            timeline="refinement",
            workcell=workcell_of(problem),
        )
        self._record(0, front, None)

    def show(self, refined: Front) -> None:
        """Record the refined front."""
        self._record(1, refined, self._front.objectives[_rows_before(self._front, refined)])

    def _record(self, number: int, front: Front, origins: Objectives | None) -> None:
        if self._session.recorder is None:
            return
        self._session.recorder.record(
            Generation(
                number=number,
                population=self._front.objectives,
                front=front.objectives,
                front_ids=front.ids,
                hypervolume=self._hypervolume.measure(front.minimised, number),
                points=_marked(front),
                origins=origins,
            )
        )


def _marked(front: Front) -> tuple[RecordedPoint, ...]:
    """Return the best point of every objective and the compromise, with their motions."""
    if not len(front):
        return ()
    return tuple(front_point(front, row, axis=axis) for row, axis in marked_rows(front.minimised, front.ids))


def improved_points(before: Front, after: Front) -> int:
    """Return how many points of a front are better in some objective than they were, by more than rounding."""
    gain = before.minimised[_rows_before(before, after)] - after.minimised
    rounding = indicators.OPTIONS.rounding * indicators.ranges_of(before.minimised)
    return int((gain > rounding).any(axis=1).sum()) if len(after) else 0


def _rows_before(before: Front, after: Front) -> np.ndarray:
    """Return the rows at which the points of a front were before, by their ids."""
    rows = {int(number): row for row, number in enumerate(before.ids)}
    return np.array([rows[int(number)] for number in after.ids], dtype=int)
