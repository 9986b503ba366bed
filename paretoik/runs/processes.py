"""Workers on this machine: processes that are replaced when they end, and killed when they take too long."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from typing import Any

import cloudpickle

from paretoik.errors import SolverFailed, warn_user
from paretoik.inputs import check_size, end_late_verb
from paretoik.runs.distribution import Function, Lost, Reply, pickled
from paretoik.runs.machine import child_command
from paretoik.runs.worker import STARTED, Work
from paretoik.stop_flag import STOP, Interrupted

LIBRARIES = ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM", "NUMBA")  # each would use one thread per core
ONE_THREAD = {f"{name}_THREADS" if "_" in name else f"{name}_NUM_THREADS": "1" for name in LIBRARIES}


@dataclass(frozen=True, kw_only=True)
class WorkerOptions:
    """How work is given to workers, and when it is given up.

    portion, shares: seconds of items that a worker gets, at most one share of the items left, ``shares`` per worker
    allowed_failures: an item is lost after more workers than this ended on it
    loading: more seconds for the first item of a worker, as code is read from the disk
    frozen: seconds after which a stopped worker is replaced
    interval: seconds between two looks for a signal
    """

    portion: float = 0.5
    shares: int = 2
    allowed_failures: int = 3
    loading: float = 5.0
    frozen: float = 5.0
    interval: float = 0.1


OPTIONS = WorkerOptions()


@dataclass(kw_only=True, eq=False)
class _Worker:
    """A process, its unanswered items, and the time since when it computes the first of them or is stopped."""

    process: subprocess.Popen[bytes]
    connection: Connection
    life: int
    has: object = None  # the shared object
    places: deque[int] = field(default_factory=deque)
    since: float | None = None
    stopped_since: float | None = None
    replies: int = 0

    def is_frozen(self, seconds: float) -> bool:
        """Return whether the process was stopped, as by SIGSTOP, for this long, as far as the system says."""
        is_stopped = False
        with suppress(ChildProcessError, AttributeError):  # it has ended, or the system does not say
            what = os.WSTOPPED | os.WNOHANG | os.WNOWAIT
            is_stopped = os.waitid(os.P_PID, self.process.pid, what) is not None
        now = time.monotonic()
        self.stopped_since = (self.stopped_since or now) if is_stopped else None
        return self.stopped_since is not None and now - self.stopped_since >= seconds

    def end(self) -> int:
        """End it at once and return its exit status."""
        self.process.kill()
        with suppress(OSError):
            self.connection.close()
        os.close(self.life)
        return self.process.wait()


class WorkerProcesses:
    """A number of processes on this machine that end when this object is closed, or with this process.

    Raises InvalidInput if ``workers`` is no valid number of workers.
    """

    def __init__(self, workers: int, options: WorkerOptions = OPTIONS) -> None:
        check_size("workers", workers, 1)
        self.workers, self._options = int(workers), options
        self._processes: list[_Worker] = []
        self._shared: tuple[Any, bytes] = (None, b"")

    def close(self) -> None:
        """End all workers."""
        while self._processes:
            self._processes.pop().end()

    def description(self) -> dict[str, Any]:
        """Return who computes, as an entry of `run.json`."""
        return {"by": "worker processes", "workers": self.workers}

    def replies(
        self, function: Function, shared: Any, items: Sequence[Any], *, seconds: float | None = None
    ) -> Iterator[tuple[int, Reply]]:
        """Yield every item's place and reply, as they come; an item that takes longer than ``seconds`` is lost.

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
    """The items of one call, on their way through the workers."""

    def __init__(
        self, pool: WorkerProcesses, function: bytes, shared: bytes, items: Sequence[Any], seconds: float | None
    ) -> None:
        self.processes, self.options = pool._processes, pool._options
        self.workers = min(pool.workers, len(items))
        self.function, self.shared, self.items, self.seconds = function, shared, items, seconds
        self.pending = deque(range(len(items)))
        self.failures: Counter[int] = Counter()
        self.unborn = 0  # workers in a row that ended before they computed
        self.answered = 0
        self.computed = 0.0

    def replies(self) -> Iterator[tuple[int, Reply]]:
        while self.answered < len(self.items):
            if STOP[0]:
                raise Interrupted
            self._deal()
            busy = {worker.connection: worker for worker in self.processes if worker.places}
            for connection in wait(list(busy), timeout=self._patience()):
                yield from self._received(busy[connection])  # type: ignore[index]
            self._end_late_verb()
            for worker in [each for each in self.processes if self._overdue(each)]:
                yield self._give_up(worker)
            for worker in [each for each in self.processes if each.places and each.is_frozen(self.options.frozen)]:
                self._replace_frozen(worker)

    def _deal(self) -> None:
        """Give work to idle workers, and start workers that are missing."""
        while len(self.processes) < self.workers:
            self.processes.append(_start())
        for worker in self.processes:
            if self.pending and not worker.places:
                self._give(worker)

    def _give(self, worker: _Worker) -> None:
        portion = 1
        if self.computed and self.seconds is None:
            portion = int(self.options.portion * self.answered / self.computed)
        share = len(self.pending) // (self.options.shares * self.workers)
        places = [self.pending.popleft() for _ in range(max(1, min(portion, share)))]
        shared = None if worker.has is self.shared else self.shared
        work = Work(self.function, shared, [(place, self.items[place]) for place in places])
        worker.has, worker.since = self.shared, None
        worker.places.extend(places)
        with suppress(OSError):  # it has ended, which is noticed when its reply is awaited
            worker.connection.send_bytes(pickled("an item", tuple(work)))

    def _patience(self) -> float:
        """Return how long to wait for a reply."""
        limits = [limit - time.monotonic() for each in self.processes if (limit := self._limit(each)) is not None]
        return max(0.0, min([self.options.interval, *limits]))

    def _limit(self, worker: _Worker) -> float | None:
        """Return when a worker will have taken too long, None for never."""
        if self.seconds is None or worker.since is None or not worker.places:
            return None
        return worker.since + self.seconds + (0.0 if worker.replies else self.options.loading)

    def _overdue(self, worker: _Worker) -> bool:
        limit = self._limit(worker)
        return limit is not None and time.monotonic() >= limit and not worker.connection.poll()

    def _end_late_verb(self) -> None:
        """Raise Interrupted if the time limit of the verb is over and an item takes longer than it may then."""
        for worker in self.processes:
            if worker.places and worker.since is not None:
                loading = 0.0 if worker.replies else self.options.loading
                end_late_verb("an evaluation in a worker", time.monotonic() - worker.since - loading)

    def _received(self, worker: _Worker) -> Iterator[tuple[int, Reply]]:
        """Yield what a worker has sent; replace a worker that has ended."""
        try:
            place, reply = cloudpickle.loads(worker.connection.recv_bytes())
        except (EOFError, OSError):
            yield from self._ended(worker)
            return
        worker.since, self.unborn = time.monotonic(), 0
        if place == STARTED:
            return
        worker.replies += 1
        worker.places.popleft()
        self.answered += 1
        self.computed += getattr(reply, "seconds", 0.0)
        yield place, reply

    def _ended(self, worker: _Worker) -> Iterator[tuple[int, Reply]]:
        """Give an ended worker's items to others; yield the item that it ended on if too many workers did."""
        self.processes.remove(worker)
        status, began = worker.end(), worker.since is not None
        first = worker.places[0]
        if not began:
            self.unborn += 1
            if self.unborn > self.options.allowed_failures:
                raise SolverFailed(f"workers must start, got {self.unborn} that ended: {_end(status)}")
        self.failures[first] += began
        if self.failures[first] <= self.options.allowed_failures:
            self.pending.extendleft(reversed(worker.places))
            return
        worker.places.popleft()
        self.pending.extendleft(reversed(worker.places))
        self.answered += 1
        yield first, Lost(cause=f"{self.failures[first]} workers ended on it, the last {_end(status)}")

    def _replace_frozen(self, worker: _Worker) -> None:
        """End a stopped worker; others compute its items, which did not cause the stop."""
        self.processes.remove(worker)
        worker.end()
        self.pending.extendleft(reversed(worker.places))
        text = f"workers: process {worker.process.pid} was stopped for {self.options.frozen:g} s and is replaced"
        warn_user(text)

    def _give_up(self, worker: _Worker) -> tuple[int, Reply]:
        """End a worker that takes too long, and return its present item as lost."""
        self.processes.remove(worker)
        worker.end()
        place = worker.places.popleft()
        self.pending.extendleft(reversed(worker.places))
        self.answered += 1
        return place, Lost(cause=f"it took more than {self.seconds:g} s")


def _end(status: int) -> str:
    return f"by signal {-status}" if status < 0 else f"with status {status}"


def _start() -> _Worker:
    ours, theirs = socket.socketpair()
    life, end = os.pipe()
    with theirs:
        command = child_command("paretoik.runs.worker", str(theirs.fileno()), str(life))
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                pass_fds=(theirs.fileno(), life),
                env={**os.environ, **ONE_THREAD},
            )
        finally:
            os.close(life)
    return _Worker(process=process, connection=Connection(ours.detach()), life=end)
