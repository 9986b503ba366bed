"""Functions of users, which may raise anything: what they raise becomes one line that names them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from dis import opmap
from functools import partial
from typing import Any

import numpy as np

from paretoik.arrays import Objectives
from paretoik.errors import EvaluationFailed, ParetoikError
from paretoik.stop_flag import Interrupted
from paretoik.user_warnings import warn_user


@dataclass(frozen=True, kw_only=True)
class OddObjectiveOptions:
    """Values may differ by a share ``rounding`` when they are computed again, in another batch."""

    rounding: float = 1e-6


OPTIONS = OddObjectiveOptions()


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


def is_ctrl_c(error: BaseException) -> bool:
    """Return whether an error is a KeyboardInterrupt that no code raised by itself, or ours after a signal."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
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
