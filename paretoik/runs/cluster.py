"""Workers of a Dask cluster: tasks are sent to its scheduler, and whoever dies or falls silent on the way is noticed.

The client decides everything: which items make a task, what is tried again, and when it is given up.
"""

from __future__ import annotations

import asyncio
import hashlib
import time
import uuid
from collections import deque
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from concurrent.futures import wait
from contextlib import suppress
from functools import partial
from importlib.util import find_spec
from queue import Empty, SimpleQueue
from typing import Any

from paretoik.errors import InvalidInput, warn_user
from paretoik.inputs import cause_of
from paretoik.runs.cluster_scheduler import OPTIONS, ClusterOptions, ClusterWatch, connect
from paretoik.runs.cluster_task import Computed, Origin, Refused, Task, itself, run_task
from paretoik.runs.distribution import Function, Lost, Reply, pickled
from paretoik.runs.machine import processor, software
from paretoik.stop_flag import STOP, Interrupted

CANCELLED = ("cancelled", "lost")  # Dask's words for a future that its scheduler knows no more


class Cluster:
    """The workers of a Dask scheduler at an ``address``.

    Raises InvalidInput where Dask is not installed or no scheduler answers, Interrupted soon after a signal.
    """

    def __init__(self, address: str, options: ClusterOptions = OPTIONS) -> None:
        if find_spec("distributed") is None:
            raise InvalidInput('cluster: Dask wanted (pip install "paretoik[cluster]"), got none')
        self.address, self.options = address, options
        self._warnings: set[str] = set()
        self.client = connect(address, options, self.tell)
        self.run, self.tasks, self.threads = uuid.uuid4().hex, 0, 0
        ClusterWatch(self, options).count_threads()
        # As it is, as bytes, and where it is with the scheduler.
        self._shared: tuple[Any, bytes, Any] = None, b"", None
        self.origins: set[Origin] = set()  # of what has come

    @property
    def workers(self) -> int:
        """Number of items that are computed at a time: at least two, as workers may come yet."""
        return max(self.threads, 2)

    def description(self) -> dict[str, Any]:
        """Return who has computed, as an entry of `run.json`: machines and workers by make of processor."""
        makes = sorted({origin.processor for origin in self.origins})
        groups = [[origin for origin in self.origins if origin.processor == make] for make in makes]
        machines = [
            {
                "processor": " ".join(group[0].processor),
                "machines": len({origin.machine for origin in group}),
                "workers": len(group),
            }
            for group in groups
        ]
        return {"by": "Dask cluster", "machines": machines}

    def close(self) -> None:
        """Leave the scheduler."""
        self._shared = None, b"", None
        with suppress(Exception):  # it may be gone
            self.client.close(timeout=1.0)

    def replies(
        self, function: Function, shared: Any, items: Sequence[Any], *, seconds: float | None = None
    ) -> Iterator[tuple[int, Reply]]:
        """Yield the place of every item with its reply, as they come; one that takes more ``seconds`` is lost.

        Raises Interrupted soon after a signal; InvalidInput where workers have other versions; SolverFailed where no
        scheduler or no worker is left.
        """
        if not items:
            return
        if self._shared[0] is not shared or not self._shared[1]:
            self._shared = shared, pickled("a problem", shared), None
        yield from _Round(self, pickled("a function", function), items, seconds).replies()

    def shared(self) -> Any:
        """Return the shared object as the scheduler has it; one that came back has it anew."""
        shared, content, future = self._shared
        if future is None or future.status in CANCELLED:
            key = f"paretoik-shared-{hashlib.sha256(content).hexdigest()}"
            future = self.client.submit(itself, content, key=key)
            self._shared = shared, content, future
        return future

    def spread(self) -> bool:
        """Let every worker have the shared object; say whether tasks can be sent.

        Dask gives a task to those who have what it needs, and moves it to others by how long such tasks took before:
        with one owner the workers may begin one by one, each a task later than the one before.
        """
        future = self.shared()
        if future.status == "pending":
            with suppress(Exception):  # it is looked at again
                future.result(timeout=self.options.interval)
        if future.status == "finished":
            with suppress(Exception):  # where a worker goes meanwhile; those that have it do what there is
                self.wait_for(partial(self.client.replicate, [future], asynchronous=True), self.options.connection)
        return future.status != "pending"  # what failed fails with the tasks that need it

    def wait_for(self, function: Callable[[], Awaitable[Any]], seconds: float) -> Any:
        """Return what comes of a function that Dask runs in its own thread.

        Raises TimeoutError after so many seconds, Interrupted soon after a signal, and what the function raises.
        """

        async def run() -> Any:
            return await function()

        future = asyncio.run_coroutine_threadsafe(run(), self.client.loop.asyncio_loop)
        deadline = time.monotonic() + seconds
        while not wait([future], timeout=min(self.options.interval, seconds)).done:
            if STOP[0] or time.monotonic() > deadline:
                future.cancel()
                raise Interrupted if STOP[0] else TimeoutError
        return future.result()

    def tell(self, text: str) -> None:
        """Warn of something, once."""
        if text not in self._warnings:
            self._warnings.add(text)
            warn_user(f"cluster: {text}")


class _Round:
    """The items of one call, on their way through the cluster."""

    def __init__(self, cluster: Cluster, function: bytes, items: Sequence[Any], seconds: float | None) -> None:
        self.cluster, self.options, self.watch = cluster, cluster.options, ClusterWatch(cluster, cluster.options)
        self.function, self.items, self.seconds = function, items, seconds
        self.pending = deque(range(len(items)))
        self.suspects = deque[int]()  # with whom workers ended: each is tried again with nobody else about
        self.running = dict[Any, list[int]]()
        self.ended: SimpleQueue[Any] = SimpleQueue()
        self.answered, self.computed = 0, 0.0
        self.owners = 0  # threads that there were when the shared object was last spread
        self.patience = 5 * self.options.interval  # with a result that is on its way; it grows while none comes
        self.late: Any = None  # the task whose result did not come in time

    def replies(self) -> Iterator[tuple[int, Reply]]:
        self.watch.count_threads()
        while self.answered < len(self.items):
            if STOP[0]:
                raise Interrupted  # futures that nobody holds are given up by the scheduler
            self._submit()
            ended = self._wait()
            results = self._gather(ended)
            for future in ended:
                if self.late is None:
                    yield from self._received(future, results)
                else:
                    self.ended.put(future)
            if self.late is not None:  # the others come first the next time
                self.ended.put(self.late)
                self.late = None
            self.watch.look()

    def _submit(self) -> None:
        """Send tasks as far ahead as they go; those with whom workers ended one by one, when all others are done."""
        if self.cluster.client.status != "running":  # the scheduler is waited for
            return
        if self.owners != self.cluster.threads:
            if not self.cluster.spread():
                return
            self.owners = self.cluster.threads
        while self.pending and len(self.running) < self.options.ahead * self.cluster.workers:
            seconds = self.options.portion + self.options.overhead * self.cluster.workers
            portion = int(seconds * self.answered / self.computed) if self.computed else 1
            share = len(self.pending) // (self.options.shares * self.cluster.workers)
            self._send([self.pending.popleft() for _ in range(max(1, min(portion, share)))])
        if self.suspects and not self.running:
            self._send([self.suspects.popleft()])

    def _send(self, places: list[int]) -> None:
        items = pickled("an item", [(place, self.items[place]) for place in places])
        shared = self.cluster.shared()
        task = Task(self.function, items, shared.key, self.seconds, software())
        self.cluster.tasks += 1
        key = f"paretoik-{self.cluster.run}-{self.cluster.tasks}"
        future = self.cluster.client.submit(run_task, shared, task, key=key)
        self.running[future] = places
        future.add_done_callback(self.ended.put)

    def _wait(self) -> list[Any]:
        """Return the tasks that have ended, none where none does for a while."""
        ended = list[Any]()
        with suppress(Empty):
            ended.append(self.ended.get(timeout=self.options.interval))
            while True:
                ended.append(self.ended.get_nowait())
        return ended

    def _gather(self, futures: Sequence[Any]) -> dict[Any, Any]:
        """Return the results of tasks, fetched together: one by one each takes a round trip. None where one fails."""
        finished = [future for future in futures if future.status == "finished"]
        fetch = partial(self.cluster.client.gather, finished, asynchronous=True)
        with suppress(Exception):  # each is looked at by itself then
            results = self.cluster.wait_for(fetch, self.patience) if len(finished) > 1 else ()
            return dict(zip(finished, results, strict=False))
        return {}

    def _received(self, future: Any, results: Mapping[Any, Any]) -> Iterator[tuple[int, Reply]]:
        """Yield what a task that ended has brought; let others do what it had where it brought nothing."""
        try:
            result = results[future] if future in results else self.cluster.wait_for(future._result, self.patience)
        except Exception as error:
            yield from self._failed(future, error)
            return
        self.patience = 5 * self.options.interval
        del self.running[future]
        if isinstance(result, Refused):
            raise InvalidInput(f"cluster: workers with what this process has, {result.reason}")
        self._check(result)
        for place, reply in result.replies:
            self.answered += 1
            self.computed += getattr(reply, "seconds", 0.0)
            yield place, reply

    def _failed(self, future: Any, error: Exception) -> Iterator[tuple[int, Reply]]:
        from distributed import KilledWorker

        if isinstance(error, TimeoutError):  # whoever had the result is gone and it is computed again, or is busy
            self.patience, self.late = min(2 * self.patience, self.options.frozen), future
            return
        alone, places = len(self.running) == 1, self.running.pop(future)
        if future.status in CANCELLED:  # with its scheduler
            self.pending.extendleft(reversed(places))
        elif not isinstance(error, KilledWorker):
            raise InvalidInput(f"cluster: workers that can read what they are sent wanted, got {cause_of(error)}")
        elif alone and len(places) == 1:
            self.answered += 1
            yield places[0], Lost(cause=f"{error.allowed_failures + 1} workers ended on it")
        else:
            self.suspects.extend(places)

    def _check(self, result: Computed) -> None:
        self.cluster.origins.add(result.origin)
        if result.origin.processor != processor():
            self.cluster.tell("workers have another make of processor: the run is reproducible to tolerance alone")
