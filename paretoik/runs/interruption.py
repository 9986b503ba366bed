"""Signals that stop a run, which then keeps its result."""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from math import inf
from signal import SIGALRM, Signals
from types import FrameType

from paretoik import stop_flag
from paretoik.compilation_notices import computing_clock
from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.inputs import CALLS, CallLimit, limited_calls, positive_number
from paretoik.stop_flag import STOP, Interrupted

# A limit on a verb's computing time, without compilation: after it the verb stops as after a signal.


@dataclass(kw_only=True, eq=False)
class TimeLimit:
    """A time limit [s] (None: no limit), and whether it was reached."""

    seconds: float | None
    reached: bool = False
    started: float = field(default_factory=computing_clock)
    late: str = ""  # name of the user's function whose call was ended

    @property
    def remaining(self) -> float:
        """Seconds left; infinite without a limit."""
        return inf if self.seconds is None else self.seconds - (computing_clock() - self.started)

    @contextmanager
    def limiting_calls(self, end: Callable[[], object] = bool) -> Iterator[None]:
        """End users' calls in the body after the limit: call ``end()``, then raise Interrupted."""
        if self.seconds is None:
            yield
            return

        def left(lasted: float, loads: bool) -> float:
            return max(self.remaining, (CALLS.loading if loads else CALLS.grace) - lasted)

        def failure(name: str) -> Interrupted:
            self.reached, self.late = True, name
            end()
            return Interrupted(reason=f"{name} took longer than that")

        with limited_calls(CallLimit(left=left, failure=failure, ends_verb=True)):
            yield


_TIME_LIMIT: list[TimeLimit] = []  # active limits, from the outermost to the innermost


def check_time_limit(seconds: float | None) -> None:
    """Raise InvalidInput unless the limit is a positive number or None. A number is valid only in the main thread."""
    if seconds is None:
        return
    positive_number("time_limit", seconds, "s")
    if threading.current_thread() is not threading.main_thread():
        raise InvalidInput("time_limit must be set in the main thread, as signals are, got another thread")


@contextmanager
def time_limit(seconds: float | None) -> Iterator[TimeLimit]:
    """Ask the body to stop after this many seconds. None sets no limit. Raises as ``check_time_limit`` does."""
    check_time_limit(seconds)
    limit = TimeLimit(seconds=seconds)
    if seconds is None:
        yield limit
        return

    ended = threading.Event()

    def stop() -> None:
        limit.reached = True
        STOP[0] = STOP[0] or SIGALRM

    def watch() -> None:
        while (remaining := limit.remaining) > 0:
            if ended.wait(min(remaining, threading.TIMEOUT_MAX)):
                return
        stop()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    _TIME_LIMIT.append(limit)
    try:
        with limit.limiting_calls(stop):
            yield limit
    finally:
        _TIME_LIMIT.pop()
        ended.set()
        watcher.join()
        if STOP[0] == SIGALRM:
            STOP[0] = 0
        if any(outer.remaining <= 0 for outer in _TIME_LIMIT):  # reached in the meantime
            STOP[0] = STOP[0] or SIGALRM


def time_is_up() -> bool:
    """Return whether a signal came, or an active time limit, less its reserved time, was reached."""
    return bool(STOP[0]) or any(limit.reached for limit in _TIME_LIMIT)


@contextmanager
def limited_evaluations(seconds: float | None, *, allowed: float = inf) -> Iterator[None]:
    """End each call of a user's function in the body after ``seconds`` by EvaluationFailed; None sets no limit.

    After ``allowed`` such calls the next one raises Interrupted, with the reason.
    """
    if seconds is None:
        yield
        return
    positive_number("evaluation_timeout", seconds, "s")

    def left(lasted: float, loads: bool) -> float:
        return inf if loads else seconds - lasted

    ended = count(1)

    def failure(name: str) -> EvaluationFailed | Interrupted:
        reason = f"{name} took longer than the evaluation timeout of {seconds:g} s"
        return EvaluationFailed(reason) if next(ended) <= allowed else Interrupted(reason=reason)

    with limited_calls(CallLimit(left=left, failure=failure, ends_verb=False)):
        yield


@contextmanager
def reserve_time(share: float, longest: float) -> Iterator[None]:
    """Ask the body to stop earlier: a ``share`` of the active time limit, at most ``longest`` [s], is reserved.

    The limit then counts as reached. Without a limit the body runs freely.
    """
    if not _TIME_LIMIT or _TIME_LIMIT[-1].remaining <= 0:
        yield
        return
    outer = _TIME_LIMIT[-1]
    assert outer.seconds is not None
    remaining = outer.remaining - min(share * outer.seconds, longest)
    inner = TimeLimit(seconds=None)
    try:
        with time_limit(max(remaining, 1e-3)) as inner:
            yield
    finally:
        outer.reached, outer.late = outer.reached or inner.reached, outer.late or inner.late


# Signals that stop a run.


SIGNALS = (signal.SIGINT, signal.SIGTERM)


@dataclass
class Interruption:
    """The signal that asked a run to stop, if any."""

    signal: Signals | None = None


_ACTIVE: list[Interruption] = []  # one at most: signals belong to the process


@contextmanager
def _watching() -> Iterator[None]:
    """Set the stop flag at once when a signal comes, even while compiled code runs in the main thread.

    Python calls handlers only between its own instructions, but writes the number of a signal into a socket at once.
    """

    def watch() -> None:
        while number := receiver.recv(1)[0]:
            if number in SIGNALS and not STOP[0]:
                STOP[0] = number

    receiver, sender = socket.socketpair()
    with receiver, sender:
        sender.setblocking(False)
        former = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
        watcher = threading.Thread(target=watch, daemon=True)
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


def _leave_to_parent() -> None:
    """Prevent a forked process from writing signals into its parent's socket."""
    if stop_flag.watched:
        stop_flag.watched = False
        signal.set_wakeup_fd(-1)


os.register_at_fork(after_in_child=_leave_to_parent)


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Record the first SIGINT or SIGTERM instead of ending the process.

    Code in the ``with`` block learns of the signal from ``stop_flag``. The former handlers are restored at the first
    signal, so that a second Ctrl-C raises KeyboardInterrupt, or else at the end of the block. A nested block gets the
    ``Interruption`` of the outer one. Outside the main thread no signal is caught, because Python allows no handlers.
    """
    if threading.current_thread() is not threading.main_thread():
        yield Interruption()
        return
    if _ACTIVE:
        yield _ACTIVE[-1]
        return
    interruption, former = Interruption(), {which: signal.getsignal(which) for which in SIGNALS}

    def record(number: int, frame: FrameType | None) -> None:
        interruption.signal = Signals(number)
        STOP[0] = number
        restore()

    def restore() -> None:
        for which, handler in former.items():
            # None means a handler that was not set from Python and cannot be set back from it.
            signal.signal(which, signal.SIG_DFL if handler is None else handler)

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
