"""What a run comes to that has found nothing feasible: the least-violating individual or motion, and what it breaks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from paretoik.api.infeasible_run import ObjectiveNames, infeasible_files
from paretoik.api.run_session import RunSession
from paretoik.errors import Infeasible
from paretoik.formulations.protocol import broken_words, decode, explain_violation, task_of, violation_words
from paretoik.review.recording.least_violating import LeastViolating
from paretoik.review.recording.planned import PlanEnd
from paretoik.review.recording.recorded_point import RecordedPoint, record_motion
from paretoik.review.recording.recorder import SearchEnd
from paretoik.search.ask_tell import Search
from paretoik.search.islands import Islands
from paretoik.stop_flag import Interrupted
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask


def infeasible_error(search: Search | Islands) -> Infeasible:
    """Return the error of a search without a feasible point, with the least-violating motion and what it breaks."""
    nearest = search.archive.least_violating
    if nearest is None:
        return Infeasible(f"no feasible point in {search.evaluations} evaluations, and none without a failure")
    limit, reason = explain_violation(search.problem, nearest.X, nearest.G[0])
    motions = decode(search.problem, nearest.X)
    return Infeasible(
        f"no motion within the limits in {search.evaluations} evaluations; of the least-violating one, {reason}",
        motion=None if motions is None else motions[0],
        limit=limit,
        violation=float(nearest.G.max()),
    )


def least_violating(search: Search | Islands) -> LeastViolating | None:
    """Return what a recording shows of the least-violating individual so far.

    None as soon as there is a feasible point, and where all evaluations failed.
    """
    nearest = search.archive.least_violating
    return None if nearest is None else LeastViolating(broken=violation_words(search.problem, nearest.G[0]))


def least_violating_end(search: Search | Islands, failure: Infeasible) -> LeastViolating:
    """Return what a recording shows at the end of a search without a feasible point."""
    nearest = search.archive.least_violating
    if nearest is None:
        return LeastViolating(broken=(), reason=str(failure))
    objectives = nearest.F[0] * np.where(search.maximised, -1.0, 1.0)
    motion = record_motion(failure.motion, curves=True)
    point = RecordedPoint(id=int(nearest.ids[0]), objectives=objectives, motion=motion)
    return LeastViolating(broken=violation_words(search.problem, nearest.G[0]), reason=str(failure), point=point)


def limit_words(task: MotionTask, motion: Motion) -> tuple[str, ...]:
    """Return which limits a motion breaks and by how much, the worst first."""
    return broken_words(task.limit_names, ["of its range"] * len(task.limit_names), task.violations(motion))


@contextmanager
def infeasible_recorded(
    session: RunSession, problem: Any, end: Callable[[LeastViolating], PlanEnd | SearchEnd]
) -> Iterator[None]:
    """Let a body that finds no feasible motion complete the recording, with the ``end`` of the least-violating one.

    So it does if a signal or the time limit ends it before there is one.
    """
    try:
        yield
    except (Infeasible, Interrupted) as error:
        failure = error if isinstance(error, Infeasible) else Infeasible(error.reason, motion=error.motion)
        if failure is error or failure.motion is not None:
            nearest = nearest_motion(problem, failure)
            finish_infeasible(session, problem, failure, nearest, end(nearest))
        if failure is not error and failure.motion is not None:
            error.add_note(f"by then there was {failure}")
        raise


def finish_infeasible(
    session: RunSession, names: ObjectiveNames, failure: Infeasible, nearest: LeastViolating, end: PlanEnd | SearchEnd
) -> None:
    """Complete the recording of a run that found nothing feasible, and keep what comes nearest in its folder."""
    session.infeasible = infeasible_files(names, failure, nearest)
    with session.reviewing():
        session.finish_recording(end)


def nearest_motion(problem: Any, failure: Infeasible) -> LeastViolating:
    """Return what a recording shows of the motion that an error has."""
    task, motion = task_of(problem), failure.motion
    if task is None or not isinstance(motion, Motion):
        return LeastViolating(broken=(), reason=str(failure))
    objectives = np.array([float(objective(motion)) for objective in task.objectives])
    point = RecordedPoint(id=0, objectives=objectives, motion=record_motion(motion, curves=True))
    return LeastViolating(broken=limit_words(task, motion), reason=str(failure), point=point)
