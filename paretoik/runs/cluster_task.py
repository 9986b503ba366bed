"""The work of a Dask worker on a task: it computes a function of some items."""

from __future__ import annotations

import ctypes
import os
import platform
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
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


@dataclass(frozen=True, kw_only=True)
class MemoryOptions:
    """How much free memory a worker keeps: ``trim`` bytes at the end of the heap; glibc itself grows to this value.

    Dask's workers return all above 64 kB to the system: with short-lived arrays that took a third of a search's time.
    """

    trim: int = 64 * 2**20


MEMORY = MemoryOptions()
TRIM_THRESHOLD = -1  # M_TRIM_THRESHOLD in glibc's malloc.h


class Origin(NamedTuple):
    """Name of a machine, a process on it, and the make of its processor."""

    machine: str
    process: int
    processor: tuple[str, ...]


def _here() -> Origin:
    return Origin(platform.node(), os.getpid(), processor())


@dataclass(frozen=True, kw_only=True)
class Computed:
    """The replies to items by place, and their origin."""

    replies: Sequence[tuple[int, Reply]]
    origin: Origin


@dataclass(frozen=True, kw_only=True)
class Refused:
    """Reason why a worker does not compute: it has other versions."""

    reason: str


class _Local(threading.local):
    """The object that the tasks of a thread share, its key, and the process that may be ended, if one is needed."""

    key: str | None = None
    shared: Any = None
    process: WorkerProcesses | None = None


_LOCAL = _Local()


def itself(shared: bytes) -> bytes:
    """Return the shared object as it came: as its own task it is sent again to workers that replace others."""
    return shared


def run_task(shared: bytes, task: Task) -> Computed | Refused:
    """Return the replies to the items of a task."""
    for name, number in task.software.items():
        if (here := software().get(name, "none")) != number:
            return Refused(reason=f"{name} must be {number}, got {here}")
    become_worker()
    _keep_memory()
    if _LOCAL.key != task.key:
        _LOCAL.shared, _LOCAL.key = cloudpickle.loads(shared), task.key
    function, items = cloudpickle.loads(task.function), cloudpickle.loads(task.items)
    if task.seconds is None:
        replies = [(place, compute(function, _LOCAL.shared, item)) for place, item in items]
        return Computed(replies=replies, origin=_here())
    if _LOCAL.process is None:
        _LOCAL.process = WorkerProcesses(1)
    places = [place for place, _ in items]
    answers = _LOCAL.process.replies(function, _LOCAL.shared, [item for _, item in items], seconds=task.seconds)
    return Computed(replies=[(places[i], reply) for i, reply in answers], origin=_here())


@cache
def _keep_memory() -> None:
    """Make this process keep the memory that it frees, if the system's library can."""
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).mallopt(TRIM_THRESHOLD, MEMORY.trim)
