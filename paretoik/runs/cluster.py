"""Workers of a Dask cluster, which get tasks from its scheduler.

The client decides which items form a task, which are tried again, and when an item is given up. Workers that end are
replaced; the scheduler leaves out workers that are silent for its ``worker-ttl`` (five minutes).
"""

from __future__ import annotations

import asyncio
import ctypes
import hashlib
import os
import platform
import socket
import threading
import time
import uuid
from collections import deque
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, wait
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from importlib.util import find_spec
from math import inf
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple, NoReturn

import cloudpickle

from paretoik.errors import InvalidInput, SolverFailed, warn_user
from paretoik.inputs import cause_of
from paretoik.runs.distribution import Function, Lost, Reply, become_worker, pickled
from paretoik.runs.machine import processor, software
from paretoik.runs.processes import WorkerProcesses, compute
from paretoik.stop_flag import STOP, Interrupted

# How work is divided over a cluster, and how long scheduler and workers may be silent.


@dataclass(frozen=True, kw_only=True)
class ClusterOptions:
    """Sizes of tasks, and timeouts [s].

    portion: seconds of work in a task; a task is never larger than an even share of the remaining items
    overhead: further seconds of work per thread, since every task passes through one scheduler and one client
    shares: number of shares per thread into which the remaining items are divided
    ahead: number of tasks per thread that the scheduler has
    interval: time between two checks for a signal
    watch: time between two checks of the workers
    connection: time until a process must listen at the address; a scheduler that is silent for longer is reported
    patience: time until the scheduler must answer, reconnect, or have a worker
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


# The work of a Dask worker on a task: it computes a function of some items.


class Task(NamedTuple):
    """The work of one message to the scheduler.

    function: pickled function
    items: pickled pairs (place, item)
    key: key of the shared object
    seconds: longest time for an item, None for no limit
    software: versions that the worker must have
    """

    function: bytes
    items: bytes
    key: str
    seconds: float | None
    software: Mapping[str, str]


class Origin(NamedTuple):
    """A machine's name, a process on it, and the processor's make."""

    machine: str
    process: int
    processor: tuple[str, ...]


class Computed(NamedTuple):
    """The replies to items by place, and their origin."""

    replies: Sequence[tuple[int, Reply]]
    origin: Origin


class _Local(threading.local):
    """The objects that the tasks of a thread share.

    key: key of the shared object
    shared: the shared object
    process: process for items with a time limit, which may be killed; None if not needed
    """

    key: str | None = None
    shared: Any = None
    process: WorkerProcesses | None = None


_LOCAL = _Local()


def itself(shared: bytes) -> bytes:
    """Return the shared object: Dask sends a task's result also to workers that join later."""
    return shared


def run_task(shared: bytes, task: Task) -> Computed | str:
    """Return the replies to a task's items, or text on a version of this worker that differs."""
    for name, number in task.software.items():
        if (here := software().get(name, "none")) != number:
            return f"{name} must be {number}, got {here}"
    become_worker()
    _keep_memory()
    if _LOCAL.key != task.key:
        _LOCAL.shared, _LOCAL.key = cloudpickle.loads(shared), task.key
    function, items = cloudpickle.loads(task.function), cloudpickle.loads(task.items)
    origin = Origin(platform.node(), os.getpid(), processor())
    if task.seconds is None:
        return Computed([(place, compute(function, _LOCAL.shared, item)) for place, item in items], origin)
    if _LOCAL.process is None:
        _LOCAL.process = WorkerProcesses(1)
    places, values = zip(*items, strict=True)
    answers = _LOCAL.process.replies(function, _LOCAL.shared, values, seconds=task.seconds)
    return Computed([(places[i], reply) for i, reply in answers], origin)


@cache
def _keep_memory() -> None:
    """Keep freed memory in this process, if the system's library allows it.

    Dask's workers return freed memory above 64 kB to the system. With short-lived arrays this took a third of a
    search's time.
    """
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).mallopt(-1, 64 * 2**20)  # M_TRIM_THRESHOLD [bytes]; glibc itself grows to this value


# Connection to a Dask scheduler: if no process listens, the error comes soon; a slow scheduler gets more time.


def connect(address: str, options: ClusterOptions, tell: Callable[[str], None]) -> Any:
    """Return Dask's client of the scheduler at an address.

    A process must listen there within ``connection`` seconds, and answer within ``patience`` seconds, as its machine
    may be busy. Raises InvalidInput if not; Interrupted soon after a signal.
    """
    from distributed import Client
    from distributed.comm import get_address_host_port

    client = Future[Any]()

    def attempt() -> None:  # in its own thread, because Dask waits without looking for signals
        try:
            socket.create_connection(get_address_host_port(address), timeout=options.connection).close()
            # The timeout also limits reconnection: a client that gave up never reconnects.
            client.set_result(Client(address, timeout=options.patience, set_as_default=False, name="paretoik"))
        except Exception as error:  # a wrong address or another server can make Dask raise any error
            client.set_exception(error)

    threading.Thread(target=attempt, daemon=True).start()
    waited = 0.0
    while not wait([client], timeout=options.interval).done and waited < options.connection + options.patience:
        if STOP[0]:
            client.add_done_callback(lambda done: None if done.exception() else done.result().close(timeout=1.0))
            raise Interrupted
        waited += options.interval
        if waited > 2 * options.connection:
            tell(_slow(address, options))
    error = client.exception() if client.done() else TimeoutError(f"no answer within {options.patience:g} s")
    if error is not None:
        fact = getattr(error, "strerror", None) or " ".join(str(error).split()) or type(error).__name__
        raise InvalidInput(f"cluster must be the address of a Dask scheduler, got {address}: {fact}") from error
    return client.result()


def _slow(address: str, options: ClusterOptions) -> str:
    """Return the warning that a scheduler is slow to answer."""
    silent = f"the scheduler at {address} has not answered for {options.connection:g} s, perhaps its machine is busy"
    return f"{silent}; waiting for it, {options.patience:g} s at most"


# The cluster, and the items of one call on their way through it.


CANCELLED = ("cancelled", "lost")  # Dask's statuses of a future that its scheduler has lost


class Cluster:
    """The workers of a Dask scheduler at an ``address``.

    Raises InvalidInput if Dask is not installed or no scheduler answers; Interrupted soon after a signal.
    """

    def __init__(self, address: str, options: ClusterOptions = OPTIONS) -> None:
        if find_spec("distributed") is None:
            raise InvalidInput('cluster: Dask must be installed (pip install "paretoik[cluster]"), got none')
        self.address, self.options = address, options
        self._warnings: set[str] = set()
        self.client = connect(address, options, self.tell)
        self.run, self.tasks, self.threads = uuid.uuid4().hex, 0, 0
        # The shared object, its bytes, and its future at the scheduler.
        self._shared: tuple[Any, bytes, Any] = None, b"", None
        self.origins: set[Origin] = set()  # origins of the results so far
        ClusterWatch(self).look()

    @property
    def workers(self) -> int:
        """Number of items computed at a time: at least two, as more workers may join later."""
        return max(self.threads, 2)

    def description(self) -> dict[str, Any]:
        """Return machines and workers, grouped by make of processor, as an entry of `run.json`."""
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
        with suppress(Exception):  # the scheduler may be gone
            self.client.close(timeout=1.0)

    def replies(
        self, function: Function, shared: Any, items: Sequence[Any], *, seconds: float | None = None
    ) -> Iterator[tuple[int, Reply]]:
        """Yield the place and reply of each item, in order of arrival.

        An item that takes longer than ``seconds`` is lost.

        Raises Interrupted soon after a signal; InvalidInput if workers have other versions; SolverFailed if no
        scheduler or no worker is left.
        """
        if not items:
            return
        if self._shared[0] is not shared or not self._shared[1]:
            self._shared = shared, pickled("a problem", shared), None
        yield from _Round(self, pickled("a function", function), items, seconds).replies()

    def shared(self) -> Any:
        """Return the future of the shared object at the scheduler; if the scheduler lost it, it is sent again."""
        shared, content, future = self._shared
        if future is None or future.status in CANCELLED:
            key = f"paretoik-shared-{hashlib.sha256(content).hexdigest()}"
            future = self.client.submit(itself, content, key=key)
            self._shared = shared, content, future
        return future

    def spread(self) -> bool:
        """Send every worker the shared object; return whether tasks may follow.

        Dask prefers workers that have a task's inputs, and moves tasks to other workers by the times of earlier tasks.
        If only one worker had the object, the others could start one after the other, each a task later than the last.
        """
        future = self.shared()
        if future.status == "pending":
            with suppress(Exception):  # the status is checked below
                future.result(timeout=self.options.interval)
        if future.status == "finished":
            with suppress(Exception):  # a worker may leave meanwhile; workers with the object do the work
                self.wait_for(partial(self.client.replicate, [future], asynchronous=True), self.options.connection)
        return future.status != "pending"  # a failure reappears in the tasks that need the object

    def wait_for(self, function: Callable[[], Awaitable[Any]], seconds: float, *, slow: str = "") -> Any:
        """Return the result of a function run in Dask's thread; warn by ``slow``, if given, when it takes long.

        Raises TimeoutError after ``seconds``, Interrupted soon after a signal, and what the function raises.
        """

        async def run() -> Any:
            return await function()

        future = asyncio.run_coroutine_threadsafe(run(), self.client.loop.asyncio_loop)
        begin = time.monotonic()
        while not wait([future], timeout=min(self.options.interval, seconds)).done:
            waited = time.monotonic() - begin
            if STOP[0] or waited > seconds:
                future.cancel()
                raise Interrupted if STOP[0] else TimeoutError
            if slow and waited > self.options.connection:
                self.tell(slow)
        return future.result()

    def tell(self, text: str) -> None:
        """Warn once for each text."""
        if text not in self._warnings:
            self._warnings.add(text)
            warn_user(f"cluster: {text}")


class ClusterWatch:
    """Watches scheduler and workers; waits for missing ones, then gives up."""

    def __init__(self, cluster: Cluster) -> None:
        self.cluster, self.options = cluster, cluster.options
        self.looked = -inf
        self.missing: float | None = None  # time since which something is missing

    def look(self) -> None:
        """Count the worker threads, unless that was done recently.

        Raises SolverFailed if no worker returns or no scheduler answers; Interrupted soon after a signal.
        """
        now, client, threads = time.monotonic(), self.cluster.client, None
        if now - self.looked < self.options.watch:
            return
        if client.status == "running":
            count, slow = partial(client.nthreads, asynchronous=True), _slow(self.cluster.address, self.options)
            try:
                threads = self.cluster.wait_for(count, self.options.patience, slow=slow)
            except TimeoutError:
                self._give_up("answer from the scheduler")
            except Exception:  # a broken connection can raise anything
                threads = None
        self.looked = time.monotonic()
        if threads:
            self.cluster.threads, self.missing = sum(threads.values()), None
            return
        what = "scheduler" if threads is None else "worker"
        self.missing = now if self.missing is None else self.missing
        if now - self.missing > self.options.patience:
            self._give_up(what)
        told = f"no {what} at {self.cluster.address}; waiting for one, {self.options.patience:g} s at most"
        self.cluster.tell(told)

    def _give_up(self, what: str) -> NoReturn:
        place, seconds = self.cluster.address, f"{self.options.patience:g} s"
        raise SolverFailed(f"cluster: no {what} at {place} for {seconds}; resume continues the run")


class _Round:
    """The items of one call, while the cluster computes them."""

    def __init__(self, cluster: Cluster, function: bytes, items: Sequence[Any], seconds: float | None) -> None:
        self.cluster, self.options, self.watch = cluster, cluster.options, ClusterWatch(cluster)
        self.function, self.items, self.seconds = function, items, seconds
        self.pending = deque(range(len(items)))
        self.suspects = deque[int]()  # items whose worker ended: each is tried again while nothing else runs
        self.running = dict[Any, list[int]]()
        self.ended: SimpleQueue[Any] = SimpleQueue()
        self.answered, self.computed = 0, 0.0
        self.owners = 0  # number of threads when the shared object was last spread
        self.patience = 5 * self.options.interval  # time to wait for a result; doubled after each timeout
        self.late: Any = None  # the task whose result did not come in time

    def replies(self) -> Iterator[tuple[int, Reply]]:
        while self.answered < len(self.items):
            if STOP[0]:
                raise Interrupted  # the scheduler drops futures that no client holds
            self.watch.look()
            # Send tasks up to the limit, unless the scheduler is away; send suspects last, one by one.
            ready, workers = self.cluster.client.status == "running", self.cluster.workers
            if ready and self.owners != self.cluster.threads and (ready := self.cluster.spread()):
                self.owners = self.cluster.threads
            while ready and self.pending and len(self.running) < self.options.ahead * workers:
                seconds = self.options.portion + self.options.overhead * workers
                portion = int(seconds * self.answered / self.computed) if self.computed else 1
                share = len(self.pending) // (self.options.shares * workers)
                self._send([self.pending.popleft() for _ in range(max(1, min(portion, share)))])
            if ready and self.suspects and not self.running:
                self._send([self.suspects.popleft()])
            ended = list[Any]()  # stays empty if no task ends for a while
            with suppress(Empty):
                ended.append(self.ended.get(timeout=self.options.interval))
                while True:
                    ended.append(self.ended.get_nowait())
            # Results of finished tasks are fetched together to save round trips; if that fails, one by one.
            finished, results = [future for future in ended if future.status == "finished"], dict[Any, Any]()
            with suppress(Exception):
                fetch = partial(self.cluster.client.gather, finished, asynchronous=True)
                if len(finished) > 1:
                    results = dict(zip(finished, self.cluster.wait_for(fetch, self.patience), strict=False))
            for future in ended:
                if self.late is None:
                    yield from self._received(future, results)
                else:
                    self.ended.put(future)
            if self.late is not None:  # next time the other tasks come first
                self.ended.put(self.late)
                self.late = None

    def _send(self, places: list[int]) -> None:
        items = pickled("an item", [(place, self.items[place]) for place in places])
        shared = self.cluster.shared()
        task = Task(self.function, items, shared.key, self.seconds, software())
        self.cluster.tasks += 1
        key = f"paretoik-{self.cluster.run}-{self.cluster.tasks}"
        future = self.cluster.client.submit(run_task, shared, task, key=key)
        self.running[future] = places
        future.add_done_callback(self.ended.put)

    def _received(self, future: Any, results: Mapping[Any, Any]) -> Iterator[tuple[int, Reply]]:
        """Yield the replies of an ended task; without any, requeue its items."""
        try:
            result = results[future] if future in results else self.cluster.wait_for(future._result, self.patience)
        except TimeoutError:  # the worker is busy, or it is gone and the item is computed again
            self.patience, self.late = min(2 * self.patience, self.options.patience), future
            return
        except Exception as error:
            from distributed import KilledWorker

            alone, places = len(self.running) == 1, self.running.pop(future)
            if future.status in CANCELLED:  # the scheduler has lost the task
                self.pending.extendleft(reversed(places))
            elif not isinstance(error, KilledWorker):
                raise InvalidInput(f"cluster: workers cannot unpickle the task: {cause_of(error)}") from error
            elif alone and len(places) == 1:
                self.answered += 1
                yield places[0], Lost(cause=f"{error.allowed_failures + 1} workers ended on it")
            else:
                self.suspects.extend(places)
            return
        self.patience = 5 * self.options.interval
        del self.running[future]
        if isinstance(result, str):
            raise InvalidInput(f"cluster: on every worker {result}")
        self.cluster.origins.add(result.origin)
        if result.origin.processor != processor():
            self.cluster.tell("workers have another make of processor: the run is reproducible only within a tolerance")
        for place, reply in result.replies:
            self.answered += 1
            self.computed += getattr(reply, "seconds", 0.0)
            yield place, reply
