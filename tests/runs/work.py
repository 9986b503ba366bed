"""Functions for workers, good ones and bad ones, and a process whose workers must end with it.

python -m tests.runs.work FOLDER
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

from paretoik.runs.distribution import threads
from paretoik.runs.processes import WorkerProcesses


def scaled(factor: float, item: float) -> float:
    return factor * item


def process(shared: object, item: object) -> int:
    time.sleep(0.02)
    return os.getpid()


def sleep(seconds: float, item: object) -> None:
    time.sleep(seconds)


def slow_process(shared: object, item: object) -> int:
    time.sleep(0.2)
    return os.getpid()


def shared_identity(shared: object, item: object) -> tuple[int, int]:
    return os.getpid(), id(shared)


def refuse(shared: object, item: int) -> int:
    if item % 2:
        raise ArithmeticError(f"item {item}")
    return item


def die_once(folder: str, item: int) -> int:
    """Kill the worker at the third item, the first time."""
    mark = Path(folder, f"died-{item}")
    if item == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return item * item


def die_always(folder: str, item: int) -> int:
    if item == 3:
        with Path(folder, "deaths").open("a") as sink:
            sink.write("x")
        os.kill(os.getpid(), signal.SIGKILL)
    return item * item


def loop_for_ever(shared: object, item: int) -> int:
    while item == 1:
        pass
    return item


def hold_the_lock(shared: object, item: int) -> int:
    """Sleep in C code that lets no other thread of Python run."""
    if item == 1:
        ctypes.PyDLL(None).sleep(600)
    return item


def wait_in_folder(folder: str, item: int) -> None:
    """Write down which process this is, and compute for ever."""
    Path(folder, str(os.getpid())).touch()
    loop_for_ever(None, 1)


def unpicklable(shared: object, item: int) -> Any:
    return sys._getframe()


def surroundings(shared: object, item: object) -> dict[str, object]:
    names = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS")
    ignores = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    return {**{name: os.environ.get(name) for name in names}, "threads": threads(), "ignores": ignores}


if __name__ == "__main__":
    list(WorkerProcesses(2).replies(wait_in_folder, sys.argv[1], [0, 1]))


def meet(folder: str, items: int) -> int:
    """Return once this many items have begun, this one among them; raise if they do not."""
    Path(folder, f"begun-{os.getpid()}").touch()
    for _ in range(1200):
        if len(list(Path(folder).glob("begun-*"))) == items:
            return items
        time.sleep(0.05)
    raise AssertionError("others do not begin")
