"""A worker: a process that computes functions of items for the process that started it, and ends with it.

Its arguments, CONNECTION and LIFE, are two file descriptors. Messages come and go as pickles.
"""

from __future__ import annotations

import fcntl
import os
import signal
import sys
import time
from multiprocessing.connection import Connection
from queue import SimpleQueue
from threading import Thread
from typing import Any, NamedTuple

import cloudpickle

from paretoik.errors import InvalidInput
from paretoik.inputs import cause_of
from paretoik.runs.distribution import Done, Function, Raised, become_worker

STARTED = -1  # in place of a place: the items of a message are being started, one after the other


class Work(NamedTuple):
    """Items with their places, the function to compute, and the shared object if it is a new one."""

    function: bytes
    shared: bytes | None
    items: list[tuple[int, Any]]


def compute(function: Function, shared: Any, item: Any) -> Done | Raised:
    """Return what a function returns for an item, or that it raised an error."""
    begin = time.perf_counter()
    try:
        return Done(value=function(shared, item), seconds=time.perf_counter() - begin)
    except Exception as error:
        return Raised(error=error)


def _serve(connection: Connection) -> None:
    """Compute messages until no more come."""
    received: SimpleQueue[bytes | None] = SimpleQueue()
    Thread(target=_receive, args=(connection, received), daemon=True).start()
    shared: Any = None
    while (message := received.get()) is not None:
        work: Work = Work(*cloudpickle.loads(message))
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


def _receive(connection: Connection, received: SimpleQueue[bytes | None]) -> None:
    """Read messages as they come, so that the sender never waits for a computation."""
    try:
        while True:
            received.put(connection.recv_bytes())
    except (EOFError, OSError):
        received.put(None)


def _send(connection: Connection, place: int, reply: Done | Raised | None) -> None:
    try:
        message = cloudpickle.dumps((place, reply))
    except Exception as error:  # errors of users need not be picklable
        refusal = InvalidInput(f"workers: a result must be picklable, got {cause_of(error)}")
        message = cloudpickle.dumps((place, Raised(error=refusal)))
    connection.send_bytes(message)


def _die_with(life: int) -> None:
    """Make the kernel end this process as soon as nobody holds the other end of a pipe, whatever it computes.

    Nothing is ever written into the pipe: its end comes, and SIGIO with it, which by default ends the process.
    """
    signal.signal(signal.SIGIO, signal.SIG_DFL)
    fcntl.fcntl(life, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(life, fcntl.F_SETFL, fcntl.fcntl(life, fcntl.F_GETFL) | os.O_ASYNC | os.O_NONBLOCK)
    try:
        os.read(life, 1)
        os._exit(0)  # the starting process had ended before
    except BlockingIOError:
        pass


def main() -> None:
    """Serve the process that started this one."""
    connection, life = map(int, sys.argv[1:])
    _die_with(life)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that started it ends it
    become_worker()
    _serve(Connection(connection))
