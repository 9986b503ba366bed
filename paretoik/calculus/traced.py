"""Arrays of expressions that NumPy code takes for arrays of numbers.

A ``Traced`` array stands for an array (time, ...). Where ``samples`` is given, the time axis is hidden: the code runs
once for all samples, and may not look from one sample at another. Where it is None, time is an axis like any other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from paretoik.calculus.expressions import Expression, Tape, choose, written
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
        return Traced(self, entries)

    def varying(self, values: np.ndarray) -> Expression:
        """Return the input that takes these numbers (samples,) at the samples."""
        key = np.ascontiguousarray(values, dtype=float).tobytes()
        if key not in self._known:
            self._known[key] = self.tape.input()
            self.data[self._known[key].index] = np.array(values, dtype=float)
        return self._known[key]


class Traced(NDArrayOperatorsMixin):
    """An array of expressions and numbers; ``entries`` is an array of objects without the hidden time axis."""

    def __init__(self, trace: Trace, entries: Any) -> None:
        self.trace = trace
        self.entries = np.asarray(entries, dtype=object)

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape that the array stands for, time included."""
        hidden = () if self.trace.samples is None else (self.trace.samples,)
        return (*hidden, *self.entries.shape)

    @property
    def ndim(self) -> int:
        """Number of axes, time included."""
        return len(self.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """What the array stands for: real numbers."""
        return np.dtype(float)

    def __len__(self) -> int:
        return self.shape[0]

    def __bool__(self) -> bool:
        raise InvalidInput("a comparison cannot decide an `if` where derivatives are taken: np.where is wanted")

    def __array__(self, *args: Any, **settings: Any) -> np.ndarray:
        raise InvalidInput("plain numbers were asked of an array that derivatives are taken of: NumPy functions only")

    def __iter__(self) -> Any:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, key: Any) -> Traced:
        wanted = key if isinstance(key, tuple) else (key,)
        if any(isinstance(part, Traced) for part in wanted):
            raise InvalidInput("an index cannot depend on the motion where derivatives are taken: np.where is wanted")
        if self.trace.samples is None:
            return Traced(self.trace, self.entries[key])
        return Traced(self.trace, self.entries[self._without_time(wanted)])

    def _without_time(self, wanted: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return an index without its time part, which must take all samples as they are."""
        if Ellipsis not in wanted:
            wanted = (*wanted, Ellipsis)
        if wanted[0] is Ellipsis:
            taken = sum(part is not None for part in wanted) - 1
            if taken <= self.entries.ndim:
                return wanted
            wanted = wanted[1:]
        if not (isinstance(wanted[0], slice) and wanted[0] == slice(None)):
            raise NotLocal("looks at single samples")
        return wanted[1:]

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **settings: Any) -> Any:
        """Write a NumPy function of numbers, element by element, or a sum, product, maximum or minimum of many."""
        if method == "reduce" and ufunc.__name__ in REDUCED:
            return REDUCED[ufunc.__name__](self, settings.get("axis", 0), settings.get("keepdims", False))
        if method != "__call__" or settings:
            raise InvalidInput(f"np.{ufunc.__name__}.{method} has no derivative here")
        if ufunc.__name__ == "matmul":
            return _matmul(self.trace, *inputs)
        return elementwise(self.trace, lambda *parts: _written(ufunc.__name__, parts), *inputs)

    def __array_function__(self, function: Callable[..., Any], types: Any, args: Any, settings: Any) -> Any:
        """Do what NumPy's function of arrays does, if its derivative is known.

        Raises InvalidInput, naming the function, where it is not.
        """
        known = FUNCTIONS.get(function.__name__)
        if known is None:
            raise InvalidInput(
                f"np.{function.__name__} has no derivative here; those that have: {', '.join(FUNCTIONS)}"
            )
        return known(self.trace, *args, **settings)

    def sum(self, axis: Any = None, keepdims: bool = False) -> Traced:
        """Return the sum over axes."""
        return reduced(self, axis, keepdims, lambda a, b: a + b)

    def prod(self, axis: Any = None, keepdims: bool = False) -> Traced:
        """Return the product over axes."""
        return reduced(self, axis, keepdims, lambda a, b: a * b)

    def max(self, axis: Any = None, keepdims: bool = False) -> Traced:
        """Return the largest over axes."""
        return reduced(self, axis, keepdims, lambda a, b: _written("maximum", (a, b)))

    def min(self, axis: Any = None, keepdims: bool = False) -> Traced:
        """Return the least over axes."""
        return reduced(self, axis, keepdims, lambda a, b: _written("minimum", (a, b)))

    def mean(self, axis: Any = None, keepdims: bool = False) -> Traced:
        """Return the mean over axes."""
        total = self.sum(axis, keepdims)
        return total * (max(total.entries.size, 1) / max(self.entries.size, 1))

    def swapaxes(self, first: int, second: int) -> Traced:
        """Return the array with two axes exchanged."""
        return Traced(self.trace, self.entries.swapaxes(*self.places((first, second))))

    def places(self, axes: Any) -> tuple[int, ...]:
        """Return axes (None: all) as axes of ``entries``; raise NotLocal where the hidden one is among them."""
        hidden = self.trace.samples is not None
        if axes is None:
            axes = tuple(range(self.ndim))
        found = tuple(axis % self.ndim - hidden for axis in (axes if isinstance(axes, Sequence) else (axes,)))
        if any(place < 0 for place in found):
            raise NotLocal("looks along time")
        return found


def elementwise(trace: Trace, function: Callable[..., Any], *inputs: Any) -> Traced:
    """Return a function of numbers applied to arrays element by element, broadcast as NumPy does."""
    most = max((value.entries.ndim for value in inputs if isinstance(value, Traced)), default=0)
    parts = np.broadcast_arrays(*(entries_of(trace, value, most) for value in inputs))
    found = np.empty(parts[0].shape, dtype=object)
    for place in np.ndindex(found.shape):
        found[place] = function(*(part[place] for part in parts))
    return Traced(trace, found)


def entries_of(trace: Trace, value: Any, axes: int | None = None) -> np.ndarray:
    """Return the entries of an array, traced or plain; plain ones with a time axis become inputs.

    ``axes`` is the number of axes without time; None is that of the array itself.
    """
    if isinstance(value, Traced):
        return value.entries
    array = np.asarray(value)
    if array.dtype == object or trace.samples is None or axes is None or array.ndim <= axes:
        return np.asarray(array, dtype=object)
    if array.ndim > axes + 1 or len(array) not in (1, trace.samples):
        raise InvalidInput(f"an array of shape {array.shape} meets one of {trace.samples} samples and {axes} axes more")
    if len(array) == 1:
        return np.asarray(array[0], dtype=object)
    found = np.empty(array.shape[1:], dtype=object)
    for place in np.ndindex(found.shape):
        found[place] = trace.varying(array[(slice(None), *place)])
    return found


def reduced(array: Traced, axes: Any, keepdims: bool, join: Callable[[Any, Any], Any]) -> Traced:
    """Return an array folded along axes, first to last."""
    entries = array.entries
    for place in sorted(array.places(axes), reverse=True):
        rows = np.moveaxis(entries, place, 0)
        total = rows[0]
        for row in rows[1:]:
            total = elementwise(array.trace, join, Traced(array.trace, total), Traced(array.trace, row)).entries
        entries = np.expand_dims(total, place) if keepdims else np.asarray(total, dtype=object)
    return Traced(array.trace, entries)


def _written(name: str, parts: Sequence[Any]) -> Any:
    if any(isinstance(part, Expression) for part in parts):
        return written(name, parts)
    return getattr(np, name)(*(np.asarray(part, dtype=float) for part in parts))


def _matmul(trace: Trace, first: Any, second: Any) -> Traced:
    return Traced(trace, np.matmul(entries_of(trace, first), entries_of(trace, second)))


def _norm(trace: Trace, x: Traced, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    if ord not in (None, 2, 1, np.inf) or (ord is not None and isinstance(axis, Sequence)):
        raise InvalidInput(f"np.linalg.norm(ord={ord}) has no derivative here; ord 1, 2 and inf of vectors have")
    absolute: Any = abs(x)
    if ord == 1:
        return absolute.sum(axis, keepdims)
    if ord == np.inf:
        return absolute.max(axis, keepdims)
    return np.sqrt((x * x).sum(axis, keepdims))


def _where(trace: Trace, condition: Any, first: Any, second: Any) -> Traced:
    return elementwise(trace, choose, condition, first, second)


def _clip(trace: Trace, a: Any, a_min: Any = None, a_max: Any = None, **settings: Any) -> Any:
    low, high = settings.get("min", a_min), settings.get("max", a_max)
    a = a if low is None else np.maximum(a, low)
    return a if high is None else np.minimum(a, high)


def _joined(join: Callable[..., Any]) -> Callable[..., Any]:
    def joined(trace: Trace, arrays: Sequence[Any], axis: int = 0) -> Traced:
        traced = next(array for array in arrays if isinstance(array, Traced))
        ndim = traced.ndim + (join is np.stack)
        place = axis % ndim - (trace.samples is not None)
        if place < 0:
            raise NotLocal("joins along time")
        parts = [entries_of(trace, array, traced.entries.ndim) for array in arrays]
        return Traced(trace, join(parts, axis=place))

    return joined


def _cross(trace: Trace, a: Any, b: Any) -> Traced:
    (x, y, z), (u, v, w) = (np.moveaxis(entries_of(trace, side), -1, 0) for side in (a, b))
    return Traced(trace, np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1))


def _einsum(trace: Trace, subscripts: str, *operands: Any, **settings: Any) -> Traced:
    if trace.samples is not None and "..." not in subscripts:
        raise NotLocal("names the time axis")
    return Traced(trace, np.einsum(subscripts, *(entries_of(trace, part) for part in operands)))


def _determinant(trace: Trace, a: Traced) -> Traced:
    """By Laplace's rule, minors of the last rows first: no division, no choice of pivots."""
    size = a.entries.shape[-1]
    minors: dict[tuple[int, ...], Any] = {(): np.asarray(1.0, dtype=object)}
    for row in reversed(range(size)):
        grown: dict[tuple[int, ...], Any] = {}
        for columns, minor in minors.items():
            for j in set(range(size)) - set(columns):
                chosen = tuple(sorted((*columns, j)))
                term = a.entries[..., row, j] * minor * (-1.0) ** chosen.index(j)
                grown[chosen] = grown[chosen] + term if chosen in grown else term
        minors = grown
    return Traced(trace, minors[tuple(range(size))])


def _diff(trace: Trace, a: Traced, n: int = 1, axis: int = -1) -> Traced:
    rows = np.moveaxis(a.entries, a.places(axis)[0], 0)
    for _ in range(n):
        rows = rows[1:] - rows[:-1]
    return Traced(trace, np.moveaxis(rows, 0, a.places(axis)[0]))


REDUCED: dict[str, Callable[..., Any]] = {
    "add": Traced.sum,
    "multiply": Traced.prod,
    "maximum": Traced.max,
    "minimum": Traced.min,
}
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sum": lambda trace, a, axis=None, keepdims=False: a.sum(axis, keepdims),
    "prod": lambda trace, a, axis=None, keepdims=False: a.prod(axis, keepdims),
    "mean": lambda trace, a, axis=None, keepdims=False: a.mean(axis, keepdims),
    "max": lambda trace, a, axis=None, keepdims=False: a.max(axis, keepdims),
    "min": lambda trace, a, axis=None, keepdims=False: a.min(axis, keepdims),
    "amax": lambda trace, a, axis=None, keepdims=False: a.max(axis, keepdims),
    "amin": lambda trace, a, axis=None, keepdims=False: a.min(axis, keepdims),
    "norm": _norm,
    "where": _where,
    "clip": _clip,
    "stack": _joined(np.stack),
    "concatenate": _joined(np.concatenate),
    "dot": lambda trace, a, b: _matmul(trace, a, b),
    "cross": _cross,
    "einsum": _einsum,
    "det": _determinant,
    "diff": _diff,
    "swapaxes": lambda trace, a, first, second: a.swapaxes(first, second),
    "zeros_like": lambda trace, a: Traced(trace, np.zeros(a.entries.shape, dtype=object)),
    "ones_like": lambda trace, a: Traced(trace, np.ones(a.entries.shape, dtype=object)),
}
