"""What observers and the recording see of a plan, and its picture: its levels of samples, and its optima."""

from __future__ import annotations

from typing import Any

import numpy as np

from paretoik.api.least_violating import limit_words
from paretoik.api.progress import count_observer
from paretoik.api.run_session import RunSession
from paretoik.review.palette import objective_label
from paretoik.review.recording.least_violating import LeastViolating
from paretoik.review.recording.planned import PlanEnd, PlannedLevel, PlannedMotions, PlannedOptimum, PlannedScene
from paretoik.review.recording.recorded_point import RecordedPoint, record_motion
from paretoik.review.recording.workcell import workcell_of
from paretoik.run_files import DRAWING
from paretoik.trajectory.level_progress import LevelProgress
from paretoik.trajectory.levels import OPTIONS
from paretoik.trajectory.plan import Plan
from paretoik.trajectory.program import joint_distance


class PlanDisplay:
    """Shows a session the levels of a plan and its result."""

    def __init__(self, session: RunSession, problem: Any) -> None:
        self._session, self._problem = session, problem
        self._show = count_observer(session.observe, "sample")
        self._levels = list[PlannedLevel]()
        (name,), (unit,), (maximised,) = problem.names, problem.units, problem.maximised
        self._label, self._unit = objective_label(name, unit, bool(maximised)), unit
        cell = workcell_of(problem)
        if cell is not None:
            scene = PlannedScene(name=name, unit=unit, maximised=bool(maximised), workcell=cell)
            session.start_recording(scene)

    def show_level(self, level: LevelProgress) -> None:
        """Show a level that is done."""
        if self._session.folder is not None:
            self._levels.append(_planned_level(len(self._levels), level))
            self._session.record(self._levels[-1])
        if self._show is not None:
            broken = level.describe_violation(self._problem.task) or f"{len(level.optima)} distinct optima"
            words = f"{len(level.starts)} starts, {broken}"
            self._show(level.samples, max(level.samples, len(self._problem.task.times)), words)

    def infeasible_end(self, nearest: LeastViolating) -> PlanEnd:
        """Return the end of a plan without a feasible motion."""
        return PlanEnd(least_violating=nearest)

    def review(self, plan: Plan) -> None:
        """Complete the recording with the optima, and, unless a signal came, draw the plan."""
        if self._session.folder is None:
            return
        self._session.finish_recording(_plan_end(plan))
        if self._session.signal is not None:
            return
        from paretoik.review.pictures.plan_picture import plan_picture  # here: matplotlib takes its time

        plan_picture(plan, self._levels, self._label, self._unit, self._session.folder / DRAWING)


def _planned_level(number: int, level: LevelProgress) -> PlannedLevel:
    """Return a level as it is drawn."""
    (objective,) = level.task.objectives
    kinds = (level.starts, level.ends, level.optima)
    starts, ends, optima = (np.asarray(objective(level.task.motion(q)), dtype=float) for q in kinds)
    motions = PlannedMotions(
        time=np.array(level.task.times),
        starts=level.starts,
        ends=level.ends,
        optima=level.optima,
        optimum=_nearest_optima(level),
    )
    return PlannedLevel(
        number=number,
        samples=level.samples,
        starts=starts,
        ends=np.where(level.converged, ends, np.nan),
        optima=optima,
        motions=motions,
        least_violating=_least_violating(level),
    )


def _least_violating(level: LevelProgress) -> LeastViolating | None:
    """Return what the best motion of a level breaks; None where it keeps all limits."""
    if level.feasible:
        return None
    return LeastViolating(broken=limit_words(level.task, level.task.motion(level.optima[0])))


def _nearest_optima(level: LevelProgress) -> np.ndarray:
    """Return for each start the place of the optimum that it led to, −1 where it led to none of them."""
    if not len(level.optima):
        return np.full(len(level.ends), -1)
    distance = np.stack([joint_distance(level.task, level.ends, optimum) for optimum in level.optima], axis=1)
    near = level.converged & (distance.min(axis=1) <= OPTIONS.distinct)
    return np.where(near, distance.argmin(axis=1), -1)


def _plan_end(plan: Plan) -> PlanEnd:
    """Return the optima as they are drawn."""
    optima = [
        PlannedOptimum(
            point=RecordedPoint(
                id=place,
                objectives=np.array([optimum.objective]),
                motion=record_motion(optimum.motion, curves=True),
            ),
            branch=optimum.label,
            status=optimum.status,
            violation_between=float(optimum.violation_between),
        )
        for place, optimum in enumerate(plan.optima)
    ]
    return PlanEnd(optima=optima, provenance=dict(plan.provenance))
