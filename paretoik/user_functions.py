"""Functions of users, which may raise anything: what they raise becomes one line that names them."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from dis import opmap
from functools import partial
from types import FrameType
from typing import Any

import numpy as np

from paretoik.arrays import Objectives
from paretoik.compilation_notices import computing_clock
from paretoik.errors import EvaluationFailed, ParetoikError
from paretoik.stop_flag import Interrupted
from paretoik.user_warnings import warn_user


@dataclass(frozen=True, kw_only=True)
class OddObjectiveOptions:
    """Values may differ by a share ``rounding`` when they are computed again, in another batch."""

    rounding: float = 1e-6


OPTIONS = OddObjectiveOptions()


@dataclass(frozen=True, kw_only=True)
class CallLimitOptions:
    """How calls of users' functions are ended."""

    grace: float = 1.0  # s: each call may last at least this long, also past the time limit of its verb
    loading: float = 10.0  # s: the same for building a problem, as libraries are imported then
    allowed: int = 3  # calls that may time out while a problem is built
    longest: float = 3600.0  # s: longest wait of a timer
    interval: float = 0.1  # s: time between two attempts to end a call whose code catches the first


CALLS = CallLimitOptions()


def function_name(function: Callable[..., Any], nameless: str = "lambda") -> str:
    """Return the name of a function, of a partial one that of the whole, and of another callable that of its class.

    A lambda is called ``nameless``.
    """
    while isinstance(function, partial):
        function = function.func
    name = str(attribute_of(function, "__name__", type(function).__name__))
    return nameless if name == "<lambda>" else name


@contextmanager
def user_function(name: str, failure: type[ParetoikError] = EvaluationFailed) -> Iterator[None]:
    """Call a user's function in the body: what it raises is raised as ``failure``, by ``name`` and with its cause.

    Our own errors and Ctrl-C pass; sys.exit and whatever else a user's code raises do not.
    """
    try:
        yield
    except ParetoikError:
        raise
    except BaseException as error:
        if is_ctrl_c(error):
            raise
        raise failure(f"{name} raised {cause_of(error)}") from error


@dataclass(frozen=True, kw_only=True, eq=False)
class CallLimit:
    """A limit on each call of a user's function.

    left: seconds left to a call that has lasted this long [s], and whether the call loads a problem
    failure: error of a call of this name that is ended
    ends_verb: whether the failure ends the verb under way, not only the call
    """

    left: Callable[[float, bool], float]
    failure: Callable[[str], BaseException]
    ends_verb: bool


class _Late(BaseException):
    """Ends a call, also one that catches every Exception."""

    def __init__(self, limit: CallLimit) -> None:
        self.limit = limit


_LIMITS: list[CallLimit] = []


@contextmanager
def limited_calls(limit: CallLimit) -> Iterator[None]:
    """Limit each ``limited_call`` within the body."""
    _LIMITS.append(limit)
    try:
        yield
    finally:
        _LIMITS.remove(limit)


def end_late_verb(name: str, lasted: float) -> None:
    """Raise the failure that ends the verb under way if a call elsewhere, as in a worker, has lasted too long [s]."""
    for limit in _LIMITS:
        if limit.ends_verb and limit.left(lasted, False) <= 0:
            raise limit.failure(name)


@contextmanager
def limited_call(name: str, *, loads: bool = False) -> Iterator[None]:
    """End the body, which calls a user's function, or ``loads`` a problem, as soon as a limit is reached.

    Only Python code in the main thread can be ended, and calls that wait, such as ``time.sleep``; compiled code that
    does not return is ended only in a worker. Raises the limit's failure.
    """
    if not _LIMITS or threading.current_thread() is not threading.main_thread():
        yield
        return
    began = computing_clock()

    def end_if_late(number: int, frame: FrameType | None) -> None:
        if frame is None or frame.f_globals.get("__name__") in (__name__, "contextlib"):
            return  # the call begins or ends at this moment
        for limit in _LIMITS:
            if limit.left(computing_clock() - began, loads) <= 0:
                raise _Late(limit)

    handler = signal.signal(signal.SIGALRM, end_if_late)
    first = min(max(min(limit.left(0.0, loads) for limit in _LIMITS), CALLS.interval), CALLS.longest)
    timer = signal.setitimer(signal.ITIMER_REAL, first, CALLS.interval)
    try:
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, *timer)
            signal.signal(signal.SIGALRM, handler)
    except _Late as late:
        raise late.limit.failure(name) from None


def is_ctrl_c(error: BaseException) -> bool:
    """Return whether an error is a KeyboardInterrupt after a signal, not one that a user's code raised by itself."""
    handler: Any = signal.getsignal(signal.SIGINT)
    while isinstance(handler, partial):
        handler = handler.func
    code, trace = getattr(handler, "__code__", None), error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
        if code is not None and trace.tb_frame.f_code is code:  # a handler in Python, as asyncio has one
            return True
    if isinstance(error, Interrupted) or not isinstance(error, KeyboardInterrupt) or trace is None:
        return isinstance(error, Interrupted)
    return trace.tb_frame.f_code.co_code[trace.tb_lasti] != opmap["RAISE_VARARGS"]


def attribute_of(value: object, name: str, default: object = None) -> Any:
    """Return an attribute of a user's object, the default if it has none or raises."""
    try:
        return getattr(value, name, default)
    except BaseException:  # a user's object may raise anything
        return default


def cause_of(error: BaseException, where: str = "") -> str:
    """Return what was raised in one line: its type, ``where``, and its text if it has one."""
    kind = f"{type(error).__name__}{where}"
    try:
        text = " ".join(str(error).split())
    except BaseException:  # a user's exception may have a text that raises
        return kind
    return f"{kind}: {text}" if text else kind


def warn_of_odd_objectives(names: Sequence[str], values: Objectives, again: Objectives) -> None:
    """Warn of objectives that are the same for all arguments, or not the same for the same ones, and of duplicates.

    ``values`` are in the user's own sign, ``again`` those of the first arguments computed once more.
    """
    for name, column, repeated in zip(names, values.T, again.T, strict=True):
        first = column[: len(repeated)]
        differ = ~np.isclose(first, repeated, rtol=OPTIONS.rounding, atol=0, equal_nan=True)
        finite = column[np.isfinite(column)]
        if differ.any():
            text = f"one value for one argument wanted, got {first[differ][0]:.6g} and then {repeated[differ][0]:.6g}"
            text += ": what is found by it is a matter of chance"
        elif len(finite) > 1 and np.ptp(finite) == 0:
            text = (
                f"different values wanted, got {finite[0]:.6g} for each of the first {len(finite)}: it may be constant"
            )
        else:
            text = _duplicate(names, values, names.index(name))
        if text:
            warn_user(f"objective {name}: {text}")


def _duplicate(names: Sequence[str], values: Objectives, column: int) -> str:
    """Return which objective before one has its values, "" where none has."""
    finite = np.isfinite(values).all(axis=1)
    for before in range(column if finite.sum() > 1 else 0):
        if np.allclose(values[finite, before], values[finite, column], rtol=OPTIONS.rounding, atol=0):
            text = f"other values than those of {names[before]} wanted, got the same for each of the first"
            return f"{text} {finite.sum()}: it may be a duplicate"
    return ""
