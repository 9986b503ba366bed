"""Workers of a Dask cluster: tasks go to its scheduler, and what a lost worker had is computed by others.

The client decides everything: which items make a task, what is tried again, and when it is given up.
"""

from __future__ import annotations

import asyncio
import hashlib
import socket
import time
import uuid
from collections import deque
from collections.abc import Awaitable, Callable, Iterator, Sequence
from concurrent.futures import Future, wait
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from math import inf
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

from paretoik.errors import InvalidInput, SolverFailed, warn_user
from paretoik.inputs import cause_of
from paretoik.runs.cluster_task import Computed, Origin, Task, run_task
from paretoik.runs.distribution import Function, Lost, Reply, pickled
from paretoik.runs.machine import processor, software
from paretoik.stop_flag import STOP, Interrupted

CANCELLED = ("cancelled", "lost")  # Dask's words for a future that its scheduler no longer knows


@dataclass(frozen=True, kw_only=True)
class ClusterOptions:
    """How tasks are made, and how long a silence is tolerated [s].

    portion, overhead: seconds of work in a task, and more seconds per thread, as every task passes through one
        scheduler and one client; a task is never larger than an even share of the items left
    shares: shares per thread that the items left are divided into
    ahead: tasks per thread at the scheduler
    interval, watch: time between two looks for a signal, and at the workers
    connection: time for somebody to listen at the address; a longer silence of scheduler and workers is reported
    patience: time for the scheduler to answer, to come back, and to have a worker
    """

    portion: float = 0.5
    overhead: float = 0.002
    shares: int = 2
    ahead: int = 2
    interval: float = 0.1
    watch: float = 2.0
    connection: float = 5.0
    patience: float = 60.0


OPTIONS = ClusterOptions()


class Cluster:
    """The workers of a Dask scheduler at an ``address``.

    Raises InvalidInput if Dask is not installed or no scheduler answers, Interrupted soon after a signal.
    """

    def __init__(self, address: str, options: ClusterOptions = OPTIONS) -> None:
        if find_spec("distributed") is None:
            raise InvalidInput('cluster: Dask must be installed (pip install "paretoik[cluster]"), got none')
        self.address, self.options = address, options
        self._warnings: set[str] = set()
        self.client = _connect(address, options)
        self.run, self.tasks, self.threads = uuid.uuid4().hex, 0, 0
        self._looked = -inf  # when workers were looked for
        self._missing: float | None = None  # since when there are none
        self.look()
        # The shared object itself, as bytes, and its future at the scheduler.
        self._shared: tuple[Any, bytes, Any] = None, b"", None
        self.origins: set[Origin] = set()  # of the results that have come

    @property
    def workers(self) -> int:
        """Number of items that are computed at a time: at least two, as workers may still come."""
        return max(self.threads, 2)

    def description(self) -> dict[str, Any]:
        """Return who has computed, as an entry of `run.json`: machines and workers by make of processor."""
        machines = []
        for make in sorted({origin.processor for origin in self.origins}):
            places = [origin.machine for origin in self.origins if origin.processor == make]
            machines.append({"processor": " ".join(make), "machines": len(set(places)), "workers": len(places)})
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
            future = self.client.submit(bytes, content, key=key)  # a task, so that workers that replace others get it
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

    def look(self) -> None:
        """Count the threads of all workers if that was some time ago.

        Tells when there are none for a while; raises SolverFailed if none come back, or nobody answers.
        """
        now, missing = time.monotonic(), "scheduler"
        if now - self._looked < self.options.watch:
            return
        if self.client.status == "running":
            missing = "answer from the scheduler"
            with suppress(Exception):  # a broken connection can raise anything
                self.threads = sum(self.wait_for(self.client.scheduler.ncores, 5 * self.options.interval).values())
                missing = "" if self.threads else "worker"
        self._looked = time.monotonic()
        self._missing = (self._missing or now) if missing else None
        gone = 0.0 if self._missing is None else now - self._missing
        if gone > self.options.patience:
            text = f"cluster: no {missing} at {self.address} for {self.options.patience:g} s"
            raise SolverFailed(f"{text}; resume continues the run")
        if gone > self.options.connection:
            self.tell(f"no {missing} at {self.address}; one is waited for, {self.options.patience:g} s at most")

    def tell(self, text: str) -> None:
        """Warn once per text."""
        if text not in self._warnings:
            self._warnings.add(text)
            warn_user(f"cluster: {text}")


def _connect(address: str, options: ClusterOptions) -> Any:
    """Return Dask's client of the scheduler at an address.

    Raises InvalidInput if nobody listens there or no scheduler answers, Interrupted soon after a signal.
    """
    from distributed import Client
    from distributed.comm import get_address_host_port

    connected: Future[Any] = Future()

    def connect() -> None:
        deadline = time.monotonic() + options.connection
        try:
            while True:  # the scheduler may be starting
                try:
                    socket.create_connection(get_address_host_port(address), timeout=options.connection).close()
                    break
                except OSError:
                    if time.monotonic() > deadline:
                        raise
                time.sleep(options.interval)
            # The timeout is also the one for reconnecting: a client that gave up never comes back.
            connected.set_result(Client(address, timeout=options.patience, set_as_default=False, name="paretoik"))
        except Exception as error:  # an address, or the server there, can make Dask raise anything
            connected.set_exception(error)

    Thread(target=connect, daemon=True).start()  # because Dask waits without looking for signals
    while not wait([connected], timeout=options.interval).done:
        if STOP[0]:
            raise Interrupted
    error = connected.exception()
    if error is not None:
        reason = getattr(error, "strerror", None)
        fact = f"nobody listens there ({reason})" if reason else cause_of(error)
        raise InvalidInput(f"cluster must be the address of a Dask scheduler, got {address}: {fact}") from error
    return connected.result()


class _Round:
    """The items of one call, on their way through the cluster."""

    def __init__(self, cluster: Cluster, function: bytes, items: Sequence[Any], seconds: float | None) -> None:
        self.cluster, self.options = cluster, cluster.options
        self.function, self.items, self.seconds = function, items, seconds
        self.pending = deque(range(len(items)))
        self.suspects = deque[int]()  # items on which workers ended: each is tried again with no other running
        self.running = dict[Any, list[int]]()
        self.ended: SimpleQueue[Any] = SimpleQueue()
        self.answered, self.computed = 0, 0.0
        self.owners = 0  # number of threads when the shared object was last spread

    def replies(self) -> Iterator[tuple[int, Reply]]:
        while self.answered < len(self.items):
            if STOP[0]:
                raise Interrupted  # the scheduler drops futures that no client holds
            self.cluster.look()
            self._submit()
            with suppress(Empty):
                yield from self._received(self.ended.get(timeout=self.options.interval))

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

    def _received(self, future: Any) -> Iterator[tuple[int, Reply]]:
        """Yield the replies of a task that ended; if it has none, let others compute its items."""
        try:
            result = self.cluster.wait_for(future._result, self.options.patience)
        except TimeoutError:  # the worker with the result is busy, or gone and it is computed again
            self.ended.put(future)
            return
        except Exception as error:
            yield from self._failed(future, error)
            return
        del self.running[future]
        if not isinstance(result, Computed):
            raise InvalidInput(f"cluster: on every worker {result}")
        self.cluster.origins.add(result.origin)
        if result.origin.processor != processor():
            self.cluster.tell("workers have another make of processor: the run is reproducible to tolerance alone")
        for place, reply in result.replies:
            self.answered += 1
            self.computed += getattr(reply, "seconds", 0.0)
            yield place, reply

    def _failed(self, future: Any, error: Exception) -> Iterator[tuple[int, Reply]]:
        from distributed import KilledWorker

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
