"""Checks of user input. Each error is one line that begins with the input's name.

Constructors and verbs read numbers, sizes, arrays, text, names, paths, flags and functions with these checks. ``shown``
returns the text of a refused value, of any class, for a message.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from numbers import Integral
from os import PathLike
from pathlib import Path
from reprlib import Repr
from types import FrameType, UnionType
from typing import TYPE_CHECKING, Any, SupportsInt, TypeGuard

import numpy as np

from paretoik.arrays import Objectives
from paretoik.compilation_notices import computing_clock
from paretoik.errors import EvaluationFailed, InvalidInput, ParetoikError, warn_user

# Calls of users' functions: they may raise any error, which becomes one line with the function's name.


@dataclass(frozen=True, kw_only=True)
class CallLimitOptions:
    """Limits of calls of users' functions."""

    grace: float = 1.0  # s: least time for each call, even after the time limit of the verb
    loading: float = 10.0  # s: least time for building a problem, which imports libraries
    allowed: int = 3  # number of calls that may time out while a problem is built
    longest: float = 3600.0  # s: longest wait of a timer
    interval: float = 0.1  # s: time between attempts to end a call; its code may catch the first one


CALLS = CallLimitOptions()


def function_name(function: Callable[..., Any], nameless: str = "lambda") -> str:
    """Return the name of a function, of a partial's function, or of a callable object's class.

    nameless: name of a lambda
    """
    while isinstance(function, partial):
        function = function.func
    name = str(attribute_of(function, "__name__", type(function).__name__))
    return nameless if name == "<lambda>" else name


@contextmanager
def user_function(name: str, failure: type[ParetoikError] = EvaluationFailed) -> Iterator[None]:
    """Turn errors that a user's function raises in the body into a ``failure`` with ``name`` and cause.

    Errors of paretoik and Ctrl-C pass unchanged; all others, and sys.exit, become a ``failure``.
    """
    try:
        yield
    except (ParetoikError, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise failure(f"{name} raised {cause_of(error)}") from error


@dataclass(frozen=True, kw_only=True, eq=False)
class CallLimit:
    """A limit on each call of a user's function.

    left: function (seconds that a call has lasted, whether it loads a problem) that returns the seconds left
    failure: function (name of the call) that returns the error to end it with
    ends_verb: whether the error ends the running verb, not only the call
    """

    left: Callable[[float, bool], float]
    failure: Callable[[str], BaseException]
    ends_verb: bool


class _Late(BaseException):
    """Ends a call, even if its code catches every Exception."""

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
    """Raise the verb's failure if a call in another process has ``lasted`` too long [s]."""
    for limit in _LIMITS:
        if limit.ends_verb and limit.left(lasted, False) <= 0:
            raise limit.failure(name)


@contextmanager
def limited_call(name: str, *, loads: bool = False) -> Iterator[None]:
    """End the body when a limit on users' code is reached, by raising the limit's failure.

    loads: whether the body loads a problem, instead of calling a function

    Only Python code in the main thread, including ``time.sleep``, can be ended. Compiled code that does not return is
    ended only in a worker.
    """
    if not _LIMITS or threading.current_thread() is not threading.main_thread():
        yield
        return
    began = computing_clock()

    def end_if_late(number: int, frame: FrameType | None) -> None:
        if frame is None or frame.f_globals.get("__name__") in (__name__, "contextlib"):
            return  # the call begins or ends just now
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


def attribute_of(value: object, name: str, default: object = None) -> Any:
    """Return an attribute of a user's object; ``default`` if it has none or reading it fails."""
    try:
        return getattr(value, name, default)
    except BaseException:  # a user's object may raise anything
        return default


def cause_of(error: BaseException, where: str = "") -> str:
    """Return an error in one line: type, ``where``, and text."""
    kind = f"{type(error).__name__}{where}"
    try:
        text = " ".join(str(error).split())
    except BaseException:  # the text of a user's exception may raise an error
        return kind
    return f"{kind}: {text}" if text else kind


def first_line(fault: BaseException) -> str:
    """Return the first line of an error's text, or its type if it has no text."""
    return (str(fault).splitlines() or [type(fault).__name__])[0]


def warn_of_odd_objectives(names: Sequence[str], values: Objectives, again: Objectives) -> None:
    """Warn of objectives that are constant, random, or duplicates.

    values: objectives in the user's own sign
    again: objectives of the first arguments, computed a second time
    """
    rounding = 1e-6  # largest relative difference between computations of one value, which may be in different batches
    for place, (name, column, repeated) in enumerate(zip(names, values.T, again.T, strict=True)):
        first = column[: len(repeated)]
        differ = ~np.isclose(first, repeated, rtol=rounding, atol=0, equal_nan=True)
        finite = column[np.isfinite(column)]
        whole = np.isfinite(values).all(axis=1)
        if differ.any():
            text = f"must have the same value for the same argument, got {first[differ][0]:.6g} and then "
            text += f"{repeated[differ][0]:.6g}: results that use it are random"
        elif len(finite) > 1 and np.ptp(finite) == 0:
            text = f"must vary, got {finite[0]:.6g} for each of the first {len(finite)} arguments: it may be constant"
        elif whole.sum() > 1:
            same = np.isclose(values[whole, :place], column[whole, None], rtol=rounding, atol=0).all(axis=0)
            if not same.any():
                continue
            text = f"must differ from {names[int(same.argmax())]}, got the same values for each of the first "
            text += f"{whole.sum()} arguments: it may be a duplicate"
        else:
            continue
        warn_user(f"objective {name} {text}")


# Checks of numbers, arrays, text, names, paths and functions.


if TYPE_CHECKING:
    from numpy.typing import ArrayLike as ArrayLike
else:
    ArrayLike = object  # values are checked here and refused with our own errors


@dataclass(frozen=True, kw_only=True)
class InputOptions:
    """Bounds of user input, and sizes in messages.

    largest_count: largest count that fits into memory
    largest_seed: largest seed; NumPy itself draws seeds of this size
    largest_quantity: largest quantity in SI units, whose square is finite; its inverse is the smallest positive one
    shown: maximum number of characters of a text in a message
    items: maximum number of items of a list in a message
    longest_name: maximum number of bytes of a file name
    turned: angle [rad] above which degrees are suspected, two turns: no commercial robot's joint turns farther
    largest_angle: largest angle [rad] that floats resolve to 1e-9 rad
    """

    largest_count: int = 2**31 - 1
    largest_seed: int = 2**128 - 1
    largest_quantity: float = 1e50
    shown: int = 80
    items: int = 12
    longest_name: int = 255
    turned: float = 4 * np.pi
    largest_angle: float = 1e6


OPTIONS = InputOptions()
_REPR = Repr()
_REPR.maxother = _REPR.maxstring = OPTIONS.shown
_REPR.maxlist = _REPR.maxtuple = _REPR.maxdict = _REPR.maxset = OPTIONS.items


def shown(value: object) -> str:
    """Return a value's representation in one short line, for any class."""
    try:
        text = _REPR.repr(value)
    except BaseException:  # an integer with too many digits, or an object whose text raises an error
        text = f"a {type(value).__name__}"
    return " ".join(text.split())


def listed(names: Iterable[str]) -> str:
    """Return names separated by commas, the first ones if there are many."""
    every = list(names)
    more = len(every) - OPTIONS.items
    return ", ".join(every[: OPTIONS.items]) + (f" and {more} more" if more > 0 else "")


def real_array(name: str, value: object) -> np.ndarray:
    """Return ``value`` as a new float array; raises InvalidInput, with ``name``, unless its items are real."""
    return _array(name, value, "iuf", "real numbers").astype(float)


def integer_array(name: str, value: object) -> np.ndarray:
    """Return ``value`` as a new array of integers; raises InvalidInput, with ``name``, unless they are integers."""
    return _array(name, value, "iu", "integers").astype(np.int64)


def _array(name: str, value: object, kinds: str, wish: str) -> np.ndarray:
    try:
        array = np.asarray(value)
    except ValueError:
        raise InvalidInput(f"{name}: must be an array of numbers, got rows of different lengths") from None
    except Exception as error:  # another library's array may raise any error
        raise InvalidInput(
            f"{name}: must be an array of numbers, got an object whose reading raised {cause_of(error)}"
        ) from None
    if array.dtype.kind not in kinds and array.size + (array.dtype.kind != "f") > 0:  # [] becomes floats
        kind = "text" if array.dtype.kind in "US" else array.dtype
        raise InvalidInput(f"{name}: must contain {wish}, got {kind}")
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InvalidInput(f"{name}: must contain {wish}, got masked ones")
    return array


def finite_array(name: str, value: object, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Return ``value`` as a new float array; raises InvalidInput unless it is finite and has this ``shape``."""
    array = real_array(name, value)
    if shape is not None and array.shape != shape:
        raise InvalidInput(f"{name}: must have shape {shape}, got shape {array.shape}")
    finite = np.isfinite(array)
    if not finite.all():
        first = tuple(int(i) for i in np.argwhere(~finite)[0])
        where = f" at index {first[0] if len(first) == 1 else first}" if first else ""
        raise InvalidInput(f"{name}: must be finite, got {array[first]}{where}")
    return array


def real_number(name: str, value: object) -> float:
    """Return ``value`` as a float; raises InvalidInput unless it is one number, finite or infinite."""
    array = real_array(name, value)
    if array.shape != () or np.isnan(array):
        fact = f"shape {array.shape}" if array.shape else "nan"
        raise InvalidInput(f"{name}: must be one number, got {fact}")
    return float(array)


def finite_number(name: str, value: object) -> float:
    """Return ``value`` as a float; raises InvalidInput, with ``name``, unless it is one finite number."""
    return float(finite_array(name, value, shape=()))


def positive_number(name: str, value: object, unit: str) -> float:
    """Return ``value`` as a float; raises InvalidInput, with ``name``, unless it is positive."""
    number = finite_number(name, value)
    if number <= 0:
        raise InvalidInput(f"{name}: must be positive, got {number:g} {unit}")
    check_magnitude(name, number, unit, positive=True)
    return number


def check_magnitude(name: str, values: ArrayLike, unit: str, *, positive: bool = False) -> None:
    """Raise InvalidInput, with ``name``, for quantities whose squares overflow.

    Infinite quantities are valid. If ``positive``, quantities whose inverse is too large are refused too.
    """
    sizes = np.abs(np.asarray(values, dtype=float))
    largest = float(np.max(sizes[np.isfinite(sizes)], initial=0.0))
    if largest > OPTIONS.largest_quantity:
        wish = f"at most {OPTIONS.largest_quantity:g} {unit}".rstrip()
        raise InvalidInput(f"{name} must be {wish}, got {largest:g} {unit}")
    smallest = float(np.min(sizes, initial=np.inf))
    if positive and smallest < 1 / OPTIONS.largest_quantity:
        wish = f"at least {1 / OPTIONS.largest_quantity:g} {unit}".rstrip()
        raise InvalidInput(f"{name} must be {wish}, got {smallest:g} {unit}")


def check_size(name: str, size: object, minimum: int) -> None:
    """Raise InvalidInput unless ``size`` is an integer from ``minimum`` to the largest that fits into memory."""
    _check_integer(name, size, minimum, OPTIONS.largest_count)


def check_count(name: str, count: object) -> None:
    """Raise InvalidInput unless ``count`` is a positive integer or None."""
    if count is not None:
        check_size(name, count, 1)


def check_seed(name: str, seed: object) -> None:
    """Raise InvalidInput unless ``seed`` is an integer from 0 to 2¹²⁸ − 1."""
    _check_integer(name, seed, 0, OPTIONS.largest_seed)


def is_integer(value: object) -> TypeGuard[SupportsInt]:
    """Return whether a value is an integer of Python or NumPy (not a bool)."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def _check_integer(name: str, value: object, minimum: int, maximum: int) -> None:
    if not is_integer(value) or int(value) < minimum:
        raise InvalidInput(f"{name} must be an integer of at least {minimum}, got {shown(value)}")
    if int(value) > maximum:
        raise InvalidInput(f"{name} must be an integer of at most {maximum}, got {shown(value)}")


def likely_spelling(name: object, names: Iterable[str]) -> str:
    """Return a question that suggests the name most similar to ``name``; "" if none is similar."""
    near = get_close_matches(name, list(names), n=1) if isinstance(name, str) else []
    return f"; did you mean {near[0]!r}?" if near else ""


def degrees_hint(angles: ArrayLike) -> str:
    """Return a hint to use radians if the largest of ``angles`` [rad] is more than two turns, else ""."""
    sizes = np.abs(np.asarray(angles, dtype=float))
    largest = float(np.max(sizes[np.isfinite(sizes)], initial=0.0))
    if largest <= OPTIONS.turned:
        return ""
    return f"{largest:g} rad is {largest / (2 * np.pi):.3g} turns; if it is in degrees, convert it by np.deg2rad"


def check_angles(name: str, angles: ArrayLike) -> None:
    """Warn of angles [rad] that are probably degrees; raises InvalidInput for angles that are too large."""
    largest = float(np.abs(np.asarray(angles, dtype=float)).max(initial=0.0))
    if largest > OPTIONS.largest_angle:
        raise InvalidInput(f"{name} must be angles of at most {OPTIONS.largest_angle:g} rad, got {largest:g}")
    if hint := degrees_hint(angles):
        warn_user(f"{name}: {hint}")


def file_path(name: str, value: object) -> Path:
    """Return ``value`` as a path; raises InvalidInput, with ``name``, unless it is valid for a file system."""
    try:
        path = os.fspath(value) if isinstance(value, str | PathLike) else None
        parts = os.fsencode(path).split(os.fsencode(os.sep)) if isinstance(path, str) else []
        if isinstance(path, str) and path and "\0" not in path and max(map(len, parts)) <= OPTIONS.longest_name:
            return Path(path)
    except Exception:  # text that cannot be encoded as bytes, or another library's path
        pass
    raise InvalidInput(f"{name} must be a path, got {shown(value)}")


def check_flag(name: str, value: object) -> None:
    """Raise InvalidInput unless ``value`` is True or False."""
    if not isinstance(value, bool | np.bool_):
        raise InvalidInput(f"{name} must be True or False, got {shown(value)}")


def check_function(name: str, value: object) -> None:
    """Raise InvalidInput unless ``value`` is a function or None."""
    if value is not None and not callable(value):
        raise InvalidInput(f"{name} must be a function, got {shown(value)}")


def check_text(name: str, value: object) -> None:
    """Raise InvalidInput unless ``value`` is text on one line."""
    if not isinstance(value, str) or not value.isprintable():
        raise InvalidInput(f"{name} must be printable text, got {shown(value)}")


def check_choice(name: str, value: object, choices: Iterable[object]) -> None:
    """Raise InvalidInput unless ``value`` equals one of ``choices`` and has its type."""
    offered = tuple(choices)
    if not any(type(value) is type(each) and value == each for each in offered):
        words = ", ".join(map(str, offered))
        hint = likely_spelling(value, [each for each in offered if isinstance(each, str)])
        raise InvalidInput(f"{name} must be one of {words}, got {shown(value)}{hint}")


def check_instance(
    name: str, value: object, kind: type | UnionType | tuple[type, ...], wish: str, *, example: str = ""
) -> None:
    """Raise InvalidInput unless ``value`` is an instance of ``kind``, which ``wish`` and ``example`` describe."""
    if not isinstance(value, kind):
        such_as = f", such as {example}" if example else ""
        raise InvalidInput(f"{name} must be {wish}{such_as}, got {shown(value)}")


def read_list(name: str, value: object, kind: type | UnionType | tuple[type, ...], wish: str) -> tuple[Any, ...]:
    """Return the items of an iterable as a tuple; raises InvalidInput unless all are of this ``kind``.

    Generators are refused: they give their items only once.
    """
    refusal = InvalidInput(f"{name} must be {wish}, got {shown(value)}")
    if isinstance(value, str | bytes | Mapping | Iterator):
        raise refusal
    try:
        items: tuple[Any, ...] = tuple(value)  # type: ignore[arg-type]
    except Exception:  # the object cannot be iterated
        raise refusal from None
    for place, item in enumerate(items):
        if not isinstance(item, kind):
            raise InvalidInput(f"{name} must be {wish}, got {shown(item)} at index {place}")
    return items


def check_mapping(name: str, value: object, wish: str, *, example: str = "") -> None:
    """Raise InvalidInput unless ``value`` is a mapping with text keys, which ``wish`` and ``example`` describe."""
    such_as = f", such as {example}" if example else ""
    if not isinstance(value, Mapping):
        raise InvalidInput(f"{name} must be {wish}{such_as}, got {shown(value)}")
    for key in value:
        if not isinstance(key, str):
            raise InvalidInput(f"{name} must be {wish}{such_as}, got the key {shown(key)}")
