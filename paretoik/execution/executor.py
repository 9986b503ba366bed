"""Who computes what a verb distributes: this process, workers on this machine, or those of a cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager

from paretoik.distribution import distributing
from paretoik.errors import InvalidInput
from paretoik.execution.worker_processes import WorkerProcesses
from paretoik.inputs import check_size, shown


def check_workers(workers: int | None, cluster: str | None) -> None:
    """Raise InvalidInput for what is no number of workers or no address, and for both."""
    if workers is not None:
        check_size("workers", workers, 1)
    if cluster is None:
        return
    if workers is not None:
        raise InvalidInput(f"workers: wants none beside cluster, which has its own, got {workers}")
    if not isinstance(cluster, str) or "://" not in cluster:
        raise InvalidInput(f"cluster: the address of a Dask scheduler wanted, as tcp://HOST:PORT, got {shown(cluster)}")


@contextmanager
def open_executor(workers: int | None, cluster: str | None, *, isolated: bool = False) -> Iterator[None]:
    """Let so many workers, or those of a cluster, compute what the body distributes; without either this process does.

    ``isolated`` asks for one worker where none are named: it can be ended where this process could not. Raises
    InvalidInput as ``check_workers`` does, and where there is no such cluster.
    """
    check_workers(workers, cluster)
    if cluster is not None:
        from paretoik.execution.cluster import Cluster  # here: it takes Dask

        with closing(Cluster(cluster)) as remote, distributing(remote):
            yield
    elif workers is not None or isolated:
        with closing(WorkerProcesses(workers or 1)) as processes, distributing(processes):
            yield
    else:
        yield
