"""Arrays of expressions that NumPy code takes for arrays of numbers.

A ``TracedArray`` stands for an array (time, ...). Where ``samples`` is given, the time axis is hidden: the code runs
once for all samples, and may not couple one sample to another. Where it is None, time is an axis like any other.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.lib.array_utils import normalize_axis_tuple
from numpy.lib.mixins import NDArrayOperatorsMixin

from paretoik.autodiff.numpy_ufuncs import BOOLEAN, apply_ufunc
from paretoik.autodiff.tape import Expression, Tape
from paretoik.errors import InvalidInput


class NotLocal(InvalidInput):
    """The code couples one sample to another."""


class Trace:
    """A tape, and its ``parameters``: inputs whose numbers (samples,) are known but change from sample to sample."""

    def __init__(self, samples: int | None) -> None:
        self.tape = Tape()
        self.samples = samples
        self.parameters: dict[int, np.ndarray] = {}  # by entry
        self._by_values: dict[bytes, Expression] = {}

    def inputs(self, *shape: int) -> TracedArray:
        """Return an array of new inputs."""
        entries = np.empty(shape, dtype=object)
        for index in np.ndindex(shape):
            entries[index] = self.tape.input()
        return TracedArray(self, entries, shared=True)

    def parameter(self, values: np.ndarray) -> Expression:
        """Return the input that has these values (samples,) at the samples."""
        key = np.ascontiguousarray(values, dtype=float).tobytes()
        if key not in self._by_values:
            self._by_values[key] = self.tape.input()
            self.parameters[self._by_values[key].index] = np.array(values, dtype=float)
        return self._by_values[key]


class TracedArray(NDArrayOperatorsMixin):
    """An array of expressions and numbers; ``entries`` is an array of objects without the hidden time axis.

    ``is_boolean`` says that it stands for True and False, ``shared`` that NumPy's array is read-only or may share its
    memory with others, so that it cannot be changed in place here.
    """

    def __init__(self, trace: Trace, entries: Any, *, is_boolean: bool = False, shared: bool = False) -> None:
        self.source = trace  # not .trace, which is NumPy's
        self.entries = np.asarray(entries, dtype=object)
        self.is_boolean = is_boolean
        self.shared = shared

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape that the array stands for, time included."""
        hidden = () if self.source.samples is None else (self.source.samples,)
        return (*hidden, *self.entries.shape)

    @property
    def ndim(self) -> int:
        """Number of axes, time included."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of elements, time included."""
        return int(np.prod(self.shape))

    @property
    def dtype(self) -> np.dtype[Any]:
        """What the array stands for: real numbers, or booleans."""
        return np.dtype(bool if self.is_boolean else float)

    @property
    def T(self) -> TracedArray:  # noqa: N802  NumPy's name
        """The array with its axes in reverse."""
        return self.transpose()

    @property
    def mT(self) -> TracedArray:  # noqa: N802  NumPy's name
        """The array with its last two axes exchanged."""
        return rearrange("mT", lambda numbers: np.swapaxes(numbers, -1, -2), self)

    def reshape(self, *shape: Any, **settings: Any) -> TracedArray:
        """Return the array in another shape, as NumPy's method does."""
        return rearrange("reshape", lambda numbers: numbers.reshape(*shape, **settings), self)

    def transpose(self, *axes: Any) -> TracedArray:
        """Return the array with its axes in another order, as NumPy's method does."""
        return rearrange("transpose", lambda numbers: numbers.transpose(*axes), self)

    def astype(self, dtype: Any, copy: bool = True) -> TracedArray:
        """Return the array as real numbers or booleans; raise InvalidInput for other types."""
        if np.dtype(dtype) == bool:
            booleans: TracedArray = self != 0
            return booleans
        if np.dtype(dtype).kind != "f":
            raise InvalidInput(f"astype({np.dtype(dtype)}) has no derivative here: float or bool is wanted")
        return TracedArray(self.source, self.entries, shared=not copy)

    def copy(self) -> TracedArray:
        """Return a copy."""
        return TracedArray(self.source, self.entries, is_boolean=self.is_boolean)

    def __getattr__(self, name: str) -> Any:
        """Return a method that is as NumPy's function of that name; raise InvalidInput where there is none."""
        if name.startswith("__"):  # what Python and NumPy ask to see what an object can do
            raise AttributeError(name)
        function = getattr(np, name, None) if hasattr(np.ndarray, name) else None
        if not callable(function):
            raise InvalidInput(f".{name} of an array has no derivative here")
        return partial(function, self)

    def __len__(self) -> int:
        if not self.shape:
            raise InvalidInput("a number has no length")
        return self.shape[0]

    def __bool__(self) -> bool:
        raise InvalidInput("a comparison cannot decide an `if` where derivatives are taken: np.where is wanted")

    def __array__(self, *args: Any, **settings: Any) -> np.ndarray:
        raise InvalidInput(
            "plain numbers were asked of an array that derivatives are taken of: NumPy functions only, np.stack for "
            "np.array"
        )

    def _refuse_number(self, *args: Any) -> Any:
        raise InvalidInput("a plain number was asked of an array that derivatives are taken of: NumPy functions only")

    __float__ = __int__ = __index__ = __complex__ = __round__ = __trunc__ = _refuse_number

    def __iter__(self) -> Any:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, key: Any) -> TracedArray:
        if any(isinstance(part, TracedArray) for part in (key if isinstance(key, tuple) else (key,))):
            raise InvalidInput("an index cannot depend on the motion where derivatives are taken: np.where is wanted")
        return rearrange("indexing", lambda numbers: numbers[key], self)

    def __setitem__(self, key: Any, value: Any) -> None:
        raise InvalidInput("x[...] = y cannot be written where derivatives are taken: np.where or np.stack is wanted")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **settings: Any) -> Any:
        """Apply a NumPy function of numbers, element by element, or a sum, product, maximum or minimum of many."""
        from paretoik.autodiff.numpy_array_functions import matmul, reduce_ufunc  # here: in terms of this class

        name = ufunc.__name__
        if method == "reduce" and ufunc in REDUCIBLE:
            _check_settings(f"np.{name}.reduce", settings, "axis", "keepdims")
            return reduce_ufunc(ufunc, *inputs, **{"axis": 0, **settings})
        (out,) = settings.pop("out", (None,))
        if method != "__call__":
            raise InvalidInput(f"np.{name}.{method} has no derivative here")
        _check_settings(f"np.{name}", settings)
        if name == "matmul":
            result = matmul(*inputs)
        else:
            if name == "add" and all(_is_boolean(value) for value in inputs):
                name = "logical_or"
            result = apply_elementwise(self.source, lambda *parts: apply_ufunc(self.source.tape, name, parts), *inputs)
            result.is_boolean = name in BOOLEAN
        return result if out is None else _assign_out(name, out, result)

    def __array_function__(self, function: Callable[..., Any], types: Any, args: Any, settings: Any) -> Any:
        """Apply NumPy's function of arrays, if its derivative is known.

        Raises InvalidInput, naming the function, where it is not.
        """
        from paretoik.autodiff.numpy_array_functions import apply_function  # here: in terms of this class

        return apply_function(self.source, function, args, settings)

    def entry_axes(self, axes: Any) -> tuple[int, ...]:
        """Return axes (None: all) as axes of ``entries``; raise NotLocal where the hidden one is among them."""
        try:
            normalized = normalize_axis_tuple(range(self.ndim) if axes is None else axes, self.ndim)
        except (TypeError, ValueError) as error:
            raise InvalidInput(f"axis {axes}: {error}") from None
        if self.source.samples is None:
            return normalized
        if 0 in normalized:
            raise NotLocal("looks along time")
        return tuple(axis - 1 for axis in normalized)


def apply_elementwise(trace: Trace, function: Callable[..., Any], *inputs: Any) -> TracedArray:
    """Return a function of numbers applied to arrays element by element, broadcast as NumPy does.

    Raises InvalidInput where the shapes do not go together.
    """
    axes = {value.entries.ndim for value in inputs if isinstance(value, TracedArray)}
    try:
        if trace.samples is not None and len(axes) > 1:
            raise ValueError("one's time would meet another axis of the other")
        parts = np.broadcast_arrays(*(entries_of(trace, value, max(axes)) for value in inputs))
    except InvalidInput:
        raise
    except ValueError:
        shapes = " and ".join(
            str(value.shape if isinstance(value, TracedArray) else np.shape(value)) for value in inputs
        )
        raise InvalidInput(f"arrays of shapes {shapes} do not go together, (time, ...) first") from None
    result = np.empty(parts[0].shape, dtype=object)
    for index in np.ndindex(result.shape):
        result[index] = function(*(part[index] for part in parts))
    return TracedArray(trace, result)


def entries_of(trace: Trace, value: Any, axes: int) -> np.ndarray:
    """Return the entries of an array, traced or plain; plain ones with a time axis become inputs.

    ``axes`` is the number of axes without time. Raises ValueError for a time axis that is not that of the samples,
    InvalidInput for what are no real numbers.
    """
    if isinstance(value, TracedArray):
        return value.entries
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        got = array.dtype if array.ndim else repr(value)
        raise InvalidInput(f"real numbers are wanted where derivatives are taken, got {got}")
    if trace.samples is None or array.ndim <= axes:
        return np.asarray(array, dtype=object)
    if array.ndim > axes + 1 or len(array) not in (1, trace.samples):
        raise ValueError(array.shape)
    entries = np.empty(array.shape[1:], dtype=object)
    for index in np.ndindex(entries.shape):
        column = array[(slice(None), *index)]
        entries[index] = column[0] if (column == column[0]).all() else trace.parameter(column)
    return entries


def rearrange(name: str, function: Callable[..., Any], *arrays: TracedArray) -> TracedArray:
    """Return the result of a function that only moves elements: it is applied to their numbers to see where they go.

    Raises NotLocal where a sample gets elements of another, and InvalidInput, naming ``name``, where NumPy raises.
    """
    trace = arrays[0].source
    pool = np.concatenate([array.entries.ravel() for array in arrays])
    sample_offsets = np.arange(trace.samples or 0) * len(pool)
    numbered, offset = [], 0
    for array in arrays:
        numbers = np.arange(offset, offset + array.entries.size).reshape(array.entries.shape)
        numbered.append(numbers if trace.samples is None else numbers + _as_column(sample_offsets, numbers.ndim))
        offset += array.entries.size
    try:
        result = np.asarray(function(*numbered))
    except (ValueError, IndexError, TypeError) as error:
        raise InvalidInput(f"{name} of shape {arrays[0].shape}: {error}") from None
    if trace.samples is not None:
        if result.ndim == 0 or len(result) != trace.samples:
            raise NotLocal("looks from one sample at another")
        if (result != result[0] + _as_column(sample_offsets, result.ndim - 1)).any():
            raise NotLocal("looks from one sample at another")
        result = result[0]
    for array in arrays:
        array.shared = True
    return TracedArray(trace, pool[result], is_boolean=all(array.is_boolean for array in arrays), shared=True)


def _as_column(numbers: np.ndarray, axes: int) -> np.ndarray:
    return numbers.reshape(-1, *[1] * axes)


def _check_settings(function: str, settings: dict[str, Any], *supported: str) -> None:
    for name in settings:
        if name not in supported:
            raise InvalidInput(f"{function}({name}=...) has no derivative here")


def _is_boolean(value: Any) -> bool:
    return value.is_boolean if isinstance(value, TracedArray) else np.asarray(value).dtype == bool


def _assign_out(name: str, out: Any, result: TracedArray) -> TracedArray:
    """Return ``out`` with a result assigned; raise InvalidInput where other arrays might share its memory."""
    if not isinstance(out, TracedArray) or out.shared or out.shape != result.shape:
        raise InvalidInput(f"np.{name} would change an array in place that others see: x = x + y is wanted for x += y")
    out.entries, out.is_boolean = result.entries, result.is_boolean
    return out


REDUCIBLE = frozenset({np.add, np.multiply, np.maximum, np.minimum})
