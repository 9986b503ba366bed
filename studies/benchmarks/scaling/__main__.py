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
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import paretoik as pk
from paretoik.arrays import Objectives
from paretoik.runs.cluster import OPTIONS as CLUSTER
from paretoik.runs.cluster import Cluster
from paretoik.runs.distribution import Function, distribute, distributing, pickled
from problems import tringali_2020
from problems.panda import panda
from studies.benchmarks.scaling.local_cluster import LocalCluster, local_cluster
from studies.reporting import Row, goal_row, report, study_parser, tell

WORKERS = 2
EACH_ITEM = replace(CLUSTER, portion=0.0, overhead=0.0)  # every item is a task


@dataclass(frozen=True, kw_only=True)
class ScalingOptions:
    """Amounts: ``seeds`` of ``generations`` each, a plan of ``starts`` along ``samples``, ``empty`` tasks.

    Waiting is fitted to two runs, ``fitted`` numbers of tasks that ``sleep`` [s], and predicted for ``crowds`` of
    workers, each with ``rounds`` of tasks.
    """

    seeds: int = 64
    generations: int = 100
    starts: int = 512
    samples: int = 51
    empty: int = 2000
    sleep: float = 0.25
    fitted: tuple[int, int] = (8, 48)
    crowds: tuple[int, ...] = (8, 12, 16)
    rounds: int = 30


QUICK = ScalingOptions(seeds=4, generations=30, starts=16, samples=26, empty=200, fitted=(4, 16), crowds=(4,), rounds=8)


def search(generations: int, seed: int) -> Objectives:
    """Return the objectives of the front that a search of a planar arm finds."""
    problem = tringali_2020.energy_torque()
    return pk.solve(problem, population=100, generations=generations, seed=seed, stagnation=False).objectives


def sleep(shared: None, seconds: float) -> None:
    """Take some time and no processor."""
    time.sleep(seconds)


def panda_by_position(samples: int) -> pk.Tracking:
    """Return a task of a 7-DOF arm, whose starts take some hundredths of a second each."""
    path = pk.line([0.45, -0.25, 0.3], [0.45, 0.25, 0.3], duration=1.5, samples=samples)
    return pk.Tracking(panda(), path, objectives=[pk.kinetic_energy])


class Spent(NamedTuple):
    """Seconds: on the clock, and of the processor in this process, the scheduler and all workers."""

    wall: float
    client: float
    scheduler: float = 0.0
    workers: float = 0.0

    @property
    def processor(self) -> float:
        """Seconds of the processor in all processes."""
        return self.client + self.scheduler + self.workers


def measured(
    work: Callable[[], Any], cluster: LocalCluster | None = None, on: Cluster | None = None
) -> tuple[Any, Spent]:
    """Return the result of work, whose tasks are computed ``on`` a cluster's workers, and its cost."""
    wall, client = time.perf_counter(), time.process_time()
    scheduler, workers = (0.0, 0.0) if cluster is None else cluster.processor_seconds()
    with nullcontext() if on is None else distributing(on):
        result = work()
    wall, client = time.perf_counter() - wall, time.process_time() - client
    after = (0.0, 0.0) if cluster is None else cluster.processor_seconds()
    return result, Spent(wall, client, after[0] - scheduler, after[1] - workers)


def distributed(function: Function, shared: Any, items: Sequence[Any]) -> list[Any]:
    """Return the results of all items in their order."""
    by_place = dict(distribute(function, shared, items))
    return [by_place[i] for i in range(len(items))]


class Overheads(NamedTuple):
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


@contextmanager
def started(workers: int) -> Iterator[tuple[LocalCluster, Cluster]]:
    """Start a cluster on this machine, and yield it with the executor that sends every item as a task."""
    with (
        tempfile.TemporaryDirectory() as folder,
        local_cluster(Path(folder), workers) as cluster,
        closing(Cluster(cluster.address, EACH_ITEM)) as executor,
    ):
        executor.client.wait_for_workers(workers)
        yield cluster, executor


def warm_up(cluster: LocalCluster, executor: Cluster, options: ScalingOptions) -> Iterator[Row]:
    """Load the library and compiled code in every worker; yield the cost."""
    _, spent = measured(lambda: executor.client.run(search, options.generations, 0), cluster)
    note = "library and compiled code from the disk, and a search"
    yield Row("what a worker costs", "warm-up", "a worker", "CPU s", spent.workers / WORKERS, note=note)
    problem = panda_by_position(options.samples)
    problem.program()
    size = len(pickled("a problem", problem)) / 1e3
    yield Row("what a worker costs", "problem", "shipped once", "kB", size, note="a Panda's path")


def seeds(cluster: LocalCluster, executor: Cluster, options: ScalingOptions) -> Iterator[Row]:
    """Yield the searches of several seeds on the cluster, compared with one process."""
    half, generations = options.seeds // 2, options.generations
    first, before = measured(lambda: [search(generations, seed) for seed in range(half)])
    there, spent = measured(lambda: distributed(search, generations, range(options.seeds)), cluster, executor)
    second, after = measured(lambda: [search(generations, seed) for seed in range(half, options.seeds)])
    alone = Spent(before.wall + after.wall, before.client + after.client)
    same = sum(np.array_equal(one, other) for one, other in zip([*first, *second], there, strict=True))
    yield from compared(f"{options.seeds} seeds", alone, spent, options.seeds, same, cores=1)


def starts(cluster: LocalCluster, executor: Cluster, options: ScalingOptions) -> Iterator[Row]:
    """Yield a plan from many starts on the cluster, compared with one process of one thread per core."""
    problem = panda_by_position(options.samples)
    run = partial(pk.plan, problem, starts=options.starts // problem.task.redundancy, seed=0, observe=False)
    run()  # compiled code is loaded
    here, before = measured(run)
    executor.options = replace(CLUSTER, portion=1.0, overhead=0.0)
    there, spent = measured(run, cluster, executor)
    after = measured(run)[1]
    alone = Spent((before.wall + after.wall) / 2, (before.client + after.client) / 2)
    q, other = (np.stack([one.motion.q for one in plan.optima]) for plan in (here, there))
    same = options.starts * np.array_equal(q, other)
    yield from compared(f"{options.starts} starts", alone, spent, options.starts, same, cores=os.cpu_count() or 1)


def compared(name: str, alone: Spent, there: Spent, tasks: int, same: int, *, cores: int) -> Iterator[Row]:
    """Yield rows of the time of this process alone on ``cores``, of the cluster's time, and of its efficiency."""
    place = "two workers against one process", name
    yield Row(*place, "alone", "CPU s", alone.processor, note=f"{alone.processor / tasks:.2g} s each")
    parts = f"client {there.client:.3g}, scheduler {there.scheduler:.3g}, workers {there.workers:.3g}"
    yield Row(*place, "cluster", "CPU s", there.processor, note=parts)
    yield goal_row(*place, "efficiency by processor", "", alone.processor / there.processor, 0.8, least=True)
    yield Row(*place, "alone", "s", alone.wall)
    yield Row(*place, "cluster", "s", there.wall)
    yield Row(*place, "efficiency by clock", "", cores * alone.wall / (WORKERS * there.wall), note=busy())
    yield Row(*place, "same, bit for bit", "", same, reference=tasks, source="all")


def overheads(cluster: LocalCluster, executor: Cluster, options: ScalingOptions) -> Overheads:
    """Return the costs of a task, measured with tasks that do nothing, and with tasks that sleep."""

    def slept(seconds: float, count: int) -> Spent:
        return measured(lambda: distributed(sleep, None, [seconds] * count), cluster, executor)[1]

    executor.options = EACH_ITEM
    spent = slept(0.0, options.empty)
    walls = [slept(options.sleep, count).wall for count in options.fitted]
    client, scheduler, worker = (each / options.empty for each in (spent.client, spent.scheduler, spent.workers))
    return Overheads(client, scheduler, worker, *fit_waiting(options.fitted, walls, options.sleep, WORKERS))


def model_rows(costs: Overheads) -> Iterator[Row]:
    """Yield the model's statements for a thousand workers."""
    for column in ("client", "scheduler", "worker"):
        yield Row("a task beside its own work", "processor", column, "ms", 1e3 * getattr(costs, column))
    model = "model of a cluster"
    for seconds in (0.5, 1.0, 2.0):
        yield Row(model, f"tasks of {seconds:g} s", "saturated by", "workers", costs.saturation(seconds))
    note = "from which 0.9 of them is used"
    yield Row(model, "1,000 workers", "task size", "s", costs.task_size(1000, 0.9), note=note)


def predictions(costs: Overheads, options: ScalingOptions) -> Iterator[Row]:
    """Yield the model's predictions for more workers than there are cores, and the measured times."""
    for workers in options.crowds:
        tell(f"{workers} workers")
        count = options.rounds * workers
        with started(workers) as (cluster, executor):
            executor.client.run(sleep, None, 0.0)  # loads the library
            for seconds, tasks in ((0.0, workers), (options.sleep, count)):
                work = partial(distributed, sleep, None, [seconds] * tasks)
                wall = measured(work, cluster, executor)[1].wall
        place = "more workers than cores, tasks that sleep", f"{workers} workers"
        predicted = costs.makespan(count, options.sleep, workers)
        yield Row(*place, "measured", "s", wall, reference=predicted, source="predicted", note=busy())
        yield goal_row(*place, "error of the prediction", "", abs(predicted - wall) / wall, 0.2)


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
