"""Workers of a Dask cluster: tasks go to its scheduler, and workers that die or fall silent are noticed.

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

CANCELLED = ("cancelled", "lost")  # Dask's words for a future that its scheduler no longer knows


class Cluster:
    """The workers of a Dask scheduler at an ``address``.

    Raises InvalidInput if Dask is not installed or no scheduler answers, Interrupted soon after a signal.
    """

    def __init__(self, address: str, options: ClusterOptions = OPTIONS) -> None:
        if find_spec("distributed") is None:
            raise InvalidInput('cluster: Dask must be installed (pip install "paretoik[cluster]"), got none')
        self.address, self.options = address, options
        self._warnings: set[str] = set()
        self.client = connect(address, options, self.tell)
        self.run, self.tasks, self.threads = uuid.uuid4().hex, 0, 0
        ClusterWatch(self, options).count_threads()
        # The shared object itself, as bytes, and its future at the scheduler.
        self._shared: tuple[Any, bytes, Any] = None, b"", None
        self.origins: set[Origin] = set()  # of the results that have come

    @property
    def workers(self) -> int:
        """Number of items that are computed at a time: at least two, as workers may still come."""
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
        """Yield every item's place and reply, as they come; an item that takes longer than ``seconds`` is lost.

        Raises Interrupted soon after a signal; InvalidInput if workers have other versions; SolverFailed if no
        scheduler or no worker is left.
        """
        if not items:
            return
        if self._shared[0] is not shared or not self._shared[1]:
            self._shared = shared, pickled("a problem", shared), None
        yield from _Round(self, pickled("a function", function), items, seconds).replies()

    def shared(self) -> Any:
        """Return the shared object as the scheduler has it; send it again if the scheduler lost it."""
        shared, content, future = self._shared
        if future is None or future.status in CANCELLED:
            key = f"paretoik-shared-{hashlib.sha256(content).hexdigest()}"
            future = self.client.submit(itself, content, key=key)
            self._shared = shared, content, future
        return future

    def spread(self) -> bool:
        """Send the shared object to every worker; return whether tasks can be sent.

        Dask gives a task to workers that have its inputs, and moves it to others by how long such tasks took before. If
        only one worker had the object, the workers might begin one by one, each a task later than the one before.
        """
        future = self.shared()
        if future.status == "pending":
            with suppress(Exception):  # it is checked again
                future.result(timeout=self.options.interval)
        if future.status == "finished":
            with suppress(Exception):  # a worker may leave meanwhile; those that have the object do the work
                self.wait_for(partial(self.client.replicate, [future], asynchronous=True), self.options.connection)
        return future.status != "pending"  # a failure reappears in the tasks that need the object

    def wait_for(self, function: Callable[[], Awaitable[Any]], seconds: float) -> Any:
        """Return the result of a function that Dask runs in its own thread.

        Raises TimeoutError after ``seconds``, Interrupted soon after a signal, and what the function raises.
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
        """Warn once per text."""
        if text not in self._warnings:
            self._warnings.add(text)
            warn_user(f"cluster: {text}")


class _Round:
    """The items of one call, on their way through the cluster."""

    def __init__(self, cluster: Cluster, function: bytes, items: Sequence[Any], seconds: float | None) -> None:
        self.cluster, self.options, self.watch = cluster, cluster.options, ClusterWatch(cluster, cluster.options)
        self.function, self.items, self.seconds = function, items, seconds
        self.pending = deque(range(len(items)))
        self.suspects = deque[int]()  # items on which workers ended: each is tried again with no other running
        self.running = dict[Any, list[int]]()
        self.ended: SimpleQueue[Any] = SimpleQueue()
        self.answered, self.computed = 0, 0.0
        self.owners = 0  # number of threads when the shared object was last spread
        self.patience = 5 * self.options.interval  # for a result that is on its way; it grows while none comes
        self.late: Any = None  # the task whose result did not come in time

    def replies(self) -> Iterator[tuple[int, Reply]]:
        self.watch.count_threads()
        while self.answered < len(self.items):
            if STOP[0]:
                raise Interrupted  # the scheduler drops futures that no client holds
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
        """Send tasks as far ahead as allowed; send suspects one by one when all others are done."""
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
        """Return the tasks that have ended; none if none ends for a while."""
        ended = list[Any]()
        with suppress(Empty):
            ended.append(self.ended.get(timeout=self.options.interval))
            while True:
                ended.append(self.ended.get_nowait())
        return ended

    def _gather(self, futures: Sequence[Any]) -> dict[Any, Any]:
        """Return the results of tasks, fetched together to save round trips; None if one fails."""
        finished = [future for future in futures if future.status == "finished"]
        fetch = partial(self.cluster.client.gather, finished, asynchronous=True)
        with suppress(Exception):  # each one is then fetched by itself
            results = self.cluster.wait_for(fetch, self.patience) if len(finished) > 1 else ()
            return dict(zip(finished, results, strict=False))
        return {}

    def _received(self, future: Any, results: Mapping[Any, Any]) -> Iterator[tuple[int, Reply]]:
        """Yield the replies of a task that ended; if it has none, let others compute its items."""
        try:
            result = results[future] if future in results else self.cluster.wait_for(future._result, self.patience)
        except Exception as error:
            yield from self._failed(future, error)
            return
        self.patience = 5 * self.options.interval
        del self.running[future]
        if isinstance(result, Refused):
            raise InvalidInput(f"cluster: on every worker {result.reason}")
        self._check(result)
        for place, reply in result.replies:
            self.answered += 1
            self.computed += getattr(reply, "seconds", 0.0)
            yield place, reply

    def _failed(self, future: Any, error: Exception) -> Iterator[tuple[int, Reply]]:
        from distributed import KilledWorker

        if isinstance(error, TimeoutError):  # the worker with the result is busy, or gone and it is computed again
            self.patience, self.late = min(2 * self.patience, self.options.frozen), future
            return
        alone, places = len(self.running) == 1, self.running.pop(future)
        if future.status in CANCELLED:  # its scheduler is gone
            self.pending.extendleft(reversed(places))
        elif not isinstance(error, KilledWorker):
            raise InvalidInput(f"cluster: workers must be able to unpickle the task, got {cause_of(error)}")
        elif alone and len(places) == 1:
            self.answered += 1
            yield places[0], Lost(cause=f"{error.allowed_failures + 1} workers ended on it")
        else:
            self.suspects.extend(places)

    def _check(self, result: Computed) -> None:
        self.cluster.origins.add(result.origin)
        if result.origin.processor != processor():
            self.cluster.tell("workers have another make of processor: the run is reproducible to tolerance alone")
