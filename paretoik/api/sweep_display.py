"""What observers and the recording see of an ε-sweep: its points as they come, and each level of ε."""

from __future__ import annotations

import time

import numpy as np

from paretoik.api.hypervolume_curve import HypervolumeCurve
from paretoik.api.progress import RunProgress
from paretoik.api.run_session import RunSession
from paretoik.formulations.protocol import Differentiable
from paretoik.pareto.sweep import SweepProgress
from paretoik.review.recorder import Generation


class SweepDisplay:
    """Shows a session each step of a sweep; ``levels`` counts those under other bounds than the one before."""

    def __init__(self, session: RunSession, formulation: Differentiable) -> None:
        self.levels = 0
        self._session, self._started = session, time.monotonic()
        self._signs = np.where(formulation.maximised, -1.0, 1.0)
        self._hypervolume = HypervolumeCurve()
        self._steps = self._points = 0
        self._level = b""

    def __call__(self, progress: SweepProgress) -> None:
        """Show a step in the user's own sign."""
        level = b"" if progress.epsilon is None else progress.epsilon.tobytes()
        is_level = level not in (b"", self._level)
        if is_level:
            self.levels += 1
            self._level = level
        is_news, self._points = is_level or len(progress.objectives) > self._points, len(progress.objectives)
        if not (is_news and self._session.is_watched):
            return
        front = progress.objectives[progress.front]
        volume = self._hypervolume(front)
        generation = Generation(
            number=self._steps,
            population=progress.objectives * self._signs,
            front=front * self._signs,
            front_ids=progress.front,
            hypervolume=volume,
            epsilon=None if progress.epsilon is None else progress.epsilon * self._signs,
        )
        self._steps += 1
        self._session.show(
            RunProgress(
                stage="point",
                done=progress.done,
                total=progress.total,
                seconds=time.monotonic() - self._started,
                summary=f"hypervolume {volume:.4g}",
                generation=generation,
            )
        )
