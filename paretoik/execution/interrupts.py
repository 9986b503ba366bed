"""Stopping a run from outside, so that it can end in order and keep what it has."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """Whether a run was asked to stop, and by which signal; true once it was."""

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None

    def __bool__(self) -> bool:
        return self.signal is not None

    @property
    def exit_code(self) -> int:
        """130 after Ctrl-C, 143 after a termination, 0 when nothing came."""
        return 0 if self.signal is None else 128 + self.signal


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Note the first SIGINT or SIGTERM instead of dying of it; the handlers found are put back at the end.

    With the first signal the former handlers return at once, so a second Ctrl-C raises KeyboardInterrupt. Outside the
    main thread, where Python allows no handlers, nothing is caught.
    """
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return

    def note(number: int, frame: FrameType | None) -> None:
        interruption.signal = signal.Signals(number)
        restore()

    def restore() -> None:
        for which, handler in former.items():
            # None stands for a handler that was not set from Python and cannot be set back from it.
            signal.signal(which, signal.SIG_DFL if handler is None else handler)

    former = {which: signal.getsignal(which) for which in SIGNALS}
    try:
        for which in SIGNALS:
            signal.signal(which, note)
        yield interruption
    finally:
        restore()
