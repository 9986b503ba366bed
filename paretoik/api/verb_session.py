"""What every verb needs around its computation: observer, clock, time limit, and the signals that may end it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from signal import SIGINT

from paretoik.api.progress import Observer
from paretoik.api.progress_display import NamedObserver, open_observer
from paretoik.errors import InvalidInput, SolverFailed
from paretoik.execution.blas_threads import single_blas_thread
from paretoik.execution.interrupts import Interruption, interruptible
from paretoik.execution.time_limit import TimeLimit, time_limit
from paretoik.stop_flag import Interrupted


@dataclass(kw_only=True, eq=False)
class VerbSession:
    """A verb at work: its observer, its clock, and the signals that may end it."""

    observe: Observer | None
    interruption: Interruption
    started: float = field(default_factory=time.monotonic)
    limit: TimeLimit = field(default_factory=lambda: TimeLimit(seconds=None))

    @property
    def seconds(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self.started

    @property
    def signal(self) -> str | None:
        """Name of the signal that came, "interrupted" if the observer raised, None otherwise."""
        if self.interruption.signal is None:
            return None if self.observer_fault is None else "interrupted"
        return self.interruption.signal.name

    @property
    def observer_fault(self) -> InvalidInput | None:
        """What the observer raised, if anything."""
        return self.observe.fault if isinstance(self.observe, NamedObserver) else None

    @property
    def stopped_by(self) -> str | None:
        """What ended the computation early: the name of a signal, or "time limit"."""
        return self.signal or ("time limit" if self.limit.reached else None)

    def _given(self) -> str:
        """Return in words how long was searched: what is reserved of a limit for certificates was not."""
        limit, left = self.limit.seconds, self.limit.remaining
        assert limit is not None
        return f"{limit:g} s" if left <= 0 else f"{limit - left:.2g} s, what {limit:g} s leave beside certificates"

    @contextmanager
    def computing(self, seconds: float | None) -> Iterator[None]:
        """Let the body compute for so many seconds at most; it then returns what it has, as after a signal.

        Raises InvalidInput for what is no time, SolverFailed where the body has nothing by then.
        """
        with time_limit(seconds) as self.limit:
            try:
                yield
            except Interrupted as stop:
                if self.signal is None and self.limit.reached:
                    late = f"{self.limit.late} took longer than that" if self.limit.late else ""
                    reason = late or stop.reason or "a longer one may help"
                    raise SolverFailed(f"time_limit: nothing was found within {self._given()}; {reason}") from None
                raise


def computing(seconds: float | None) -> AbstractContextManager[None]:
    """Return a context that computes as ``VerbSession.computing``, before there is a session."""
    return VerbSession(observe=None, interruption=Interruption()).computing(seconds)


@contextmanager
def verb_session(
    observe: Observer | bool | None, *, time_limit: float | None = None, catch_signals: bool = True
) -> Iterator[VerbSession]:
    """Open a verb: catch signals, show its progress, compute with one BLAS thread. Within another's, signals are its.

    Where the body raises Interrupted, a signal came before there was anything to return: KeyboardInterrupt after
    Ctrl-C, SystemExit(143) after SIGTERM. Without ``catch_signals`` these end the body as without a
    verb. Raises InvalidInput for an observer that cannot be called.
    """
    signals = interruptible() if catch_signals else nullcontext(Interruption())
    with open_observer(observe, time_limit=time_limit) as observer, signals as interruption, single_blas_thread():
        try:
            yield VerbSession(observe=observer, interruption=interruption)
        except Interrupted as stop:
            end = _exit_of(interruption)
            for note in getattr(stop, "__notes__", ()):
                end.add_note(note)
            raise end from None


def _exit_of(interruption: Interruption) -> BaseException:
    """Return what a signal would have raised, or ended Python with, had nobody caught it."""
    if interruption.signal is None:  # another thread's
        return KeyboardInterrupt()
    return KeyboardInterrupt() if interruption.signal == SIGINT else SystemExit(interruption.exit_code)
