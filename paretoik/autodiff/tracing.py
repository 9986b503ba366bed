"""Arrays of expressions that NumPy code takes for arrays of numbers.

A ``Traced`` array stands for an array (time, ...). Where ``samples`` is given, the time axis is hidden: the code runs
once for all samples, and may not look from one sample at another. Where it is None, time is an axis like any other.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, reduce
from typing import Any

import numpy as np
from numpy.lib.array_utils import normalize_axis_tuple
from numpy.lib.mixins import NDArrayOperatorsMixin

from paretoik.autodiff.tape import TRUTHS, Expression, Tape, written
from paretoik.errors import InvalidInput


class NotLocal(InvalidInput):
    """The code looks from one sample at another."""


class Trace:
    """A tape, and the numbers that change from sample to sample: ``data``, an array (samples,) an input."""

    def __init__(self, samples: int | None) -> None:
        self.tape = Tape()
        self.samples = samples
        self.data: dict[int, np.ndarray] = {}  # by entry
        self._known: dict[bytes, Expression] = {}

    def inputs(self, *shape: int) -> Traced:
        """Return an array of new inputs."""
        entries = np.empty(shape, dtype=object)
        for place in np.ndindex(shape):
            entries[place] = self.tape.input()
        return Traced(self, entries, shared=True)

    def varying(self, values: np.ndarray) -> Expression:
        """Return the input that takes these numbers (samples,) at the samples."""
        key = np.ascontiguousarray(values, dtype=float).tobytes()
        if key not in self._known:
            self._known[key] = self.tape.input()
            self.data[self._known[key].index] = np.array(values, dtype=float)
        return self._known[key]


class Traced(NDArrayOperatorsMixin):
    """An array of expressions and numbers; ``entries`` is an array of objects without the hidden time axis.

    ``truth`` says that it stands for True and False, ``shared`` that NumPy's array is read-only or may share its memory
    with others, so that it cannot be changed in place here.
    """

    def __init__(self, trace: Trace, entries: Any, *, truth: bool = False, shared: bool = False) -> None:
        self.source = trace
        self.entries = np.asarray(entries, dtype=object)
        self.truth = truth
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
        """What the array stands for: real numbers, or truths."""
        return np.dtype(bool if self.truth else float)

    @property
    def T(self) -> Traced:  # noqa: N802  NumPy's name
        """The array with its axes in reverse."""
        return self.transpose()

    @property
    def mT(self) -> Traced:  # noqa: N802  NumPy's name
        """The array with its last two axes exchanged."""
        return moved("mT", lambda numbers: np.swapaxes(numbers, -1, -2), self)

    def reshape(self, *shape: Any, **settings: Any) -> Traced:
        """Return the array in another shape, as NumPy's method does."""
        return moved("reshape", lambda numbers: numbers.reshape(*shape, **settings), self)

    def transpose(self, *axes: Any) -> Traced:
        """Return the array with its axes in another order, as NumPy's method does."""
        return moved("transpose", lambda numbers: numbers.transpose(*axes), self)

    def astype(self, dtype: Any, copy: bool = True) -> Traced:
        """Return the array as real numbers or truths; raise InvalidInput for other types."""
        if np.dtype(dtype) == bool:
            truths: Traced = self != 0
            return truths
        if np.dtype(dtype).kind != "f":
            raise InvalidInput(f"astype({np.dtype(dtype)}) has no derivative here: float or bool is wanted")
        return Traced(self.source, self.entries, shared=not copy)

    def copy(self) -> Traced:
        """Return a copy."""
        return Traced(self.source, self.entries, truth=self.truth)

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

    def _refused(self, *args: Any) -> Any:
        raise InvalidInput("a plain number was asked of an array that derivatives are taken of: NumPy functions only")

    __float__ = __int__ = __index__ = __complex__ = __round__ = __trunc__ = _refused

    def __iter__(self) -> Any:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, key: Any) -> Traced:
        if any(isinstance(part, Traced) for part in (key if isinstance(key, tuple) else (key,))):
            raise InvalidInput("an index cannot depend on the motion where derivatives are taken: np.where is wanted")
        return moved("indexing", lambda numbers: numbers[key], self)

    def __setitem__(self, key: Any, value: Any) -> None:
        raise InvalidInput("x[...] = y cannot be written where derivatives are taken: np.where or np.stack is wanted")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **settings: Any) -> Any:
        """Write a NumPy function of numbers, element by element, or a sum, product, maximum or minimum of many."""
        name = ufunc.__name__
        if method == "reduce" and ufunc in REDUCED:
            return reduced(ufunc, *inputs, **{"axis": 0, **_plain(f"np.{name}.reduce", settings, "axis", "keepdims")})
        (out,) = settings.pop("out", (None,))
        if method != "__call__":
            raise InvalidInput(f"np.{name}.{method} has no derivative here")
        _plain(f"np.{name}", settings)
        if name == "matmul":
            found = product_of_matrices(*inputs)
        else:
            if name == "add" and all(_is_truth(value) for value in inputs):
                name = "logical_or"
            found = elementwise(self.source, lambda *parts: written(self.source.tape, name, parts), *inputs)
            found.truth = name in TRUTHS
        return found if out is None else _replaced(name, out, found)

    def __array_function__(self, function: Callable[..., Any], types: Any, args: Any, settings: Any) -> Any:
        """Do what NumPy's function of arrays does, if its derivative is known.

        Raises InvalidInput, naming the function, where it is not.
        """
        from paretoik.autodiff.numpy_functions import called  # here: it is written in terms of this class

        return called(self.source, function, args, settings)

    def places(self, axes: Any) -> tuple[int, ...]:
        """Return axes (None: all) as axes of ``entries``; raise NotLocal where the hidden one is among them."""
        try:
            found = normalize_axis_tuple(range(self.ndim) if axes is None else axes, self.ndim)
        except (TypeError, ValueError) as error:
            raise InvalidInput(f"axis {axes}: {error}") from None
        if self.source.samples is None:
            return found
        if 0 in found:
            raise NotLocal("looks along time")
        return tuple(axis - 1 for axis in found)


def elementwise(trace: Trace, function: Callable[..., Any], *inputs: Any) -> Traced:
    """Return a function of numbers applied to arrays element by element, broadcast as NumPy does.

    Raises InvalidInput where the shapes do not go together.
    """
    axes = {value.entries.ndim for value in inputs if isinstance(value, Traced)}
    try:
        if trace.samples is not None and len(axes) > 1:
            raise ValueError("one's time would meet another axis of the other")
        parts = np.broadcast_arrays(*(entries_of(trace, value, max(axes)) for value in inputs))
    except InvalidInput:
        raise
    except ValueError:
        shapes = " and ".join(str(value.shape if isinstance(value, Traced) else np.shape(value)) for value in inputs)
        raise InvalidInput(f"arrays of shapes {shapes} do not go together, (time, ...) first") from None
    found = np.empty(parts[0].shape, dtype=object)
    for place in np.ndindex(found.shape):
        found[place] = function(*(part[place] for part in parts))
    return Traced(trace, found)


def entries_of(trace: Trace, value: Any, axes: int) -> np.ndarray:
    """Return the entries of an array, traced or plain; plain ones with a time axis become inputs.

    ``axes`` is the number of axes without time. Raises ValueError for a time axis that is not that of the samples,
    InvalidInput for what are no real numbers.
    """
    if isinstance(value, Traced):
        return value.entries
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        got = array.dtype if array.ndim else repr(value)
        raise InvalidInput(f"real numbers are wanted where derivatives are taken, got {got}")
    if trace.samples is None or array.ndim <= axes:
        return np.asarray(array, dtype=object)
    if array.ndim > axes + 1 or len(array) not in (1, trace.samples):
        raise ValueError(array.shape)
    found = np.empty(array.shape[1:], dtype=object)
    for place in np.ndindex(found.shape):
        column = array[(slice(None), *place)]
        found[place] = column[0] if (column == column[0]).all() else trace.varying(column)
    return found


def moved(what: str, function: Callable[..., Any], *arrays: Traced) -> Traced:
    """Return what a function that only moves elements makes of arrays: it is shown where it moves numbered ones.

    Raises NotLocal where a sample gets something of another, and InvalidInput, naming ``what``, for what NumPy refuses.
    """
    trace = arrays[0].source
    pool = np.concatenate([array.entries.ravel() for array in arrays])
    later = np.arange(trace.samples or 0) * len(pool)
    numbered, begun = [], 0
    for array in arrays:
        numbers = np.arange(begun, begun + array.entries.size).reshape(array.entries.shape)
        numbered.append(numbers if trace.samples is None else numbers + _column(later, numbers.ndim))
        begun += array.entries.size
    try:
        found = np.asarray(function(*numbered))
    except (ValueError, IndexError, TypeError) as error:
        raise InvalidInput(f"{what} of shape {arrays[0].shape}: {error}") from None
    if trace.samples is not None:
        if found.ndim == 0 or len(found) != trace.samples or (found != found[0] + _column(later, found.ndim - 1)).any():
            raise NotLocal("looks from one sample at another")
        found = found[0]
    for array in arrays:
        array.shared = True
    return Traced(trace, pool[found], truth=all(array.truth for array in arrays), shared=True)


def reduced(ufunc: np.ufunc, array: Traced, *, axis: Any = None, keepdims: bool = False) -> Traced:
    """Return an array folded along axes, first to last."""
    trace, entries = array.source, array.entries
    if ufunc.identity is None and 0 in entries.shape:
        raise InvalidInput(f"np.{ufunc.__name__} of nothing has no value")
    for place in sorted(array.places(axis), reverse=True):
        rows = [Traced(trace, row) for row in np.moveaxis(entries, place, 0)]
        rows = rows or [Traced(trace, np.full(np.delete(entries.shape, place), ufunc.identity, dtype=float))]
        total = reduce(partial(elementwise, trace, lambda *pair: written(trace.tape, ufunc.__name__, pair)), rows)
        entries = np.expand_dims(total.entries, place) if keepdims else total.entries
    return Traced(trace, entries)


def product_of_matrices(first: Any, second: Any) -> Any:
    """Return first @ second."""
    first, second = (side if isinstance(side, Traced) else np.asarray(side) for side in (first, second))
    shapes = first.shape, second.shape
    if not all(shapes) or shapes[0][-1] != shapes[1][-2:][0]:
        raise InvalidInput(f"arrays of shapes {shapes[0]} and {shapes[1]} have no matrix product")
    if second.ndim == 1:
        return (first * second).sum(axis=-1)
    if first.ndim == 1:
        return (first[:, None] * second).sum(axis=-2)
    return (first[..., :, :, None] * second[..., None, :, :]).sum(axis=-2)


def _column(numbers: np.ndarray, axes: int) -> np.ndarray:
    return numbers.reshape(-1, *[1] * axes)


def _plain(what: str, settings: dict[str, Any], *known: str) -> dict[str, Any]:
    for name in settings:
        if name not in known:
            raise InvalidInput(f"{what}({name}=...) has no derivative here")
    return settings


def _is_truth(value: Any) -> bool:
    return value.truth if isinstance(value, Traced) else np.asarray(value).dtype == bool


def _replaced(name: str, out: Any, found: Traced) -> Traced:
    """Return ``out`` after it took what was found; raise InvalidInput where others might see that."""
    if not isinstance(out, Traced) or out.shared or out.shape != found.shape:
        raise InvalidInput(f"np.{name} would change an array in place that others see: x = x + y is wanted for x += y")
    out.entries, out.truth = found.entries, found.truth
    return out


REDUCED = frozenset({np.add, np.multiply, np.maximum, np.minimum})
