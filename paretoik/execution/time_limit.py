"""A limit on the time that a verb computes: past it, it is asked to stop as by a signal. Compiling is not counted."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from math import inf
from signal import SIGALRM

from paretoik.compilation_notices import computing_clock
from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.inputs import positive_number
from paretoik.stop_flag import STOP, Interrupted
from paretoik.user_functions import CALLS, CallLimit, limited_calls


@dataclass(kw_only=True, eq=False)
class TimeLimit:
    """A limit of so many ``seconds``, and whether it was reached."""

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
        """End calls of users' functions in the body past the limit: they raise Interrupted, after ``end()``."""
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


_ACTIVE: list[TimeLimit] = []  # those under way, one within another


def check_time_limit(seconds: float | None) -> None:
    """Raise InvalidInput unless that is None or a positive number, and outside the main thread for a number.

    The flag that asks a verb to stop is the process's.
    """
    if seconds is None:
        return
    positive_number("time_limit", seconds, "s")
    if threading.current_thread() is not threading.main_thread():
        raise InvalidInput("time_limit: wants the main thread, as signals do, got another one")


@contextmanager
def time_limit(seconds: float | None) -> Iterator[TimeLimit]:
    """Ask what the body runs to stop after so many seconds; None sets no limit. Raises as ``check_time_limit``."""
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
    _ACTIVE.append(limit)
    try:
        with limit.limiting_calls(stop):
            yield limit
    finally:
        _ACTIVE.pop()
        ended.set()
        watcher.join()
        if STOP[0] == SIGALRM:
            STOP[0] = 0
        if any(outer.remaining <= 0 for outer in _ACTIVE):  # meanwhile
            STOP[0] = STOP[0] or SIGALRM


def time_is_up() -> bool:
    """Return whether a signal came, or a time limit under way has no time left but what is reserved for later."""
    return bool(STOP[0]) or any(limit.reached for limit in _ACTIVE)


@contextmanager
def limited_evaluations(seconds: float | None, *, allowed: float = inf) -> Iterator[None]:
    """End each call of a user's function in the body after this time with EvaluationFailed; None sets no limit.

    The call after ``allowed`` ones that were ended raises Interrupted, with the reason.
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
    """Ask what the body runs to stop before the time limit under way, so that some of it is left for what follows.

    Left is a ``share`` of the limit, at most ``longest`` [s]. The limit then counts as reached. Without one the body
    runs freely.
    """
    if not _ACTIVE or _ACTIVE[-1].remaining <= 0:
        yield
        return
    outer = _ACTIVE[-1]
    assert outer.seconds is not None
    remaining = outer.remaining - min(share * outer.seconds, longest)
    inner = TimeLimit(seconds=None)
    try:
        with time_limit(max(remaining, 1e-3)) as inner:
            yield
    finally:
        outer.reached, outer.late = outer.reached or inner.reached, outer.late or inner.late
