"""Executors: this process, local workers, or the workers of a cluster."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from typing import Any

from paretoik.errors import InvalidInput
from paretoik.inputs import check_size, shown
from paretoik.runs.distribution import distributing, executor
from paretoik.runs.machine import processor
from paretoik.runs.processes import WorkerProcesses

# The entry ``computed`` of `run.json`: the processes that computed, and its text.


def computed(former: object = None) -> dict[str, Any]:
    """Return the processes used so far, as an entry of `run.json`.

    ``former``: this entry of a resumed run, to which new entries are added

    ``by`` has one entry for each change: this process, workers on this machine, or a Dask cluster with its ``machines``
    and workers by make of processor. ``reproducible`` says how one process reproduces the run: "bit for bit" if all
    processors have one make, "to tolerance" if not, "unknown" while a cluster has computed nothing or if the entries
    name no process.
    """
    active = executor()
    entry = {"by": "this process"} if active is None else active.description()
    entry["processor"] = " ".join(processor())
    before = _entries(former)
    entries = before if before[-1:] == [entry] else [*before, entry]
    return {"reproducible": _reproducible(entries), "by": entries}


def computed_text(stored: object) -> str:
    """Return the processes of a run's entry in one line, "" if the entry cannot be read."""
    entries = _entries(stored)
    if not entries:
        return ""
    words = list[str]()
    for entry in entries:
        text = str(entry["by"]) + (f" ({entry['workers']})" if "workers" in entry else "")
        if "machines" in entry:
            makes = entry["machines"]
            parts = [f"{each['workers']} workers on {each['machines']} machines, {each['processor']}" for each in makes]
            text += f" ({'; '.join(parts) or 'no worker yet'})"
        words.append(text)
    return f"{', then '.join(words)}; {REPRODUCIBLE[_reproducible(entries)]}"


REPRODUCIBLE = {  # in words, how a run can be reproduced in one process
    "bit for bit": "one process reproduces it bit for bit",
    "to tolerance": "processors of different makes, so one process reproduces it to tolerance",
    "unknown": "the makes of processor are unknown",
}


def _entries(computed_by: object) -> list[dict[str, Any]]:
    """Return the entries of the processes; empty if the run has none."""
    return [dict(each) for each in computed_by["by"]] if isinstance(computed_by, Mapping) else []


def _reproducible(entries: Sequence[Mapping[str, Any]]) -> str:
    if any(each.get("machines") == [] for each in entries):
        return "unknown"
    makes = {make.get("processor") for each in entries for make in (each, *each.get("machines", ()))}
    return "bit for bit" if len(makes) == 1 else "to tolerance"


# Executors: this process, local workers, or a cluster.


def check_workers(workers: int | None, cluster: str | None) -> None:
    """Raise InvalidInput for an invalid number of workers or address, and for both together."""
    if workers is not None:
        check_size("workers", workers, 1)
    if cluster is None:
        return
    if workers is not None:
        raise InvalidInput(f"workers must be None with a cluster, which has its own, got {workers}")
    if not isinstance(cluster, str) or "://" not in cluster:
        raise InvalidInput(f"cluster must be the address of a Dask scheduler, as tcp://HOST:PORT, got {shown(cluster)}")


@contextmanager
def open_executor(workers: int | None, cluster: str | None, *, isolated: bool = False) -> Iterator[None]:
    """Set where items of the body are computed: workers, a cluster, or this process.

    ``isolated`` starts one worker if neither workers nor a cluster are given: a worker can be killed when an evaluation
    takes too long. Raises InvalidInput if there is no such cluster.
    """
    if cluster is not None:
        from paretoik.runs.cluster import Cluster  # imported here because it loads Dask

        with closing(Cluster(cluster)) as remote, distributing(remote):
            yield
    elif workers is not None or isolated:
        with closing(WorkerProcesses(workers or 1)) as processes, distributing(processes):
            yield
    else:
        yield
