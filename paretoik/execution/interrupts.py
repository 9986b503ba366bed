"""Signals that stop a run from outside, so that it can end in order and keep its result."""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from paretoik import stop_flag
from paretoik.stop_flag import STOP

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """The signal that asked a run to stop, if any; true once there was one."""

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None

    def __bool__(self) -> bool:
        return self.signal is not None

    @property
    def exit_code(self) -> int:
        """130 after Ctrl-C, 143 after a termination, 0 without a signal."""
        return 0 if self.signal is None else 128 + self.signal


_ACTIVE: list[Interruption] = []  # at most one: signals are the process's


@contextmanager
def _watching() -> Iterator[None]:
    """Set the stop flag as soon as a signal comes, even while compiled code runs in the main thread.

    Python calls handlers between its own instructions there; the number of a signal it writes into a socket at once.
    """
    receiver, sender = socket.socketpair()
    with receiver, sender:
        sender.setblocking(False)
        former = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
        watcher = threading.Thread(target=_watch, args=(receiver, former), daemon=True)
        watcher.start()
        stop_flag.watched = True
        try:
            yield
        finally:
            stop_flag.watched = False
            signal.set_wakeup_fd(former)
            sender.setblocking(True)
            sender.send(b"\0")
            watcher.join()


def _watch(receiver: socket.socket, former: int) -> None:
    """Set the stop flag to the first signal that a socket brings, until it brings 0; pass all on to a former one."""
    while number := receiver.recv(1)[0]:
        if number in SIGNALS and not STOP[0]:
            STOP[0] = number
        if former >= 0:
            with suppress(OSError):
                os.write(former, bytes([number]))


def _leave_to_parent() -> None:
    """Keep a forked process from writing its signals into its parent's socket."""
    if stop_flag.watched:
        stop_flag.watched = False
        signal.set_wakeup_fd(-1)


os.register_at_fork(after_in_child=_leave_to_parent)


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Record the first SIGINT or SIGTERM instead of ending the process; restore the former handlers at the end.

    What runs meanwhile learns of it from ``stop_flag``. With the first signal the former handlers return at once, so
    a second Ctrl-C raises KeyboardInterrupt. Within another one it is the same. Outside the main thread, where Python
    allows no handlers, nothing is caught.
    """
    if threading.current_thread() is not threading.main_thread():
        yield Interruption()
        return
    if _ACTIVE:
        yield _ACTIVE[-1]
        return
    interruption = Interruption()

    def record(number: int, frame: FrameType | None) -> None:
        interruption.signal = signal.Signals(number)
        STOP[0] = number
        restore()

    def restore() -> None:
        for which, handler in former.items():
            # None stands for a handler that was not set from Python and cannot be set back from it.
            signal.signal(which, signal.SIG_DFL if handler is None else handler)

    former = {which: signal.getsignal(which) for which in SIGNALS}
    _ACTIVE.append(interruption)
    try:
        for which in SIGNALS:
            signal.signal(which, record)
        with _watching():
            yield interruption
    finally:
        restore()
        _ACTIVE.pop()
        STOP[0] = 0
