"""Independent parts of a study's work: run in this process, in one process per core, or on a Dask cluster."""

from __future__ import annotations

import os
import pickle
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import cloudpickle
from rich.console import Console
from rich.progress import track

from paretoik.errors import InvalidInput
from paretoik.runs.distribution import Done, Executor, Raised, Reply
from paretoik.runs.executor import check_workers
from paretoik.runs.processes import WorkerProcesses
from studies.reporting import tell

Key = TypeVar("Key", bound=tuple[str, ...])
Result = TypeVar("Result")

CORES = os.cpu_count() or 1


@contextmanager
def processes(cluster: str | None = None) -> Iterator[Executor]:
    """Yield one process of one thread per core, or the workers of a Dask cluster at an address.

    A cluster's workers import the studies and the peers: start them at the root of a checkout with the extra ``bench``,
    and on machines like this one if times are compared.
    """
    if cluster is None:
        with closing(WorkerProcesses(CORES)) as here:
            yield here
        return
    with workers_of(cluster) as there:
        assert there is not None
        yield there


@contextmanager
def workers_of(cluster: str | None) -> Iterator[Executor | None]:
    """Yield the workers of a Dask cluster at an address; without one, None for this process."""
    if cluster is None:
        yield None
        return
    from paretoik.runs.cluster import (
        OPTIONS,
        Cluster,  # imported here: it needs Dask
    )

    try:
        check_workers(None, cluster)
        there = Cluster(cluster, replace(OPTIONS, portion=0.0, overhead=0.0))  # one run per task
    except InvalidInput as error:
        raise SystemExit(str(error)) from error
    with closing(there):
        yield there


def run_seeds(
    executor: Executor,
    work: Callable[..., Result],
    arguments: Callable[[int], Mapping[Key, Sequence[Any]]],
    seeds: int,
    *,
    limit: float,
    empty: Callable[[Key], Result],
    load: Callable[[Key, int], Result | None] = lambda key, seed: None,
    save: Callable[[Key, int, Result], None] = lambda key, seed, result: None,
) -> dict[Key, list[Result]]:
    """Return the results of ``work(*arguments(seed)[key])`` by key, one per seed, computed seed by seed.

    A result that ``load(key, seed)`` finds is not computed again; ``save(key, seed, result)`` gets each new one at
    once. A run that crashes, or does not end within ``limit`` seconds, counts as ``empty(key)``. After an interrupt the
    seeds that are done are returned, so that hours of work are not lost.
    """
    calls = {(seed, key): args for seed in range(seeds) for key, args in arguments(seed).items()}
    loaded = {(seed, key): load(key, seed) for seed, key in calls}
    results = {place: result for place, result in loaded.items() if result is not None}
    jobs = [place for place in calls if place not in results]
    items, missing = [_job(work, calls[place]) for place in jobs], Counter(seed for seed, _ in jobs)
    try:
        for number, reply in _bar(executor.replies(call, None, items, seconds=limit), len(items)):
            seed, key = jobs[number]
            results[seed, key] = reply.value if isinstance(reply, Done) else empty(key)
            if isinstance(reply, Done):
                save(key, seed, reply.value)
            else:
                tell(f"{', '.join((*key, f'seed {seed}'))}: {_fault(reply)}: counted as empty")
            missing[seed] -= 1
            if not missing[seed]:
                tell(f"seed {seed + 1} of {seeds}: done")
    except KeyboardInterrupt:
        tell(f"interrupted: {sum(not missing[seed] for seed in range(seeds))} of {seeds} seeds are done and count")
    whole: dict[Key, list[Result]] = {}
    for seed, key in calls:
        if not missing[seed]:
            whole.setdefault(key, []).append(results[seed, key])
    return whole


def run_each(executor: Executor | None, calls: Mapping[Key, Callable[[], Result]]) -> dict[Key, Result]:
    """Return the results of calls by key, as ``each_result`` does, and print the key of each finished call."""
    results: dict[Key, Result] = {}
    for key, result in each_result(executor, calls):
        results[key] = result
        tell(", ".join(key))
    return {key: results[key] for key in calls}


def each_result(
    executor: Executor | None, calls: Mapping[Key, Callable[[], Result]], *, limit: float | None = None
) -> Iterator[tuple[Key, Result]]:
    """Yield the results of calls without arguments (``functools.partial`` of a module's function), as they end.

    Without an executor this process computes them in their order. ``limit``: longest time of each call [s]. Raises
    SystemExit if a call crashes or takes longer, and any error that a call raises.
    """
    if executor is None:
        yield from _bar(((key, compute()) for key, compute in calls.items()), len(calls))
        return
    keys, items = list(calls), [_job(compute, ()) for compute in calls.values()]
    for place, reply in _bar(executor.replies(call, None, items, seconds=limit), len(items)):
        if isinstance(reply, Raised):
            raise reply.error
        if not isinstance(reply, Done):
            raise SystemExit(f"{', '.join(keys[place])}: {_fault(reply)}")
        yield keys[place], reply.value


def call(_: None, job: bytes) -> Any:
    """Call the function with the arguments that a job contains."""
    work, args = pickle.loads(job)
    return work(*args)


def _job(work: Callable[..., Any], args: Sequence[Any]) -> bytes:
    """Return a call as bytes: functions of modules as their names, others as their content."""
    return bytes(cloudpickle.dumps((work, tuple(args))))


def _bar(results: Iterator[Result], total: int) -> Iterator[Result]:
    console = Console(stderr=True)
    yield from track(results, "runs", total=total, console=console, transient=True, disable=not console.is_terminal)


def _fault(reply: Reply) -> str:
    """Return why a reply has no value."""
    if isinstance(reply, Raised):  # a peer may raise any error, which must not stop the runs of others
        return f"raised {type(reply.error).__name__}: {reply.error}"
    return getattr(reply, "cause", "")


def children_of(process: int) -> list[int]:
    """Return the processes that a process has started, from any of its threads."""
    children = list[int]()
    with suppress(OSError):  # it has ended meanwhile
        for thread in Path(f"/proc/{process}/task").iterdir():
            with suppress(OSError):
                children += [int(child) for child in (thread / "children").read_text().split()]
    return children


def rotated(names: Sequence[str], turns: int) -> list[str]:
    """Return names in an order that rotates with every seed, so that none always comes first."""
    first = turns % len(names)
    return [*names[first:], *names[:first]]
