"""A look at a cluster's scheduler and workers from time to time: who is there, who is missing, who is silent."""

from __future__ import annotations

import time
from typing import Any, Protocol, runtime_checkable

from paretoik.errors import SolverFailed
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
    """Looks after scheduler and workers: says what is missing, waits for it for a while, and then gives up."""

    def __init__(self, cluster: Cluster, options: ClusterOptions) -> None:
        self.cluster, self.options = cluster, options
        self.looked = time.monotonic()
        self.missing: float | None = None  # since when

    def count_threads(self) -> None:
        """Know at once how many workers there are by now, if there are any."""
        seen = self._workers()
        if seen:
            self.cluster.threads = sum(threads for threads, _ in seen.values())

    def look(self) -> None:
        """Look, if the last time was some time ago; raises SolverFailed where nobody comes back."""
        now = time.monotonic()
        if now - self.looked < self.options.watch:
            return
        seen = self._workers()
        self.looked = time.monotonic()
        if seen is None:
            self._miss("scheduler", now)
        elif not seen:
            self._miss("worker", now)
        else:
            self.missing, self.cluster.threads = None, sum(threads for threads, _ in seen.values())
        for address, (_, silent) in (seen or {}).items():
            if silent > self.options.frozen:
                self.cluster.tell(f"the worker at {address} was silent for {self.options.frozen:g} s and is left out")
                self._leave_out(address)

    def _miss(self, what: str, now: float) -> None:
        options, address = self.options, self.cluster.address
        self.missing = now if self.missing is None else self.missing
        if now - self.missing > options.patience:
            raise SolverFailed(f"cluster: no {what} at {address} for {options.patience:g} s; a run goes on with resume")
        self.cluster.tell(f"no {what} at {address}; one is waited for, {options.patience:g} s at most")

    def _workers(self) -> dict[str, tuple[int, float]] | None:
        """Return the threads of every worker, and for how long it was silent [s]; None where no scheduler answers."""

        def seen(dask_scheduler: Any) -> dict[str, tuple[int, float]]:  # sent as it is: nothing of ours is needed there
            import time

            workers = dask_scheduler.workers.items()
            return {address: (each.nthreads, time.time() - each.last_seen) for address, each in workers}

        return self._ask(seen)

    def _leave_out(self, address: str) -> None:
        async def leave_out(dask_scheduler: Any) -> None:
            await dask_scheduler.remove_worker(address=address, close=False, stimulus_id="paretoik-frozen")

        self._ask(leave_out)

    def _ask(self, function: Any) -> Any:
        client = self.cluster.client
        if client.status != "running":
            return None
        try:
            return client.sync(client._run_on_scheduler, function, callback_timeout=1.0)
        except Exception:  # whatever a broken connection raises
            return None
