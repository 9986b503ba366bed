"""Numbers and arrays that users give: copied as floats, or refused by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from paretoik.errors import InvalidInput

if TYPE_CHECKING:
    from numpy.typing import ArrayLike as ArrayLike
else:
    ArrayLike = object  # arguments are checked by value here, and refused with our own errors


def finite_array(name: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Copy ``value`` into a new float array, or refuse by ``name`` what is not real, finite and of ``shape``."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise InvalidInput(f"{name}: must be an array of numbers, got rows of different lengths") from None
    if array.dtype.kind not in "iuf":
        raise InvalidInput(f"{name}: must hold real numbers, got {array.dtype}")
    if shape is not None and array.shape != shape:
        raise InvalidInput(f"{name}: must have shape {shape}, got shape {array.shape}")
    finite = np.isfinite(array)
    if not finite.all():
        first = tuple(int(i) for i in np.argwhere(~finite)[0])
        where = f" at index {first[0] if len(first) == 1 else first}" if first else ""
        raise InvalidInput(f"{name}: must be finite, got {array[first]}{where}")
    return array.astype(float)


def positive_number(name: str, value: float, unit: str) -> float:
    """Return ``value`` as a float; raises InvalidInput, by ``name``, where it is not positive."""
    number = float(finite_array(name, value, shape=()))
    if number <= 0:
        raise InvalidInput(f"{name}: must be positive, got {number:g} {unit}")
    return number
