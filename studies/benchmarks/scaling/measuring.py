"""Work that shows how a cluster scales, its cost, and a model with overheads that are measured on a small one."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

import paretoik as pk
from paretoik.arrays import Objectives
from paretoik.runs.cluster import Cluster
from paretoik.runs.distribution import Function, distribute, distributing
from problems import tringali_2020
from problems.panda import panda
from studies.benchmarks.scaling.local_cluster import LocalCluster


def search(generations: int, seed: int) -> Objectives:
    """Return the objectives of the front that a search of a planar arm finds."""
    problem = tringali_2020.energy_torque()
    return pk.solve(problem, population=100, generations=generations, seed=seed, stagnation=False).objectives


def load() -> None:
    """Load everything that a worker needs for any task."""
    import paretoik.runs.cluster  # noqa: F401


def sleep(shared: None, seconds: float) -> None:
    """Take some time and no processor."""
    time.sleep(seconds)


def panda_by_position(samples: int) -> pk.Tracking:
    """Return a task of a 7-DOF arm, whose starts take some hundredths of a second each."""
    path = pk.line([0.45, -0.25, 0.3], [0.45, 0.25, 0.3], duration=1.5, samples=samples)
    return pk.Tracking(panda(), path, objectives=[pk.kinetic_energy])


def motions_of(plan: pk.Plan) -> np.ndarray:
    """Return the motions of all optima of a plan."""
    return np.stack([optimum.motion.q for optimum in plan.optima])


@dataclass(kw_only=True)
class Spent:
    """Seconds: on the clock, and of the processor in this process, the scheduler and all workers."""

    wall: float = 0.0
    client: float = 0.0
    scheduler: float = 0.0
    workers: float = 0.0

    @property
    def processor(self) -> float:
        """Seconds of the processor in all processes."""
        return self.client + self.scheduler + self.workers


@contextmanager
def measuring(cluster: LocalCluster | None) -> Iterator[Spent]:
    """Measure the cost of the body, here and on a cluster, if there is one."""
    spent, wall, client = Spent(), time.perf_counter(), time.process_time()
    scheduler, workers = (0.0, 0.0) if cluster is None else cluster.processor_seconds()
    yield spent
    spent.wall, spent.client = time.perf_counter() - wall, time.process_time() - client
    if cluster is not None:
        scheduler_after, workers_after = cluster.processor_seconds()
        spent.scheduler, spent.workers = scheduler_after - scheduler, workers_after - workers


def compute_here(function: Function, shared: Any, items: Sequence[Any]) -> tuple[list[Any], Spent]:
    """Return the results of all items, computed one after the other in this process."""
    with measuring(None) as spent:
        results = [function(shared, item) for item in items]
    return results, spent


def compute_there(
    executor: Cluster, cluster: LocalCluster, function: Function, shared: Any, items: Sequence[Any]
) -> tuple[list[Any], Spent]:
    """Return the results of all items, computed by a cluster's workers."""
    with distributing(executor), measuring(cluster) as spent:
        by_place = dict(distribute(function, shared, items))
    return [by_place[i] for i in range(len(items))], spent


def run_there(executor: Cluster, cluster: LocalCluster, run: Callable[[], Any]) -> tuple[Any, Spent]:
    """Return the result of a run, with its tasks computed by a cluster's workers."""
    with distributing(executor), measuring(cluster) as spent:
        return run(), spent


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
