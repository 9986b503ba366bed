"""A limit on the time that a verb computes: past it, it is asked to stop as by a signal."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from signal import SIGALRM

from paretoik.errors import InvalidInput
from paretoik.inputs import positive_number
from paretoik.stop_flag import STOP


@dataclass(kw_only=True, eq=False)
class TimeLimit:
    """A limit of so many ``seconds``, and whether it was reached."""

    seconds: float | None
    reached: bool = False


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

    def ring() -> None:
        limit.reached = True
        STOP[0] = STOP[0] or SIGALRM

    timer = threading.Timer(min(float(seconds), threading.TIMEOUT_MAX), ring)
    timer.daemon = True
    timer.start()
    try:
        yield limit
    finally:
        timer.cancel()
        timer.join()
        if STOP[0] == SIGALRM:
            STOP[0] = 0
