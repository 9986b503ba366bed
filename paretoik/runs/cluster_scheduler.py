"""How work is shared out over a cluster, and how long its scheduler and workers are waited for."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from paretoik.errors import InvalidInput, SolverFailed
from paretoik.stop_flag import STOP, Interrupted


@dataclass(frozen=True, kw_only=True)
class ClusterOptions:
    """How tasks are made, and how long a silence is tolerated [s].

    portion, overhead: seconds of work in a task, and more seconds per thread, as every task passes through one
        scheduler and one client; a task is never larger than an even share of the items left
    shares: shares per thread that the items left are divided into
    ahead: tasks per thread at the scheduler
    interval, watch: time between two looks for a signal, and at the workers
    connection: time for somebody to listen at the address; a scheduler that is silent for longer is reported
    patience: time for the scheduler to answer, to come back, and to have a worker
    frozen: a worker that is silent for longer is left out
    """

    portion: float = 0.5
    overhead: float = 0.002
    shares: int = 2
    ahead: int = 2
    interval: float = 0.1
    watch: float = 2.0
    connection: float = 5.0
    patience: float = 60.0
    frozen: float = 30.0


OPTIONS = ClusterOptions()


# Connecting to a Dask scheduler: if nobody listens, the error comes soon; a slow scheduler gets more time.


class _Attempt(threading.Thread):
    """An attempt to connect, in its own thread, because Dask waits without looking for signals.

    When ``ended`` is set, ``client`` is connected or ``error`` is the reason for the failure.
    """

    def __init__(self, address: str, options: ClusterOptions) -> None:
        super().__init__(daemon=True)
        self.address, self.options = address, options
        self.client: Any = None
        self.error: Exception | None = None
        self.ended, self.abandoned = threading.Event(), threading.Event()

    def run(self) -> None:
        from distributed import Client

        try:
            self._find_listener()
            # The timeout is also the one for reconnecting: a client that gave up never comes back.
            self.client = Client(self.address, timeout=self.options.patience, set_as_default=False, name="paretoik")
        except Exception as error:  # an address, or the server there, can make Dask raise anything
            self.error = error
        self.ended.set()
        if self.abandoned.is_set() and self.client is not None:
            self.client.close(timeout=1.0)

    def _find_listener(self) -> None:
        """Return when somebody listens at the address; raises OSError if nobody does for a while."""
        from distributed.comm import get_address_host_port

        place = get_address_host_port(self.address)
        deadline = time.monotonic() + self.options.connection
        while True:
            try:
                socket.create_connection(place, timeout=self.options.connection).close()
                return
            except OSError:
                if self.abandoned.is_set() or time.monotonic() + self.options.interval > deadline:
                    raise
            time.sleep(self.options.interval)


def connect(address: str, options: ClusterOptions, tell: Callable[[str], None]) -> Any:
    """Return Dask's client of the scheduler at an address.

    Somebody must listen there within ``connection`` seconds. A scheduler that listens must answer within ``patience``
    seconds, as its machine may be busy; after ``connection`` seconds a warning says so. Raises InvalidInput if nobody
    listens or the scheduler does not answer, Interrupted soon after a signal.
    """
    attempt, begin, has_warned = _Attempt(address, options), time.monotonic(), False
    attempt.start()
    try:
        while not attempt.ended.wait(options.interval):
            waited = time.monotonic() - begin
            if STOP[0]:
                raise Interrupted
            if waited > options.connection + options.patience:
                raise _refusal(address, f"no answer within {options.patience:g} s from the server there")
            if waited > 2 * options.connection and not has_warned:
                has_warned = True
                tell(f"{slow(address, waited)}; it is waited for, {options.patience:g} s at most")
    except BaseException:
        attempt.abandoned.set()
        raise
    if attempt.error is not None:
        raise _refusal(address, _fact(attempt.error)) from attempt.error
    return attempt.client


def slow(address: str, seconds: float) -> str:
    """Return the words that a scheduler is slow to answer."""
    return f"the scheduler at {address} has not answered for {seconds:.0f} s, its machine may be busy"


def _fact(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"nobody listens there ({error.strerror})"
    return " ".join(str(error).split()) or type(error).__name__


def _refusal(address: str, fact: str) -> InvalidInput:
    return InvalidInput(f"cluster must be the address of a Dask scheduler, got {address}: {fact}")


# Checks of a cluster's scheduler and workers from time to time: which are there, missing or silent.


@runtime_checkable
class Cluster(Protocol):
    """The cluster that is watched."""

    address: str
    client: Any
    threads: int

    def tell(self, text: str) -> None:
        """Warn once per text."""


class ClusterWatch:
    """Watches scheduler and workers: reports what is missing, waits for it for a while, then gives up.

    It asks the scheduler and checks later for the answer, as a busy scheduler may take seconds.
    """

    def __init__(self, cluster: Cluster, options: ClusterOptions) -> None:
        self.cluster, self.options = cluster, options
        self.looked = self.question_time = time.monotonic()
        self.question: Future[Any] | None = None  # not answered yet
        self.missing: float | None = None  # since when

    def count_threads(self) -> None:
        """Ask now how many worker threads there are, if any."""
        self._ask(time.monotonic())
        if self.question is not None:
            wait([self.question], timeout=5 * self.options.interval)
            if self.question.done():
                self._count(self._answer() or {})

    def look(self) -> None:
        """Look, if the last look was some time ago; raises SolverFailed if nobody comes back or answers."""
        now = time.monotonic()
        if self.cluster.client.status != "running":
            self.question = None
            self._miss("scheduler", now)
        elif self.question is None:
            if now - self.looked >= self.options.watch:
                self._ask(now)
        elif self.question.done():
            self.looked, seen = now, self._answer()
            if seen:
                self.missing = None
                self._count(seen)
                self._leave_out_frozen(seen)
            else:
                self._miss("worker" if seen is not None else "scheduler", now)
        else:
            self._wait_for_answer(now - self.question_time)

    def _miss(self, what: str, now: float) -> None:
        options, address = self.options, self.cluster.address
        self.missing = now if self.missing is None else self.missing
        if now - self.missing > options.patience:
            raise SolverFailed(f"cluster: no {what} at {address} for {options.patience:g} s; resume continues the run")
        self.cluster.tell(f"no {what} at {address}; one is waited for, {options.patience:g} s at most")

    def _wait_for_answer(self, seconds: float) -> None:
        options, address = self.options, self.cluster.address
        if seconds > options.patience:
            text = f"cluster: no answer from the scheduler at {address} for {options.patience:g} s"
            raise SolverFailed(f"{text}; resume continues the run")
        if seconds > options.connection:
            self.cluster.tell(f"{slow(address, options.connection)}; it is waited for, {options.patience:g} s at most")

    def _ask(self, now: float) -> None:
        """Ask for the threads of every worker, and how long it was silent [s]."""

        def seen(dask_scheduler: Any) -> dict[str, tuple[int, float]]:  # sent by value: needs no code of ours there
            import time

            workers = dask_scheduler.workers.items()
            return {address: (each.nthreads, time.time() - each.last_seen) for address, each in workers}

        self.question_time, self.question = now, self._run_on_scheduler(seen)

    def _answer(self) -> dict[str, tuple[int, float]] | None:
        """Return the scheduler's answer; None if the connection broke before it came."""
        question, self.question = self.question, None
        try:
            return None if question is None else question.result()
        except Exception:  # a broken connection can raise anything
            return None

    def _count(self, seen: Mapping[str, tuple[int, float]]) -> None:
        if seen:
            self.cluster.threads = sum(threads for threads, _ in seen.values())

    def _leave_out_frozen(self, seen: Mapping[str, tuple[int, float]]) -> None:
        for address, (_, silent) in seen.items():
            if silent > self.options.frozen:
                self.cluster.tell(f"the worker at {address} was silent for {self.options.frozen:g} s and is left out")
                self._leave_out(address)

    def _leave_out(self, address: str) -> None:
        async def leave_out(dask_scheduler: Any) -> None:
            await dask_scheduler.remove_worker(address=address, close=False, stimulus_id="paretoik-frozen")

        self._run_on_scheduler(leave_out)

    def _run_on_scheduler(self, function: Any) -> Future[Any] | None:
        client = self.cluster.client
        if client.status != "running":
            return None
        return asyncio.run_coroutine_threadsafe(client._run_on_scheduler(function), client.loop.asyncio_loop)
