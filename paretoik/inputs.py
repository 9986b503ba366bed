"""What users give: numbers, sizes, arrays, text, names, paths, flags, functions; or refused by name, in one line.

Every constructor and verb reads what it is given by the functions here. ``shown`` is how a refused value stands in a
message, whatever its own text is.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from numbers import Integral
from os import PathLike
from pathlib import Path
from reprlib import Repr
from types import UnionType
from typing import TYPE_CHECKING, Any, SupportsInt, TypeGuard

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.user_functions import cause_of
from paretoik.user_warnings import warn_user

if TYPE_CHECKING:
    from numpy.typing import ArrayLike as ArrayLike
else:
    ArrayLike = object  # arguments are checked by value here, and refused with our own errors


@dataclass(frozen=True, kw_only=True)
class InputOptions:
    """Sizes of what users give, and of what is shown of it.

    A count is at most ``largest_count``: more of anything does not fit any memory; a seed at most ``largest_seed``, as
    large as NumPy draws them itself. A quantity in SI units is at most ``largest_quantity`` and, where it must be
    positive, at least its inverse: squares and quotients of such are still numbers. A value is shown by at most so many
    characters (``shown``), a list by at most so many ``items``. File systems take names of at most so many bytes
    (``longest_name``). Angles of more than ``turned`` [rad], two turns, are probably degrees: no joint of a robot on
    sale turns further; of more than ``largest_angle`` [rad] numbers no longer tell them apart to 1e-9 rad.
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
    """Return a value as an error shows it: its representation, short and on one line, whatever class it is of."""
    try:
        text = _REPR.repr(value)
    except BaseException:  # such as an integer of more digits than Python writes, or an object whose text raises
        text = f"a {type(value).__name__}"
    return clipped(" ".join(text.split()))


def clipped(text: str) -> str:
    """Return a text as an error shows it: no more than its beginning where it is long."""
    return text if len(text) <= OPTIONS.shown else f"{text[: OPTIONS.shown]}..."


def listed(names: Iterable[str]) -> str:
    """Return names in a row, as many as a message has room for."""
    every = list(names)
    more = len(every) - OPTIONS.items
    return ", ".join(every[: OPTIONS.items]) + (f" and {more} more" if more > 0 else "")


def real_array(name: str, value: object) -> np.ndarray:
    """Copy ``value`` into a new float array, or refuse by ``name`` what does not hold real numbers."""
    return _array(name, value, "iuf", "real numbers").astype(float)


def integer_array(name: str, value: object) -> np.ndarray:
    """Copy ``value`` into a new array of integers, or refuse by ``name`` what does not hold integers."""
    return _array(name, value, "iu", "integers").astype(np.int64)


def _array(name: str, value: object, kinds: str, wish: str) -> np.ndarray:
    try:
        array = np.asarray(value)
    except ValueError:
        raise InvalidInput(f"{name}: must be an array of numbers, got rows of different lengths") from None
    except Exception as error:  # a foreign array may raise anything
        raise InvalidInput(f"{name}: must be an array of numbers, got {cause_of(error)}") from None
    if array.dtype.kind not in kinds and array.size + (array.dtype.kind != "f") > 0:  # an empty list is one of floats
        kind = "text" if array.dtype.kind in "US" else array.dtype
        raise InvalidInput(f"{name}: must hold {wish}, got {kind}")
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InvalidInput(f"{name}: must hold {wish}, got masked ones")
    return array


def finite_array(name: str, value: object, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Copy ``value`` into a new float array, or refuse by ``name`` what is not real, finite and of ``shape``."""
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
    """Return ``value`` as a float, or refuse by ``name`` what is not one number; infinite ones pass, NaN does not."""
    array = real_array(name, value)
    if array.shape != () or np.isnan(array):
        fact = f"shape {array.shape}" if array.shape else "nan"
        raise InvalidInput(f"{name}: must be one number, got {fact}")
    return float(array)


def finite_number(name: str, value: object) -> float:
    """Return ``value`` as a float, or refuse by ``name`` what is not one finite number."""
    return float(finite_array(name, value, shape=()))


def positive_number(name: str, value: object, unit: str) -> float:
    """Return ``value`` as a float; raises InvalidInput, by ``name``, where it is not positive."""
    number = finite_number(name, value)
    if number <= 0:
        raise InvalidInput(f"{name}: must be positive, got {number:g} {unit}")
    check_magnitude(name, number, unit, positive=True)
    return number


def check_magnitude(name: str, values: ArrayLike, unit: str, *, positive: bool = False) -> None:
    """Raise InvalidInput, by ``name``, for quantities so large that squares of them overflow; infinite ones pass.

    ``positive`` ones must not be so small either that their inverse is.
    """
    sizes = np.abs(np.asarray(values, dtype=float))
    largest = float(np.max(sizes[np.isfinite(sizes)], initial=0.0))
    if largest > OPTIONS.largest_quantity:
        raise InvalidInput(f"{name}: at most {OPTIONS.largest_quantity:g} {unit} wanted, got {largest:g} {unit}")
    smallest = float(np.min(sizes, initial=np.inf))
    if positive and smallest < 1 / OPTIONS.largest_quantity:
        wish = f"at least {1 / OPTIONS.largest_quantity:g} {unit}"
        raise InvalidInput(f"{name}: {wish} wanted, got {smallest:g} {unit}")


def check_size(name: str, size: object, minimum: int) -> None:
    """Raise InvalidInput unless ``size`` is an integer of at least ``minimum``, and none that no memory holds."""
    _check_integer(name, size, minimum, OPTIONS.largest_count)


def check_count(name: str, count: object) -> None:
    """Raise InvalidInput unless ``count`` is an integer of at least 1, or None, which leaves it open."""
    if count is not None:
        check_size(name, count, 1)


def check_seed(name: str, seed: object) -> None:
    """Raise InvalidInput unless ``seed`` is one for random numbers: an integer of at least 0 and at most 128 bits."""
    _check_integer(name, seed, 0, OPTIONS.largest_seed)


def is_integer(value: object) -> TypeGuard[SupportsInt]:
    """Say whether a value is an integer, of Python or NumPy, and no truth value."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def _check_integer(name: str, value: object, minimum: int, maximum: int) -> None:
    if not is_integer(value) or int(value) < minimum:
        raise InvalidInput(f"{name}: an integer of at least {minimum} wanted, got {shown(value)}")
    if int(value) > maximum:
        raise InvalidInput(f"{name}: an integer of at most {maximum} wanted, got {shown(value)}")


def likely_spelling(name: object, names: Iterable[str]) -> str:
    """Return a question for the one of ``names`` that is spelt much like ``name``; "" where none is."""
    near = get_close_matches(name, list(names), n=1) if isinstance(name, str) else []
    return f"; did you mean {near[0]!r}?" if near else ""


def degrees_hint(angles: ArrayLike) -> str:
    """Return that radians are wanted, where the largest of ``angles`` [rad] is more than two turns; else ""."""
    sizes = np.abs(np.asarray(angles, dtype=float))
    largest = float(np.max(sizes[np.isfinite(sizes)], initial=0.0))
    if largest <= OPTIONS.turned:
        return ""
    return f"{largest:g} rad is {largest / (2 * np.pi):.3g} turns; of degrees, np.deg2rad makes radians"


def check_angles(name: str, angles: ArrayLike) -> None:
    """Warn, by ``name``, of angles [rad] that are probably degrees; raise InvalidInput for those too large for any."""
    largest = float(np.abs(np.asarray(angles, dtype=float)).max(initial=0.0))
    if largest > OPTIONS.largest_angle:
        raise InvalidInput(f"{name}: angles of at most {OPTIONS.largest_angle:g} rad wanted, got {largest:g}")
    if hint := degrees_hint(angles):
        warn_user(f"{name}: {hint}")


def file_path(name: str, value: object) -> Path:
    """Return ``value`` as a path, or refuse by ``name`` what is none that a file system can have."""
    try:
        path = os.fspath(value) if isinstance(value, str | PathLike) else None
        parts = os.fsencode(path).split(os.fsencode(os.sep)) if isinstance(path, str) else []
        if isinstance(path, str) and path and "\0" not in path and max(map(len, parts)) <= OPTIONS.longest_name:
            return Path(path)
    except Exception:  # text that has no bytes, or a foreign path
        pass
    raise InvalidInput(f"{name}: a path wanted, got {shown(value)}")


def check_flag(name: str, value: object) -> None:
    """Raise InvalidInput unless ``value`` is True or False."""
    if not isinstance(value, bool | np.bool_):
        raise InvalidInput(f"{name}: True or False wanted, got {shown(value)}")


def check_function(name: str, value: object) -> None:
    """Raise InvalidInput unless ``value`` is a function or None."""
    if value is not None and not callable(value):
        raise InvalidInput(f"{name}: a function wanted, got {shown(value)}")


def check_text(name: str, value: object) -> None:
    """Raise InvalidInput unless ``value`` is text on one line, as tables and files can hold it."""
    if not isinstance(value, str) or not value.isprintable():
        raise InvalidInput(f"{name}: printable text wanted, got {shown(value)}")


def check_choice(name: str, value: object, choices: Iterable[object]) -> None:
    """Raise InvalidInput unless ``value`` is one of the ``choices``, and of its type."""
    offered = tuple(choices)
    if not any(type(value) is type(each) and value == each for each in offered):
        words = ", ".join(map(str, offered))
        hint = likely_spelling(value, [each for each in offered if isinstance(each, str)])
        raise InvalidInput(f"{name} must be one of {words}, got {shown(value)}{hint}")


def check_instance(
    name: str, value: object, kind: type | UnionType | tuple[type, ...], wish: str, *, example: str = ""
) -> None:
    """Raise InvalidInput unless ``value`` is of a ``kind``; ``wish`` says what is wanted, with an ``example``."""
    if not isinstance(value, kind):
        raise InvalidInput(f"{name}: {wish} wanted{_such_as(example)}, got {shown(value)}")


def read_list(name: str, value: object, kind: type | UnionType | tuple[type, ...], wish: str) -> tuple[Any, ...]:
    """Return the items, of a ``kind``, of a list or the like; raises InvalidInput, by ``name``, for others.

    Generators are refused: they have their items only once.
    """
    refusal = InvalidInput(f"{name}: {wish} wanted, got {shown(value)}")
    if isinstance(value, str | bytes | Mapping | Iterator):
        raise refusal
    try:
        items: tuple[Any, ...] = tuple(value)  # type: ignore[arg-type]
    except Exception:  # whatever it says that it is, it is no list
        raise refusal from None
    for place, item in enumerate(items):
        if not isinstance(item, kind):
            raise InvalidInput(f"{name}: {wish} wanted, got {shown(item)} at index {place}")
    return items


def check_mapping(name: str, value: object, wish: str, *, example: str = "") -> None:
    """Raise InvalidInput unless ``value`` is a mapping whose keys are text; ``wish`` says of what."""
    if not isinstance(value, Mapping):
        raise InvalidInput(f"{name}: {wish} wanted{_such_as(example)}, got {shown(value)}")
    strange = [key for key in value if not isinstance(key, str)]
    if strange:
        raise InvalidInput(f"{name}: {wish} wanted{_such_as(example)}, got the key {shown(strange[0])}")


def _such_as(example: str) -> str:
    return f", such as {example}" if example else ""
