"""The end of a search as points that are drawn for themselves: the choice, and the best of every objective."""

from __future__ import annotations

from paretoik.front.front import Choice, Front
from paretoik.front.marked_rows import best_rows
from paretoik.review.recording.recorded_point import RecordedPoint, record_motion


def end_points(front: Front, choice: Choice | None) -> tuple[RecordedPoint, ...]:
    """Return the best points of a front's objectives, and its choice if there is one, with their motions."""
    if not len(front):
        return ()
    rows = best_rows(front.minimised, front.ids) if len(front.names) > 1 else []
    ends = tuple(front_point(front, row, axis=axis) for axis, row in enumerate(rows))
    return ends if choice is None else (*ends, chosen_point(choice))


def front_point(front: Front, row: int, *, axis: int | None = None) -> RecordedPoint:
    """Return a row of a front as a point, the best one of an objective where ``axis`` is given."""
    motion = None if front.motions is None else record_motion(front.motions[row], curves=axis is None)
    return RecordedPoint(id=int(front.ids[row]), objectives=front.objectives[row], axis=axis, motion=motion)


def chosen_point(choice: Choice) -> RecordedPoint:
    """Return a choice as a point."""
    return RecordedPoint(id=choice.id, objectives=choice.objectives, motion=record_motion(choice.motion, curves=True))
