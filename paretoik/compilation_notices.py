"""Notices of what is about to be compiled and about how long that takes; numba is not needed to observe them.

The clock that time limits go by stands still meanwhile: code is compiled once, and a limit is meant for any run.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

SILENT = 1.0  # s: compilations that are estimated or seen to be shorter are not announced


@dataclass(frozen=True, kw_only=True)
class CompilationNotice:
    """Something that is being compiled, and an estimate [s] of how long that takes, or None."""

    what: str
    seconds: float | None = None

    def __str__(self) -> str:
        estimate = "" if self.seconds is None else f": about {self.seconds:.0f} s"
        return f"compiling {self.what}, once for this copy of paretoik{estimate}"


Observer = Callable[[CompilationNotice], object]


def print_line(text: object) -> None:
    """Print a line to stderr, where there is one that takes it: a full or closed one ends no computation."""
    if sys.stderr is not None:
        with suppress(OSError, ValueError):
            print(text, file=sys.stderr, flush=True)


@contextmanager
def observe_compilation(observer: Observer) -> Iterator[None]:
    """Let ``observer`` receive notices instead of ``print_line``, or of an observer before it."""
    _OBSERVERS.append(observer)
    try:
        yield
    finally:
        _OBSERVERS.remove(observer)


def announce(notice: CompilationNotice) -> None:
    """Pass a notice to the last observer."""
    _OBSERVERS[-1](notice)


_OBSERVERS: list[Observer] = [print_line]


@dataclass(eq=False)
class _CompilationTime:
    """How many ``seconds`` were spent on compilations that have ended, and ``since`` when one is under way."""

    seconds: float = 0.0
    since: float | None = None


_TIME = _CompilationTime()


def begin_compilation() -> None:
    """Stop the clock, unless a compilation is under way."""
    if _TIME.since is None:
        _TIME.since = time.monotonic()


def end_compilation() -> None:
    """Let the clock go on, if a compilation is under way."""
    if _TIME.since is not None:
        _TIME.seconds += time.monotonic() - _TIME.since  # first: another thread may read the clock between the lines
        _TIME.since = None


def computing_clock() -> float:
    """Return a monotonic time [s] in which compilations of this process take none."""
    now, since = time.monotonic(), _TIME.since
    return (now if since is None else since) - _TIME.seconds
