"""Runs on a cluster of this machine, and their cost: clock time, and the time of all processors."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from paretoik.runs.cluster import Cluster
from paretoik.runs.distribution import Function, distribute, distributing
from studies.benchmarks.scaling.local_cluster import LocalCluster


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
