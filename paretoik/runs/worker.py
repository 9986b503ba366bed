"""A worker: a process that computes functions of items for the process that started it, and ends with it.

Its argument is the file descriptor of a connection. Messages come and go as pickles.
"""

from __future__ import annotations

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


def main() -> None:
    """Serve the process that started this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that started it ends it
    become_worker()
    connection, received = Connection(int(sys.argv[1])), SimpleQueue[bytes]()
    Thread(target=_receive, args=(connection, received), daemon=True).start()
    shared: Any = None
    while True:
        work: Work = Work(*cloudpickle.loads(received.get()))
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


def _receive(connection: Connection, received: SimpleQueue[bytes]) -> None:
    """Read messages as they come, so that the sender never waits; end this process when the sender has ended."""
    try:
        while True:
            received.put(connection.recv_bytes())
    except (EOFError, OSError):
        os._exit(0)


def _send(connection: Connection, place: int, reply: Done | Raised | None) -> None:
    try:
        message = cloudpickle.dumps((place, reply))
    except Exception as error:  # errors of users need not be picklable
        refusal = InvalidInput(f"workers: a result must be picklable, got {cause_of(error)}")
        message = cloudpickle.dumps((place, Raised(error=refusal)))
    connection.send_bytes(message)
