"""Searches and starts on a Dask cluster of two workers and in one process, and a model of a thousand workers.

    python -m studies.benchmarks.scaling [--quick] [--json FILE]

The cluster is started as users start it, on this machine. Efficiency by processor is the computing time of this process
alone, divided by that of client, scheduler and workers for the same, with warm workers. Efficiency by clock is the time
alone, times the cores that it has, divided by twice that of two workers. Half of the runs alone are done before, half
after, since others may use the machine too. Overheads of a task are measured with tasks that do nothing, waiting with
tasks that sleep, both with two workers. The model with these numbers predicts the time of more workers than there are
cores, for tasks that sleep.
"""

from __future__ import annotations

import os
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cloudpickle
import numpy as np

import paretoik as pk
from paretoik.runs.cluster import OPTIONS as CLUSTER
from paretoik.runs.cluster import Cluster
from paretoik.runs.distribution import pickled
from studies.benchmarks.scaling.local_cluster import LocalCluster, local_cluster
from studies.benchmarks.scaling.measuring import (
    Overheads,
    Spent,
    compute_here,
    compute_there,
    fit_waiting,
    load,
    measuring,
    motions_of,
    panda_by_position,
    run_there,
    search,
    sleep,
)
from studies.reporting import Row, report, study_parser, tell

WORKERS = 2


@dataclass(frozen=True, kw_only=True)
class ScalingOptions:
    """Amounts: ``seeds`` of ``generations`` each, a plan of ``starts``, ``empty`` tasks.

    The plan is of a path of ``samples``; alone it is done before and after that of the cluster, or ``once``. Waiting is
    fitted to two runs, ``fitted`` numbers of tasks that ``sleep`` [s], and predicted for ``crowds`` of workers, each
    with ``rounds`` of tasks.
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


FULL = ScalingOptions()
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
    row = partial(Row, "what a worker costs")
    note = "library and compiled code from the disk, and a search"
    yield row("warm-up", "a worker", "CPU s", spent.workers / WORKERS, note=note)
    problem = panda_by_position(options.samples)
    problem.program()
    shipped = pickled("a problem", problem)
    yield row("problem", "shipped once", "kB", len(shipped) / 1e3, note="a Panda's path")
    with measuring(cluster) as spent:
        executor.client.scatter(np.random.default_rng(0).bytes(len(shipped)), broadcast=True)
    yield row("problem", "to two workers", "s", spent.wall)


def seeds(cluster: LocalCluster, executor: Cluster, options: ScalingOptions) -> Iterator[Row]:
    """Yield the searches of several seeds on the cluster, compared with one process."""
    items = list(range(options.seeds))
    first, before = compute_here(search, options.generations, items[: options.seeds // 2])
    there, spent = compute_there(executor, cluster, search, options.generations, items)
    second, after = compute_here(search, options.generations, items[options.seeds // 2 :])
    alone = Spent(wall=before.wall + after.wall, client=before.client + after.client)
    same = sum(np.array_equal(one, other) for one, other in zip([*first, *second], there, strict=True))
    size = np.mean([len(cloudpickle.dumps(each)) for each in there])
    yield from compared(f"{options.seeds} seeds", alone, spent, options.seeds, same, cores=1)
    yield Row("what a worker costs", "seed", "result", "kB", float(size) / 1e3)


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
    same = np.array_equal(motions_of(alone), motions_of(there))
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
    yield row("waiting", "between tasks", "ms", 1e3 * costs.gap)
    yield row("waiting", "startup", "ms", 1e3 * costs.startup)
    row = partial(Row, "model of a cluster")
    for seconds in (0.5, 1.0, 2.0, 5.0, 10.0):
        name = f"tasks of {seconds:g} s"
        yield row(name, "saturated by", "workers", costs.saturation(seconds))
        efficiency = costs.efficiency(100_000, seconds, 1000)
        yield row(name, "efficiency of 1,000 workers", "", efficiency, note="100,000 tasks")
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
        for name, part in {
            "warm-up": partial(warm_up, options=options),
            "seeds": partial(seeds, options=options),
            "starts": partial(starts, options=options),
        }.items():
            tell(name)
            done += part(cluster, executor)
        tell("overheads")
        costs = overheads(cluster, executor, options)
    return [*done, *model_rows(costs), *predictions(costs, options)]


def main() -> None:
    """Compute and report."""
    parser = study_parser(__doc__ or "", quick="fewer seeds, starts and workers: within a minute")
    arguments = parser.parse_args()
    warnings.filterwarnings("ignore", "(workers|cluster): ", RuntimeWarning)
    report(rows(QUICK if arguments.quick else FULL), json_file=arguments.json)


if __name__ == "__main__":
    main()
