"""The time of a cluster for many tasks: a model with overheads that are measured on a small one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Overheads:
    """The overhead of a task in seconds: of the processor in client, scheduler and worker, and waiting.

    ``gap`` passes in a worker between two tasks, ``startup`` before the first and after the last.
    """

    client: float
    scheduler: float
    worker: float
    gap: float
    startup: float

    @property
    def bottleneck(self) -> float:
        """The time per task of the slower of client and scheduler, each one process [s]."""
        return max(self.client, self.scheduler)

    def makespan(self, tasks: int, seconds: float, workers: int) -> float:
        """Return the time of ``workers`` for ``tasks`` of ``seconds`` each [s].

        Each worker has an even share, one task after the other; all tasks pass through client and scheduler.
        """
        return self.startup + max(math.ceil(tasks / workers) * (seconds + self.gap), tasks * self.bottleneck)

    def efficiency(self, tasks: int, seconds: float, workers: int) -> float:
        """Return the share of all workers' time that is spent on tasks."""
        return tasks * seconds / (workers * self.makespan(tasks, seconds, workers))

    def saturation(self, seconds: float) -> float:
        """Return the number of workers that saturates client or scheduler, for tasks of ``seconds``."""
        return (seconds + self.gap) / self.bottleneck

    def task_size(self, workers: int, efficiency: float) -> float:
        """Return the seconds of a task that keep workers busy to a share, in a run of many tasks."""
        waiting = efficiency / (1.0 - efficiency) * self.gap
        return max(waiting, efficiency * workers * self.bottleneck)


def fit_waiting(tasks: Sequence[int], walls: Sequence[float], seconds: float, workers: int) -> tuple[float, float]:
    """Return the gap between two tasks of a worker, and the startup, from runs of several task numbers [s]."""
    rounds = [math.ceil(count / workers) for count in tasks]
    slope, startup = np.polyfit(rounds, walls, 1)
    return max(float(slope) - seconds, 0.0), max(float(startup), 0.0)
