"""Searches and starts on a Dask cluster of two workers and in one process, and a model of a thousand workers.

    python -m studies.benchmarks.scaling [--quick] [--json FILE]

Efficiency by processor is the computing time of this process alone, divided by that of client, scheduler and workers
for the same, with warm workers; by clock it is the time alone, times the cores that it has, divided by twice that of
two workers. Half of the runs alone are done before, half after. Overheads of a task are measured with tasks that do
nothing, waiting with tasks that sleep. The model with these numbers predicts the time of more workers than there are
cores.
"""

from __future__ import annotations

import math
import os
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import paretoik as pk
from paretoik.arrays import Objectives
from paretoik.runs.cluster import OPTIONS as CLUSTER
from paretoik.runs.cluster import Cluster
from paretoik.runs.distribution import Function, distribute, distributing, pickled
from problems import tringali_2020
from problems.panda import panda
from studies.benchmarks.scaling.local_cluster import LocalCluster, local_cluster
from studies.reporting import Row, report, study_parser, tell


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


WORKERS = 2


@dataclass(frozen=True, kw_only=True)
class ScalingOptions:
    """Amounts: ``seeds`` of ``generations`` each, a plan of ``starts`` along ``samples``, ``empty`` tasks.

    The plan alone is done before and after that of the cluster, or ``once``. Waiting is fitted to two runs, ``fitted``
    numbers of tasks that ``sleep`` [s], and predicted for ``crowds`` of workers, each with ``rounds`` of tasks.
    """

    seeds: int = 64
    generations: int = 100
    starts: int = 512
    samples: int = 51
    once: bool = False
    empty: int = 2000
    sleep: float = 0.25
    fitted: tuple[int, int] = (8, 48)
    crowds: tuple[int, ...] = (8, 12, 16)
    rounds: int = 30


QUICK = ScalingOptions(
    seeds=4, generations=30, starts=16, samples=26, once=True, empty=200, fitted=(4, 16), crowds=(4,), rounds=8
)


@contextmanager
def started(workers: int) -> Iterator[tuple[LocalCluster, Cluster]]:
    """Start a cluster on this machine, and yield it with the executor that sends every item as a task."""
    with (
        tempfile.TemporaryDirectory() as folder,
        local_cluster(Path(folder), workers) as cluster,
        closing(Cluster(cluster.address, replace(CLUSTER, portion=0.0, overhead=0.0))) as executor,
    ):
        executor.client.wait_for_workers(workers)
        yield cluster, executor


def warm_up(cluster: LocalCluster, executor: Cluster, options: ScalingOptions) -> Iterator[Row]:
    """Load the library and compiled code in every worker; yield the cost."""
    with measuring(cluster) as spent:
        executor.client.run(search, options.generations, 0)
    note = "library and compiled code from the disk, and a search"
    yield Row("what a worker costs", "warm-up", "a worker", "CPU s", spent.workers / WORKERS, note=note)
    problem = panda_by_position(options.samples)
    problem.program()
    size = len(pickled("a problem", problem)) / 1e3
    yield Row("what a worker costs", "problem", "shipped once", "kB", size, note="a Panda's path")


def seeds(cluster: LocalCluster, executor: Cluster, options: ScalingOptions) -> Iterator[Row]:
    """Yield the searches of several seeds on the cluster, compared with one process."""
    items = list(range(options.seeds))
    first, before = compute_here(search, options.generations, items[: options.seeds // 2])
    there, spent = compute_there(executor, cluster, search, options.generations, items)
    second, after = compute_here(search, options.generations, items[options.seeds // 2 :])
    alone = Spent(wall=before.wall + after.wall, client=before.client + after.client)
    same = sum(np.array_equal(one, other) for one, other in zip([*first, *second], there, strict=True))
    yield from compared(f"{options.seeds} seeds", alone, spent, options.seeds, same, cores=1)


def starts(cluster: LocalCluster, executor: Cluster, options: ScalingOptions) -> Iterator[Row]:
    """Yield a plan from many starts on the cluster, compared with one process of one thread per core."""
    problem = panda_by_position(options.samples)
    redundancy = problem.task.redundancy
    run = partial(pk.plan, problem, starts=options.starts // redundancy, seed=0, observe=False)
    run()  # compiled code is loaded
    with measuring(None) as before:
        alone = run()
    executor.options = replace(CLUSTER, portion=1.0, overhead=0.0)
    there, spent = run_there(executor, cluster, run)
    mean = before
    if not options.once:
        with measuring(None) as after:
            run()
        mean = Spent(wall=(before.wall + after.wall) / 2, client=(before.client + after.client) / 2)
    q, other = (np.stack([one.motion.q for one in plan.optima]) for plan in (alone, there))
    same = np.array_equal(q, other)
    cores = os.cpu_count() or 1
    yield from compared(f"{options.starts} starts", mean, spent, options.starts, same * options.starts, cores=cores)


def compared(name: str, alone: Spent, there: Spent, tasks: int, same: int, *, cores: int) -> Iterator[Row]:
    """Yield rows of the time of this process alone on ``cores``, of the cluster's time, and of its efficiency."""
    row = partial(Row, "two workers against one process", name)
    yield row("alone", "CPU s", alone.processor, note=f"{alone.processor / tasks:.2g} s each")
    parts = f"client {there.client:.3g}, scheduler {there.scheduler:.3g}, workers {there.workers:.3g}"
    yield row("cluster", "CPU s", there.processor, note=parts)
    efficiency = alone.processor / there.processor
    yield row("efficiency by processor", "", efficiency, reference=0.8, source="goal, at least")
    yield row("alone", "s", alone.wall)
    yield row("cluster", "s", there.wall)
    yield row("efficiency by clock", "", cores * alone.wall / (WORKERS * there.wall), note=busy())
    yield row("same, bit for bit", "", same, reference=tasks, source="all")


def overheads(cluster: LocalCluster, executor: Cluster, options: ScalingOptions) -> Overheads:
    """Return the costs of a task, measured with tasks that do nothing, and with tasks that sleep."""
    executor.options = replace(CLUSTER, portion=0.0, overhead=0.0)
    _, spent = compute_there(executor, cluster, sleep, None, [0.0] * options.empty)
    walls = [compute_there(executor, cluster, sleep, None, [options.sleep] * count)[1].wall for count in options.fitted]
    gap, startup = fit_waiting(options.fitted, walls, options.sleep, WORKERS)
    client, scheduler, worker = (each / options.empty for each in (spent.client, spent.scheduler, spent.workers))
    return Overheads(client=client, scheduler=scheduler, worker=worker, gap=gap, startup=startup)


def model_rows(costs: Overheads) -> Iterator[Row]:
    """Yield the model's statements for a thousand workers."""
    row = partial(Row, "a task beside its own work")
    for column in ("client", "scheduler", "worker"):
        yield row("processor", column, "ms", 1e3 * getattr(costs, column))
    row = partial(Row, "model of a cluster")
    for seconds in (0.5, 1.0, 2.0):
        yield row(f"tasks of {seconds:g} s", "saturated by", "workers", costs.saturation(seconds))
    size = costs.task_size(1000, 0.9)
    yield row("1,000 workers", "task size", "s", size, note="from which 0.9 of them is used")


def predictions(costs: Overheads, options: ScalingOptions) -> Iterator[Row]:
    """Yield the model's predictions for more workers than there are cores, and the measured times."""
    for workers in options.crowds:
        tell(f"{workers} workers")
        with started(workers) as (cluster, executor):
            count = options.rounds * workers
            executor.client.run(load)
            compute_there(executor, cluster, sleep, None, [0.0] * workers)
            wall = compute_there(executor, cluster, sleep, None, [options.sleep] * count)[1].wall
        row = partial(Row, "more workers than cores, tasks that sleep", f"{workers} workers")
        predicted = costs.makespan(count, options.sleep, workers)
        yield row("tasks", "", count, note=f"{options.sleep:g} s each")
        yield row("measured", "s", wall, reference=predicted, source="predicted", note=busy())
        error = abs(predicted - wall) / wall
        yield row("error of the prediction", "", error, reference=0.2, source="goal, at most")


def busy() -> str:
    """Return the number of processes that were ready to run in the last minute."""
    return f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"


def rows(options: ScalingOptions) -> Sequence[Row]:
    """Return all rows."""
    done = list[Row]()
    with started(WORKERS) as (cluster, executor):
        for part in (warm_up, seeds, starts):
            tell(part.__name__)
            done += part(cluster, executor, options)
        tell("overheads")
        costs = overheads(cluster, executor, options)
    return [*done, *model_rows(costs), *predictions(costs, options)]


def main() -> None:
    """Compute and report."""
    parser = study_parser(__doc__ or "", quick="fewer seeds, starts and workers: within a minute")
    arguments = parser.parse_args()
    warnings.filterwarnings("ignore", "(workers|cluster): ", RuntimeWarning)
    report(rows(QUICK if arguments.quick else ScalingOptions()), json_file=arguments.json)


if __name__ == "__main__":
    from studies.benchmarks.scaling.__main__ import main as named_main  # workers know its functions by this name

    named_main()
