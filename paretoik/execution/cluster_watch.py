"""A look at a cluster's scheduler and workers from time to time: who is there, who is missing, who is silent."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from concurrent.futures import Future, wait
from typing import Any, Protocol, runtime_checkable

from paretoik.errors import SolverFailed
from paretoik.execution.cluster_connection import slow
from paretoik.execution.cluster_options import ClusterOptions


@runtime_checkable
class Cluster(Protocol):
    """The cluster that is looked after."""

    address: str
    client: Any
    threads: int

    def tell(self, text: str) -> None:
        """Warn of something, once."""


class ClusterWatch:
    """Looks after scheduler and workers: says what is missing, waits for it for a while, and then gives up.

    It asks the scheduler and looks later whether that has answered: a busy one may take seconds.
    """

    def __init__(self, cluster: Cluster, options: ClusterOptions) -> None:
        self.cluster, self.options = cluster, options
        self.looked = self.question_time = time.monotonic()
        self.question: Future[Any] | None = None  # on its way
        self.missing: float | None = None  # since when

    def count_threads(self) -> None:
        """Know soon how many workers there are by now, if there are any."""
        self._ask(time.monotonic())
        if self.question is not None:
            wait([self.question], timeout=5 * self.options.interval)
            if self.question.done():
                self._count(self._answer() or {})

    def look(self) -> None:
        """Look, if the last time was some time ago; raises SolverFailed where nobody comes back or answers."""
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
            raise SolverFailed(f"cluster: no {what} at {address} for {options.patience:g} s; a run goes on with resume")
        self.cluster.tell(f"no {what} at {address}; one is waited for, {options.patience:g} s at most")

    def _wait_for_answer(self, seconds: float) -> None:
        options, address = self.options, self.cluster.address
        if seconds > options.patience:
            text = f"cluster: no answer from the scheduler at {address} for {options.patience:g} s"
            raise SolverFailed(f"{text}; a run goes on with resume")
        if seconds > options.connection:
            self.cluster.tell(f"{slow(address, options.connection)}; it is waited for, {options.patience:g} s at most")

    def _ask(self, now: float) -> None:
        """Ask for the threads of every worker, and for how long it was silent [s]."""

        def seen(dask_scheduler: Any) -> dict[str, tuple[int, float]]:  # sent as it is: nothing of ours is needed there
            import time

            workers = dask_scheduler.workers.items()
            return {address: (each.nthreads, time.time() - each.last_seen) for address, each in workers}

        self.question_time, self.question = now, self._run_on_scheduler(seen)

    def _answer(self) -> dict[str, tuple[int, float]] | None:
        """Return what the scheduler has answered; None where the connection broke before."""
        question, self.question = self.question, None
        try:
            return None if question is None else question.result()
        except Exception:  # whatever a broken connection raises
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
