"""Signals that stop a run from outside, so that it can end in order and keep its result."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

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


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Record the first SIGINT or SIGTERM instead of ending the process; restore the former handlers at the end.

    With the first signal the former handlers return at once, so a second Ctrl-C raises KeyboardInterrupt. Outside the
    main thread, where Python allows no handlers, nothing is caught.
    """
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return

    def record(number: int, frame: FrameType | None) -> None:
        interruption.signal = signal.Signals(number)
        restore()

    def restore() -> None:
        for which, handler in former.items():
            # None stands for a handler that was not set from Python and cannot be set back from it.
            signal.signal(which, signal.SIG_DFL if handler is None else handler)

    former = {which: signal.getsignal(which) for which in SIGNALS}
    try:
        for which in SIGNALS:
            signal.signal(which, record)
        yield interruption
    finally:
        restore()
