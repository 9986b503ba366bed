"""What observers and the recording see of an ε-sweep: its points as they come, and each level of ε."""

from __future__ import annotations

import numpy as np

from paretoik.api.certificate_time import LaterStages, LaterTime
from paretoik.api.progress import RunProgress, count_observer
from paretoik.api.run_session import RunSession
from paretoik.api.sweep_words import phase_text
from paretoik.compilation_notices import computing_clock
from paretoik.formulations.protocol import Differentiable
from paretoik.front.front import Front
from paretoik.front.hypervolume_curve import HypervolumeCurve
from paretoik.front.marked_rows import marked_rows
from paretoik.nlp.program import Solver
from paretoik.pareto.sweep import SweepProgress
from paretoik.review.recording.least_violating import LeastViolating
from paretoik.review.recording.recorded_point import RecordedPoint, record_motion
from paretoik.review.recording.recorder import Generation, SearchEnd


class SweepDisplay:
    """Shows a session each step of a sweep.

    levels: number of steps under other bounds than the one before
    later: time of later stages, measured for an observer
    """

    def __init__(self, session: RunSession, formulation: Differentiable, solver: Solver) -> None:
        self.levels, self.later = 0, LaterTime(formulation=formulation, solver=solver)
        self._session, self._formulation = session, formulation
        self._signs = np.where(formulation.maximised, -1.0, 1.0)
        self._hypervolume = HypervolumeCurve()
        self._steps = self._points = 0
        self._level = b""
        self._started: float | None = None  # of the sweep
        self._show_optima = count_observer(session.observe, "optimum")

    def show_optima(self, done: int, total: int, summary: str = "") -> None:
        """Show the search for each objective's own optima; later ones, below an ε, are part of the sweep."""
        if self._show_optima is not None and self._started is None:
            self._show_optima(done, total, summary)

    def show_step(self, progress: SweepProgress) -> None:
        """Show a step in the user's own sign."""
        if self._started is None:
            self._started = computing_clock()
        level = b"" if progress.epsilon is None else progress.epsilon.tobytes()
        is_level = level not in (b"", self._level)
        if is_level:
            self.levels += 1
            self._level = level
        is_news, self._points = is_level or len(progress.x) > self._points, len(progress.x)
        if self._session.is_watched:
            self._show(progress, is_news=is_news)

    def finish(self, front: Front) -> None:
        """Record the front that the sweep led to, under no bound any more."""
        if self._session.recorder is not None:
            generation = Generation(
                number=self._steps,
                population=front.objectives,
                front=front.objectives,
                front_ids=front.ids,
                hypervolume=self._hypervolume.measure(front.minimised, self._steps),
            )
            self._session.recorder.record(generation)

    def infeasible_end(self, nearest: LeastViolating) -> SearchEnd:
        """Return the end of a sweep without a feasible motion, after a level that has the least-violating one."""
        if self._session.recorder is not None and nearest.point is not None:
            n_obj = len(self._signs)
            generation = Generation(
                number=self._steps,
                population=nearest.point.objectives[None],
                front=np.empty((0, n_obj)),
                front_ids=np.empty(0, dtype=int),
                least_violating=nearest,
            )
            self._session.recorder.record(generation)
        return SearchEnd(front=None, least_violating=nearest)

    def _marked(self, progress: SweepProgress) -> tuple[RecordedPoint, ...]:
        """Return the best point of every objective and the compromise, with their motions."""
        front = progress.objectives[progress.front]
        marked = marked_rows(front, progress.front)
        rows = [row for row, _ in marked]
        motions = self._formulation.individuals(progress.x[progress.front[rows]]).motions
        return tuple(
            RecordedPoint(
                id=int(progress.front[row]),
                objectives=front[row] * self._signs,
                axis=axis,
                motion=None if motions is None else record_motion(motions[place], curves=False),
            )
            for place, (row, axis) in enumerate(marked)
        )

    def _show(self, progress: SweepProgress, *, is_news: bool) -> None:
        assert self._started is not None
        generation = None
        if is_news:
            front = progress.objectives[progress.front]
            generation = Generation(
                number=self._steps,
                population=progress.objectives * self._signs,
                front=front * self._signs,
                front_ids=progress.front,
                hypervolume=self._hypervolume.measure(front, self._steps),
                points=self._marked(progress) if self._session.recorder is not None else (),
                epsilon=None if progress.epsilon is None else progress.epsilon * self._signs,
            )
            self._steps += 1
        seconds = computing_clock() - self._started
        self._session.show(
            RunProgress(
                stage="point",
                done=progress.done,
                total=progress.total,
                seconds=seconds,
                remaining=self.later.sweep_left(progress, seconds) if self._session.is_observed else None,
                summary=", ".join(
                    filter(None, [self._hypervolume.summary(self._steps - 1), phase_text(progress.phase)])
                ),
                generation=generation,
                following=LaterStages.of(self._formulation).text,
            )
        )
