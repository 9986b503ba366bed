"""The work of a Dask worker on a task: it computes a function of some items."""

from __future__ import annotations

import ctypes
import os
import platform
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import Any, NamedTuple

import cloudpickle

from paretoik.runs.distribution import Reply, become_worker
from paretoik.runs.machine import processor, software
from paretoik.runs.processes import WorkerProcesses
from paretoik.runs.worker import compute


class Task(NamedTuple):
    """A function with its items, by place, as bytes; the key of the shared object; seconds that an item may take."""

    function: bytes
    items: bytes
    key: str
    seconds: float | None
    software: Mapping[str, str]


# Bytes of free memory that a worker keeps; glibc itself grows to this value. Dask's workers return all above 64 kB to
# the system: with short-lived arrays that took a third of a search's time.
KEPT_MEMORY = 64 * 2**20
TRIM_THRESHOLD = -1  # M_TRIM_THRESHOLD in glibc's malloc.h


class Origin(NamedTuple):
    """Name of a machine, a process on it, and the make of its processor."""

    machine: str
    process: int
    processor: tuple[str, ...]


class Computed(NamedTuple):
    """The replies to items by place, and their origin."""

    replies: Sequence[tuple[int, Reply]]
    origin: Origin


class _Local(threading.local):
    """The object that the tasks of a thread share, its key, and the process that may be ended, if one is needed."""

    key: str | None = None
    shared: Any = None
    process: WorkerProcesses | None = None


_LOCAL = _Local()


def run_task(shared: bytes, task: Task) -> Computed | str:
    """Return the replies to the items of a task, or the reason why there are none: this worker has other versions."""
    for name, number in task.software.items():
        if (here := software().get(name, "none")) != number:
            return f"{name} must be {number}, got {here}"
    become_worker()
    _keep_memory()
    origin = Origin(platform.node(), os.getpid(), processor())
    if _LOCAL.key != task.key:
        _LOCAL.shared, _LOCAL.key = cloudpickle.loads(shared), task.key
    function, items = cloudpickle.loads(task.function), cloudpickle.loads(task.items)
    if task.seconds is None:
        replies = [(place, compute(function, _LOCAL.shared, item)) for place, item in items]
        return Computed(replies=replies, origin=origin)
    if _LOCAL.process is None:
        _LOCAL.process = WorkerProcesses(1)
    places = [place for place, _ in items]
    answers = _LOCAL.process.replies(function, _LOCAL.shared, [item for _, item in items], seconds=task.seconds)
    return Computed(replies=[(places[i], reply) for i, reply in answers], origin=origin)


@cache
def _keep_memory() -> None:
    """Make this process keep the memory that it frees, if the system's library can."""
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).mallopt(TRIM_THRESHOLD, KEPT_MEMORY)
