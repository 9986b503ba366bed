"""Many runs over seeds, a process a core; whoever interrupts them keeps the seeds that are done."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from typing import Any, TypeVar

from pebble import ProcessExpired, ProcessPool
from rich.console import Console
from rich.progress import track

from studies.reporting import tell

Key = TypeVar("Key", bound=tuple[str, ...])
Item = TypeVar("Item")
Result = TypeVar("Result")

CORES = os.cpu_count() or 1
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@contextmanager
def processes() -> Iterator[ProcessPool]:
    """Yield a pool of one process a core, each of which computes on one thread."""
    for name in THREADS:
        os.environ.setdefault(name, "1")
    with ProcessPool(CORES, context=get_context("spawn")) as pool:
        yield pool


def run_seeds(
    pool: ProcessPool,
    work: Callable[..., Result],
    arguments: Callable[[int], Mapping[Key, Sequence[Any]]],
    seeds: int,
    *,
    limit: float,
    empty: Callable[[Key], Result],
) -> dict[Key, list[Result]]:
    """Return the results of ``work(*arguments(seed)[key])`` of every seed by key, seeds outermost.

    What crashes, or does not end within ``limit`` seconds, counts as ``empty(key)``. Interrupted, it returns the seeds
    that are done; nobody would wait hours to see nothing.
    """
    results: dict[Key, list[Result]] = {}
    try:
        for seed in range(seeds):
            jobs = {key: pool.schedule(work, args=args, timeout=limit) for key, args in arguments(seed).items()}
            bar = _bar(jobs.items(), f"seed {seed + 1} of {seeds}")
            ended = {key: _ended(job, partial(empty, key), (*key, f"seed {seed}"), limit) for key, job in bar}
            for key, result in ended.items():
                results.setdefault(key, []).append(result)
            tell(f"seed {seed + 1} of {seeds}: done")
    except KeyboardInterrupt:
        pool.stop()  # type: ignore[no-untyped-call]
        tell(f"interrupted in seed {seed + 1} of {seeds}: the seeds before it are judged")
    return results


def _bar(items: Iterable[Item], text: str) -> Iterable[Item]:
    console = Console(stderr=True)
    return track(items, text, console=console, transient=True, disable=not console.is_terminal)


def _ended(job: Future[Result], empty: Callable[[], Result], what: Sequence[str], limit: float) -> Result:
    try:
        return job.result()
    except TimeoutError:
        why = f"did not end within {limit:g} s"
    except ProcessExpired:
        why = "crashed"
    except Exception as fault:  # a peer may raise anything: hours of others' runs are not lost for it
        why = f"raised {type(fault).__name__}: {fault}"
    tell(f"{', '.join(what)} {why}: counted as empty")
    return empty()


def rotated(names: Sequence[str], turns: int) -> list[str]:
    """Return names in an order that turns with every seed, so that none always comes first."""
    first = turns % len(names)
    return [*names[first:], *names[:first]]
