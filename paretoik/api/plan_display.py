"""What observers see of a plan, and its picture: its levels of samples, and its optima."""

from __future__ import annotations

from typing import Any

import numpy as np

from paretoik.api.progress import count_observer
from paretoik.api.run_session import RunSession
from paretoik.review.palette import objective_label
from paretoik.review.planned import PlannedLevel
from paretoik.run_files import DRAWING
from paretoik.trajectory.level_progress import LevelProgress
from paretoik.trajectory.plan import Plan


class PlanDisplay:
    """Shows a session the levels of a plan and its result."""

    def __init__(self, session: RunSession, problem: Any) -> None:
        self._session, self._problem = session, problem
        self._show = count_observer(session.observe, "sample")
        self._levels = list[PlannedLevel]()

    def show_level(self, level: LevelProgress) -> None:
        """Show a level that is done."""
        if self._session.folder is not None:
            self._levels.append(_planned_level(len(self._levels), level))
        if self._show is not None:
            words = f"{len(level.starts)} starts, {len(level.optima)} distinct optima"
            self._show(level.samples, len(self._problem.task.times), words)

    def review(self, plan: Plan) -> None:
        """Draw the plan, unless a signal came."""
        if self._session.folder is None or self._session.signal is not None:
            return
        from paretoik.review.plan_picture import plan_picture  # here: matplotlib takes its time

        plan_picture(plan, self._levels, self._label, self._session.folder / DRAWING)

    @property
    def _label(self) -> str:
        (name,), (unit,), (maximised,) = self._problem.names, self._problem.units, self._problem.maximised
        return objective_label(name, unit, bool(maximised))


def _planned_level(number: int, level: LevelProgress) -> PlannedLevel:
    """Return a level as it is drawn."""
    (objective,) = level.task.objectives
    starts, optima = (np.asarray(objective(level.task.motion(q))) for q in (level.starts, level.optima))
    return PlannedLevel(number=number, samples=level.samples, starts=starts, optima=optima)
