"""What users give: numbers copied as floats, paths, flags and functions; or refused by name, in one line."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.user_functions import cause_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike as ArrayLike
else:
    ArrayLike = object  # arguments are checked by value here, and refused with our own errors


def real_array(name: str, value: object) -> np.ndarray:
    """Copy ``value`` into a new float array, or refuse by ``name`` what does not hold real numbers."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise InvalidInput(f"{name}: must be an array of numbers, got rows of different lengths") from None
    except Exception as error:  # a foreign array may raise anything
        raise InvalidInput(f"{name}: must be an array of numbers, got {cause_of(error)}") from None
    if array.dtype.kind not in "iuf":
        kind = "text" if array.dtype.kind in "US" else array.dtype
        raise InvalidInput(f"{name}: must hold real numbers, got {kind}")
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InvalidInput(f"{name}: must hold real numbers, got masked ones")
    return array.astype(float)


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


def finite_number(name: str, value: object) -> float:
    """Return ``value`` as a float, or refuse by ``name`` what is not one finite number."""
    return float(finite_array(name, value, shape=()))


def positive_number(name: str, value: float, unit: str) -> float:
    """Return ``value`` as a float; raises InvalidInput, by ``name``, where it is not positive."""
    number = finite_number(name, value)
    if number <= 0:
        raise InvalidInput(f"{name}: must be positive, got {number:g} {unit}")
    return number


def file_path(name: str, value: object) -> Path:
    """Return ``value`` as a path, or refuse by ``name`` what is no text or path."""
    if not isinstance(value, str | PathLike) or not str(value) or "\0" in str(value):
        raise InvalidInput(f"{name}: a path wanted, got {value!r}")
    return Path(value)


def check_flag(name: str, value: object) -> None:
    """Raise InvalidInput unless ``value`` is True or False."""
    if not isinstance(value, bool | np.bool_):
        raise InvalidInput(f"{name}: True or False wanted, got {value!r}")


def check_function(name: str, value: object) -> None:
    """Raise InvalidInput unless ``value`` is a function or None."""
    if value is not None and not callable(value):
        raise InvalidInput(f"{name}: a function wanted, got {value!r}")
