"""Notices of compilations, with their times. Code that observes them need not import numba.

The clock of time limits stops during compilation, so that a first run has as much time as later ones.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class CompilationNotice:
    """Notice of a compilation.

    what: code that is compiled
    seconds: estimated time [s], None if unknown
    """

    what: str
    seconds: float | None = None

    def __str__(self) -> str:
        estimate = "" if self.seconds is None else f": about {self.seconds:.0f} s"
        return f"compiling {self.what}, once for this copy of paretoik{estimate}"


Observer = Callable[[CompilationNotice], object]
Listener = Callable[[str, float], object]  # takes the name of a compiled function, and its compile time [s]


def print_line(text: object) -> None:
    """Print a line to stderr; a failed write is ignored."""
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            print(text, file=sys.stderr, flush=True)


_OBSERVERS: list[Observer] = [print_line]
_LISTENERS: list[Listener] = []
_TIME: list[tuple[float, float | None]] = [(0.0, None)]
"""Seconds of finished compilations, and start of the present one or None, as one pair that other threads can read."""


@contextmanager
def observe_compilation(observer: Observer) -> Iterator[None]:
    """Send notices to ``observer`` instead of ``print_line`` or a former observer."""
    _OBSERVERS.append(observer)
    try:
        yield
    finally:
        _OBSERVERS.remove(observer)


@contextmanager
def list_compiled(listener: Listener) -> Iterator[None]:
    """Call ``listener`` after each function that the body compiles."""
    _LISTENERS.append(listener)
    try:
        yield
    finally:
        _LISTENERS.remove(listener)


def begin_compilation(notice: CompilationNotice | None = None) -> None:
    """Stop the clock if it runs; notify the last observer if the compilation takes long."""
    seconds, since = _TIME[0]
    if since is None:
        _TIME[0] = seconds, time.monotonic()
    if notice is not None and (notice.seconds or 0.0) >= 1.0:  # s: shorter ones are not announced
        _OBSERVERS[-1](notice)


def end_compilation(what: str = "") -> None:
    """Restart the clock after a compilation; tell listeners ``what`` was compiled, and its time."""
    seconds, since = _TIME[0]
    if since is None:
        return
    _TIME[0] = seconds + time.monotonic() - since, None
    for listener in _LISTENERS:
        listener(what, _TIME[0][0] - seconds)


def computing_clock() -> float:
    """Return a monotonic time [s] that excludes compilations of this process."""
    seconds, since = _TIME[0]
    return (time.monotonic() if since is None else since) - seconds
