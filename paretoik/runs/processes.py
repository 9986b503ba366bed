"""Workers on this machine: processes that compute items for their parent.

They are replaced when they end, and killed when they take too long. A worker ends with its parent. Its argument is the
file descriptor of a connection. Messages are sent as pickles.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from queue import SimpleQueue
from threading import Thread
from typing import Any, NamedTuple

import cloudpickle

from paretoik.errors import InvalidInput, SolverFailed
from paretoik.inputs import cause_of, check_size, end_late_verb
from paretoik.runs.distribution import Done, Function, Lost, Raised, Reply, become_worker, pickled
from paretoik.runs.machine import child_command
from paretoik.stop_flag import STOP, Interrupted

# The work of a worker process.


STARTED = -1  # sent in place of an item's place: the items of a message are started now, one after the other


class Work(NamedTuple):
    """A message to a worker: function, items with their places, and the shared object if it is new."""

    function: bytes
    shared: bytes | None
    items: list[tuple[int, Any]]


def compute(function: Function, shared: Any, item: Any) -> Done | Raised:
    """Return a function's value for an item, or its error."""
    begin = time.perf_counter()
    try:
        return Done(value=function(shared, item), seconds=time.perf_counter() - begin)
    except Exception as error:
        return Raised(error=error)


def main() -> None:
    """Compute items for the parent process until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends this process
    become_worker()
    connection, received = Connection(int(sys.argv[1])), SimpleQueue[bytes]()

    def receive() -> None:  # immediately, so that the parent never waits to send
        try:
            while True:
                received.put(connection.recv_bytes())
        except (EOFError, OSError):  # the parent has ended
            os._exit(0)

    Thread(target=receive, daemon=True).start()
    shared: Any = None
    while True:
        work: Work = Work(*cloudpickle.loads(received.get()))
        try:
            shared = shared if work.shared is None else cloudpickle.loads(work.shared)
            function = cloudpickle.loads(work.function)
        except Exception as error:
            for place, _ in work.items:
                _send(connection, place, Raised(error=error))
            continue
        _send(connection, STARTED, None)
        for place, item in work.items:
            _send(connection, place, compute(function, shared, item))


def _send(connection: Connection, place: int, reply: Done | Raised | None) -> None:
    try:
        message = cloudpickle.dumps((place, reply))
    except Exception as error:  # users' errors need not be picklable
        refusal = InvalidInput(f"workers: a result cannot be pickled: {cause_of(error)}")
        message = cloudpickle.dumps((place, Raised(error=refusal)))
    connection.send_bytes(message)


# The worker processes, and their items.


LIBRARIES = ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM", "NUMBA")  # each of them would use one thread per core
ONE_THREAD = {f"{name}_THREADS" if "_" in name else f"{name}_NUM_THREADS": "1" for name in LIBRARIES}


@dataclass(frozen=True, kw_only=True)
class WorkerOptions:
    """Sizes of messages to workers, and limits.

    portion: seconds of work in a message, which has at most one share of the remaining items
    shares: number of shares per worker into which the remaining items are divided
    allowed_failures: number of workers that may end on an item; after one more the item is lost
    loading: further seconds for the first item of a worker, which loads code from the disk
    interval: seconds between two checks for a signal
    """

    portion: float = 0.5
    shares: int = 2
    allowed_failures: int = 3
    loading: float = 5.0
    interval: float = 0.1


OPTIONS = WorkerOptions()


@dataclass(kw_only=True, eq=False)
class _Worker:
    """A worker process.

    connection: connection to the process
    has: shared object that it has
    places: places of its unanswered items; it computes the first one
    since: time at which it started the first one
    replies: number of its replies
    """

    process: subprocess.Popen[bytes]
    connection: Connection
    has: object = None  # the shared object
    places: deque[int] = field(default_factory=deque)
    since: float | None = None
    replies: int = 0

    @property
    def seconds(self) -> float:
        """Time spent on its current item [s], without loading code."""
        loading = 0.0 if self.replies else OPTIONS.loading
        return 0.0 if self.since is None or not self.places else time.monotonic() - self.since - loading

    def end(self) -> int:
        """Kill the process and return its exit status."""
        self.process.kill()
        with suppress(OSError):
            self.connection.close()
        return self.process.wait()


class WorkerProcesses:
    """A number of worker processes on this machine, which end when this object is closed, or with this process."""

    def __init__(self, workers: int) -> None:
        check_size("workers", workers, 1)
        self.workers = int(workers)
        self._processes: list[_Worker] = []
        self._shared: tuple[Any, bytes] = (None, b"")

    def close(self) -> None:
        """End all workers."""
        while self._processes:
            self._processes.pop().end()

    def description(self) -> dict[str, Any]:
        """Return the kind and number of workers, as a `run.json` entry."""
        return {"by": "worker processes", "workers": self.workers}

    def replies(
        self, function: Function, shared: Any, items: Sequence[Any], *, seconds: float | None = None
    ) -> Iterator[tuple[int, Reply]]:
        """Yield the place and reply of each item as they arrive; an item is lost if it takes longer than ``seconds``.

        Raises Interrupted soon after a signal; SolverFailed if workers end before they compute.
        """
        if not items:
            return
        if self._shared[0] is not shared or not self._shared[1]:
            self._shared = shared, pickled("a problem", shared)
        try:
            yield from _Round(self, pickled("a function", function), self._shared[1], items, seconds).replies()
        finally:
            for worker in [each for each in self._processes if each.places]:
                self._processes.remove(worker)
                worker.end()


class _Round:
    """The items of one call, while the workers compute them."""

    def __init__(
        self, pool: WorkerProcesses, function: bytes, shared: bytes, items: Sequence[Any], seconds: float | None
    ) -> None:
        self.processes, self.workers = pool._processes, min(pool.workers, len(items))
        self.function, self.shared, self.items, self.seconds = function, shared, items, seconds
        self.pending = deque(range(len(items)))
        self.failures: Counter[int] = Counter()  # number of workers that ended, by the item that they were computing
        self.answered = 0
        self.computed = 0.0

    def replies(self) -> Iterator[tuple[int, Reply]]:
        while self.answered < len(self.items):
            if STOP[0]:
                raise Interrupted
            # Start workers that are missing, and give work to idle ones.
            while len(self.processes) < self.workers:
                ours, theirs = socket.socketpair()
                with theirs:
                    process = subprocess.Popen(
                        child_command("paretoik.runs.processes", str(theirs.fileno())),
                        stdin=subprocess.DEVNULL,
                        pass_fds=(theirs.fileno(),),
                        env={**os.environ, **ONE_THREAD},
                    )
                self.processes.append(_Worker(process=process, connection=Connection(ours.detach())))
            for worker in self.processes:
                if not self.pending or worker.places:
                    continue
                portion = 1
                if self.computed and self.seconds is None:
                    portion = int(OPTIONS.portion * self.answered / self.computed)
                share = len(self.pending) // (OPTIONS.shares * self.workers)
                places = [self.pending.popleft() for _ in range(max(1, min(portion, share)))]
                shared = None if worker.has is self.shared else self.shared
                work = Work(self.function, shared, [(place, self.items[place]) for place in places])
                worker.has, worker.since = self.shared, None
                worker.places.extend(places)
                with suppress(OSError):  # the worker has ended, which is noticed when its reply is read
                    worker.connection.send_bytes(pickled("an item", tuple(work)))
            # Wait for replies, until the first item takes too long.
            busy: dict[Any, _Worker] = {worker.connection: worker for worker in self.processes if worker.places}
            lasted = max(worker.seconds for worker in busy.values())
            patience = OPTIONS.interval if self.seconds is None else min(OPTIONS.interval, self.seconds - lasted)
            for connection in wait(list(busy), timeout=max(patience, 0.0)):
                yield from self._received(busy[connection])
            # Kill workers whose item takes too long.
            end_late_verb("an evaluation in a worker", max(worker.seconds for worker in busy.values()))
            for worker in [each for each in self.processes if each.places and not each.connection.poll()]:
                if self.seconds is not None and worker.since is not None and worker.seconds >= self.seconds:
                    self._remove(worker)
                    yield self._lost(worker, f"it took more than {self.seconds:g} s")

    def _received(self, worker: _Worker) -> Iterator[tuple[int, Reply]]:
        """Yield a worker's replies; if it has ended, requeue its items, but not one that ended too many workers."""
        try:
            place, reply = cloudpickle.loads(worker.connection.recv_bytes())
        except (EOFError, OSError):
            status, first = self._remove(worker), worker.places[0]
            self.failures[first] += 1
            if self.failures[first] <= OPTIONS.allowed_failures:
                self.pending.extendleft(reversed(worker.places))
                return
            end = f"by signal {-status}" if status < 0 else f"with status {status}"
            if worker.since is None:
                text = f"workers must start, got {self.failures[first]} that ended: {end}"
                raise SolverFailed(text) from None
            yield self._lost(worker, f"{self.failures[first]} workers ended on it, the last {end}")
            return
        worker.since = time.monotonic()
        if place == STARTED:
            return
        worker.replies += 1
        worker.places.popleft()
        self.answered += 1
        self.computed += getattr(reply, "seconds", 0.0)
        yield place, reply

    def _remove(self, worker: _Worker) -> int:
        """End a worker and return its exit status."""
        self.processes.remove(worker)
        return worker.end()

    def _lost(self, worker: _Worker, cause: str) -> tuple[int, Reply]:
        """Return the current item of an ended worker as lost. Its other items are requeued."""
        place = worker.places.popleft()
        self.pending.extendleft(reversed(worker.places))
        self.answered += 1
        return place, Lost(cause=cause)
