"""Arrays of expressions that NumPy code treats as arrays of numbers.

A ``TracedArray`` represents an array (time, ...). If ``samples`` is given, the time axis is hidden: the code runs once
for all samples and must not couple one sample to another. Without ``samples``, time is an axis like any other.
"""

from __future__ import annotations

import inspect
import operator
from collections.abc import Callable, Sequence
from functools import partial, reduce
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.lib.array_utils import normalize_axis_tuple
from numpy.lib.mixins import NDArrayOperatorsMixin

from paretoik.autodiff.tape import BOOLEAN, Expression, Tape, apply_ufunc, where
from paretoik.errors import InvalidInput


class NotLocal(InvalidInput):
    """The code couples one sample to another."""


class Trace:
    """A tape and its ``parameters``: inputs with known values (samples,) that differ between samples."""

    def __init__(self, samples: int | None) -> None:
        self.tape = Tape()
        self.samples = samples
        self.parameters: dict[int, np.ndarray] = {}  # numbers of each parameter, by its entry
        self._by_values: dict[bytes, Expression] = {}

    def inputs(self, *shape: int) -> TracedArray:
        """Return an array of new inputs."""
        entries = np.empty(shape, dtype=object)
        for index in np.ndindex(shape):
            entries[index] = self.tape.input()
        return TracedArray(self, entries, shared=True)

    def parameter(self, values: np.ndarray) -> Expression:
        """Return the input with these values (samples,)."""
        key = np.ascontiguousarray(values, dtype=float).tobytes()
        if key not in self._by_values:
            self._by_values[key] = self.tape.input()
            self.parameters[self._by_values[key].index] = np.array(values, dtype=float)
        return self._by_values[key]


class TracedArray(NDArrayOperatorsMixin):
    """An array of expressions and numbers.

    entries: array of objects without the hidden time axis
    is_boolean: whether it represents True and False
    shared: whether the array may share memory or is read-only, so that it cannot be changed in place
    """

    def __init__(self, trace: Trace, entries: Any, *, is_boolean: bool = False, shared: bool = False) -> None:
        self.source = trace  # the name is not ``trace``, which is a method of NumPy's arrays
        self.entries = np.asarray(entries, dtype=object)
        self.is_boolean = is_boolean
        self.shared = shared

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the represented array, including time."""
        hidden = () if self.source.samples is None else (self.source.samples,)
        return (*hidden, *self.entries.shape)

    @property
    def ndim(self) -> int:
        """Number of axes, including time."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of elements, including time."""
        return int(np.prod(self.shape))

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the represented array: real numbers or booleans."""
        return np.dtype(bool if self.is_boolean else float)

    @property
    def T(self) -> TracedArray:  # noqa: N802  NumPy's name
        """The array with its axes in reverse order."""
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
            raise InvalidInput(f"astype({np.dtype(dtype)}) has no derivative here; use float or bool")
        return TracedArray(self.source, self.entries, shared=not copy)

    def copy(self) -> TracedArray:
        """Return a copy."""
        return TracedArray(self.source, self.entries, is_boolean=self.is_boolean)

    def __getattr__(self, name: str) -> Any:
        """Return NumPy's function of that name as a method; raise InvalidInput if NumPy has none."""
        if name.startswith("__"):  # Python and NumPy look for special methods
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
        raise InvalidInput("an `if` cannot depend on a number whose derivatives are taken; use np.where")

    def __array__(self, *args: Any, **settings: Any) -> np.ndarray:
        raise InvalidInput(
            "an array whose derivatives are taken cannot become plain numbers; use only NumPy functions, and np.stack "
            "instead of np.array"
        )

    def _refuse_number(self, *args: Any) -> Any:
        raise InvalidInput(
            "an array whose derivatives are taken cannot become a plain number; use only NumPy functions"
        )

    __float__ = __int__ = __index__ = __complex__ = __round__ = __trunc__ = _refuse_number

    def __iter__(self) -> Any:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, key: Any) -> TracedArray:
        if any(isinstance(part, TracedArray) for part in (key if isinstance(key, tuple) else (key,))):
            raise InvalidInput("an index cannot depend on the motion where derivatives are taken; use np.where")
        return rearrange("indexing", lambda numbers: numbers[key], self)

    def __setitem__(self, key: Any, value: Any) -> None:
        raise InvalidInput("x[...] = y is not possible where derivatives are taken; use np.where or np.stack")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **settings: Any) -> Any:
        """Apply a ufunc element by element, or reduce by add, multiply, maximum or minimum."""
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
            if name == "add" and all(
                value.is_boolean if isinstance(value, TracedArray) else np.asarray(value).dtype == bool
                for value in inputs
            ):
                name = "logical_or"
            result = apply_elementwise(self.source, lambda *parts: apply_ufunc(self.source.tape, name, parts), *inputs)
            result.is_boolean = name in BOOLEAN
        if out is None:
            return result
        # the result is assigned to ``out``, which must share its memory with no other array
        if not isinstance(out, TracedArray) or out.shared or out.shape != result.shape:
            raise InvalidInput(
                f"np.{name} would change an array in place that shares memory; use x = x + y instead of x += y"
            )
        out.entries, out.is_boolean = result.entries, result.is_boolean
        return out

    def __array_function__(self, function: Callable[..., Any], types: Any, args: Any, settings: Any) -> Any:
        """Apply a NumPy function of arrays; raise InvalidInput, naming it, if its derivative is not known."""
        return apply_function(self.source, function, args, settings)

    def entry_axes(self, axes: Any) -> tuple[int, ...]:
        """Return axes (None: all) as axes of ``entries``; raise NotLocal if the time axis is one of them."""
        try:
            normalized = normalize_axis_tuple(range(self.ndim) if axes is None else axes, self.ndim)
        except (TypeError, ValueError) as error:
            raise InvalidInput(f"axis {axes}: {error}") from None
        if self.source.samples is None:
            return normalized
        if 0 in normalized:
            raise NotLocal("uses the time axis")
        return tuple(axis - 1 for axis in normalized)


def apply_elementwise(trace: Trace, function: Callable[..., Any], *inputs: Any) -> TracedArray:
    """Return the result of a function of numbers for each element of arrays, broadcast as in NumPy.

    Raises InvalidInput if the shapes do not match.
    """
    axes = {value.entries.ndim for value in inputs if isinstance(value, TracedArray)}
    try:
        if trace.samples is not None and len(axes) > 1:
            raise ValueError("the time axis must not meet another axis")
        parts = np.broadcast_arrays(*(entries_of(trace, value, max(axes)) for value in inputs))
    except InvalidInput:
        raise
    except ValueError:
        shapes = " and ".join(
            str(value.shape if isinstance(value, TracedArray) else np.shape(value)) for value in inputs
        )
        raise InvalidInput(f"arrays of shapes {shapes} do not broadcast with time as the first axis") from None
    result = np.empty(parts[0].shape, dtype=object)
    for index in np.ndindex(result.shape):
        result[index] = function(*(part[index] for part in parts))
    return TracedArray(trace, result)


def entries_of(trace: Trace, value: Any, axes: int) -> np.ndarray:
    """Return the entries of an array, traced or plain; plain arrays with a time axis become inputs.

    ``axes`` is the number of axes without time. Raises ValueError if the time axis does not match the samples, and
    InvalidInput for values that are not real numbers.
    """
    if isinstance(value, TracedArray):
        return value.entries
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        got = array.dtype if array.ndim else repr(value)
        raise InvalidInput(f"values must be real numbers where derivatives are taken, got {got}")
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
    """Return the result of a function that only moves elements; it is called with their indices.

    Raises NotLocal if a sample gets elements of another, and InvalidInput, naming ``name``, if NumPy raises.
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
        is_per_sample = result.ndim > 0 and len(result) == trace.samples
        if not is_per_sample or (result != result[0] + _as_column(sample_offsets, result.ndim - 1)).any():
            raise NotLocal("combines several samples")
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


REDUCIBLE = frozenset({np.add, np.multiply, np.maximum, np.minimum})


# Differentiable NumPy functions of arrays, in terms of operators, sums and indices.

FUNCTIONS: dict[Callable[..., Any], Callable[..., Any]] = {}


def implements(*functions: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Register the decorated function, of a trace and arguments, for NumPy's ``functions``."""

    def register(implementation: Callable[..., Any]) -> Callable[..., Any]:
        FUNCTIONS.update(dict.fromkeys(functions, implementation))
        return implementation

    return register


def apply_function(trace: Trace, function: Callable[..., Any], args: Any, settings: Any) -> Any:
    """Return the result of NumPy's function; raise InvalidInput, naming it, if its derivative is not known."""
    name = _name(function)
    traceable = FUNCTIONS.get(function)
    if traceable is None:
        others = ", ".join(sorted(_name(other) for other in FUNCTIONS))
        raise InvalidInput(f"{name} has no derivative here; functions that have one: {others}")
    try:
        inspect.signature(traceable).bind(trace, *args, **settings)
    except TypeError as error:
        raise InvalidInput(f"{name} must get only arguments that have a derivative here: {error}") from None
    return traceable(trace, *args, **settings)


def reduce_ufunc(ufunc: np.ufunc, array: TracedArray, *, axis: Any = None, keepdims: bool = False) -> TracedArray:
    """Return an array reduced along axes, its elements in order."""
    trace, entries = array.source, array.entries
    if ufunc.identity is None and 0 in entries.shape:
        raise InvalidInput(f"np.{ufunc.__name__} of an empty array has no value")
    for k in sorted(array.entry_axes(axis), reverse=True):
        rows = [TracedArray(trace, row) for row in np.moveaxis(entries, k, 0)]
        rows = rows or [TracedArray(trace, np.full(np.delete(entries.shape, k), ufunc.identity, dtype=float))]
        total = reduce(
            partial(apply_elementwise, trace, lambda *pair: apply_ufunc(trace.tape, ufunc.__name__, pair)), rows
        )
        entries = np.expand_dims(total.entries, k) if keepdims else total.entries
    return TracedArray(trace, entries)


def matmul(first: Any, second: Any) -> Any:
    """Return first @ second."""
    first, second = (side if isinstance(side, TracedArray) else np.asarray(side) for side in (first, second))
    shapes = first.shape, second.shape
    if not all(shapes) or shapes[0][-1] != shapes[1][-2:][0]:
        raise InvalidInput(f"arrays of shapes {shapes[0]} and {shapes[1]} have no matrix product")
    if second.ndim == 1:
        return (first * second).sum(axis=-1)
    if first.ndim == 1:
        return (first[:, None] * second).sum(axis=-2)
    return (first[..., :, :, None] * second[..., None, :, :]).sum(axis=-2)


def _name(function: Callable[..., Any]) -> str:
    return f"{function.__module__.replace('numpy', 'np')}.{function.__name__}"


def _reduction(
    ufunc: np.ufunc, trace: Trace, a: TracedArray, axis: Any = None, *, keepdims: bool = False
) -> TracedArray:
    return reduce_ufunc(ufunc, a, axis=axis, keepdims=keepdims)


@implements(np.mean)
def _mean(trace: Trace, a: TracedArray, axis: Any = None, *, keepdims: bool = False) -> Any:
    total = reduce_ufunc(np.add, a, axis=axis, keepdims=keepdims)
    return total * (max(total.entries.size, 1) / max(a.entries.size, 1))


@implements(np.var)
def _variance(trace: Trace, a: TracedArray, axis: Any = None, *, ddof: int = 0, keepdims: bool = False) -> Any:
    deviation = a - _mean(trace, a, axis, keepdims=True)
    total = reduce_ufunc(np.add, deviation * deviation, axis=axis, keepdims=keepdims)
    return total / (max(a.entries.size, 1) / max(total.entries.size, 1) - ddof)


@implements(np.std)
def _deviation(trace: Trace, a: TracedArray, axis: Any = None, *, ddof: int = 0, keepdims: bool = False) -> Any:
    return np.sqrt(_variance(trace, a, axis, ddof=ddof, keepdims=keepdims))


@implements(np.ptp)
def _peak_to_peak(trace: Trace, a: TracedArray, axis: Any = None, *, keepdims: bool = False) -> Any:
    ends = [reduce_ufunc(ufunc, a, axis=axis, keepdims=keepdims) for ufunc in (np.maximum, np.minimum)]
    return ends[0] - ends[1]


def _truth(ufunc: np.ufunc, trace: Trace, a: TracedArray, axis: Any = None, *, keepdims: bool = False) -> TracedArray:
    return reduce_ufunc(ufunc, a != 0, axis=axis, keepdims=keepdims).astype(bool)


@implements(np.linalg.norm)
def _norm(trace: Trace, x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    if ord not in (None, 2, 1, np.inf) or (ord is not None and x.ndim > 1 and not isinstance(axis, int | np.integer)):
        raise InvalidInput(f"np.linalg.norm(ord={ord}) has no derivative here; ord 1, 2 and inf of vectors have")
    if ord == 1:
        return np.sum(np.abs(x), axis=axis, keepdims=keepdims)
    if ord == np.inf:
        return np.max(np.abs(x), axis=axis, keepdims=keepdims)
    return np.sqrt(np.sum(x * x, axis=axis, keepdims=keepdims))


@implements(np.clip)
def _clip(trace: Trace, a: Any, a_min: Any = None, a_max: Any = None, *, min: Any = None, max: Any = None) -> Any:
    low, high = (a_min if min is None else min), (a_max if max is None else max)
    above = np.positive(a) if low is None else np.maximum(a, low)
    return above if high is None else np.minimum(above, high)


def _accumulation(
    join: Callable[[Any, Any], Any], trace: Trace, a: TracedArray, axis: int | None = None
) -> TracedArray:
    if axis is None:
        a, axis = a.ravel(), -1
    (k,) = a.entry_axes(axis)
    rows = list(accumulate(np.moveaxis(a.entries, k, 0), join))
    return TracedArray(trace, np.stack(rows, axis=k) if rows else a.entries)


@implements(np.diff)
def _diff(trace: Trace, a: TracedArray, n: int = 1, axis: int = -1) -> TracedArray:
    (k,) = a.entry_axes(axis)
    rows = np.moveaxis(a.entries, k, 0)
    for _ in range(n):
        rows = rows[1:] - rows[:-1]
    return TracedArray(trace, np.moveaxis(rows, 0, k))


def _joining(join: Callable[..., Any], trace: Trace, arrays: Sequence[Any], axis: int | None = 0) -> TracedArray:
    parts = []
    for array in arrays:
        if isinstance(array, TracedArray):
            parts.append(array)
            continue
        plain, samples = np.asarray(array), trace.samples  # (time, ...)
        if samples is not None and (plain.ndim == 0 or len(plain) != samples):
            raise InvalidInput(f"an array of shape {plain.shape} cannot be joined with one of {samples} samples")
        parts.append(TracedArray(trace, entries_of(trace, plain, max(plain.ndim - 1, 0))))
    return rearrange(_name(join), lambda *numbers: join(numbers, axis=axis), *parts).copy()


@implements(np.dot)
def _dot(trace: Trace, a: Any, b: Any) -> Any:
    if np.ndim(a) == 0 or np.ndim(b) == 0:
        return a * b
    if np.ndim(b) > 2 and np.ndim(a) > 1:
        raise InvalidInput("np.dot of stacks of matrices has no derivative here; use a @ b")
    return matmul(a, b)


@implements(np.cross, np.linalg.cross)
def _cross(trace: Trace, a: Any, b: Any, *, axis: int = -1) -> Any:
    a, b = (side if isinstance(side, TracedArray) else np.asarray(side) for side in (a, b))
    if axis != -1 or a.shape[-1:] != (3,) or b.shape[-1:] != (3,):
        raise InvalidInput(f"np.cross must get vectors of 3 numbers along the last axis, got {a.shape} and {b.shape}")
    (x, y, z), (u, v, w) = ([side[..., k] for k in range(3)] for side in (a, b))
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


@implements(np.einsum)
def _einsum(trace: Trace, subscripts: str, *operands: Any, optimize: Any = False) -> Any:
    inputs, arrow, output = str(subscripts).replace(" ", "").partition("->")
    terms, letters = inputs.split(","), sorted(set(inputs) - set(".,"))
    if not arrow:
        output = "..." * ("..." in inputs) + "".join(letter for letter in letters if inputs.count(letter) == 1)
    order = output.removeprefix("...")
    inside = [term.replace("...", "") for term in terms]
    repeats = any(len(set(term)) < len(term) for term in (*inside, order))
    valid_dots = ("..." in inputs) == output.startswith("...") and "." not in order
    if len(terms) != len(operands) or repeats or not valid_dots or not set(order) <= set(letters):
        raise InvalidInput(f"np.einsum({subscripts!r}) has no derivative here; sums like '...ij,...j->...i' have")
    summed = [letter for letter in letters if letter not in order]
    total: Any = 1.0
    for term, operand in zip(terms, operands, strict=True):
        total = total * _align_axes(term, operand, [*order, *summed])
    return np.sum(total, axis=tuple(range(-len(summed), 0))) if summed else total


def _align_axes(term: str, operand: Any, order: list[str]) -> Any:
    """Return an operand of np.einsum with one axis per letter, after the axes of ``...``."""
    before, dots, after = term.partition("...")
    free = np.ndim(operand) - len(before) - len(after)
    if free < 0 or (free and not dots):
        raise InvalidInput(f"np.einsum: {term!r} does not name the axes of an array of shape {np.shape(operand)}")
    named = [*before, *[None] * free, *after]
    axes = [axis for axis, letter in enumerate(named) if letter is None]
    axes += [named.index(letter) for letter in order if letter in named]
    aligned = np.transpose(operand, axes)
    return aligned[(..., *(slice(None) if letter in named else None for letter in order))]


@implements(np.linalg.det)
def _determinant(trace: Trace, a: TracedArray) -> TracedArray:
    """Return the determinant by Laplace's expansion, from the last row up, without division or pivoting."""
    if a.shape[-1:] != a.shape[-2:-1]:
        raise InvalidInput(f"np.linalg.det must get square matrices, got shape {a.shape}")
    a.entry_axes((-2, -1))
    size = a.entries.shape[-1]
    minors: dict[tuple[int, ...], Any] = {(): np.asarray(1.0, dtype=object)}
    for row in reversed(range(size)):
        larger: dict[tuple[int, ...], Any] = {}
        for columns, minor in minors.items():
            for j in set(range(size)) - set(columns):
                chosen = tuple(sorted((*columns, j)))
                term = a.entries[..., row, j] * minor * (-1.0) ** chosen.index(j)
                larger[chosen] = larger[chosen] + term if chosen in larger else term
        minors = larger
    return TracedArray(trace, minors[tuple(range(size))])


def _trace(diagonal: Callable[..., Any], trace: Trace, a: TracedArray, *args: Any, **settings: Any) -> Any:
    return diagonal(a, *args, **settings).sum(axis=-1)


def _rearranging(
    function: Callable[..., Any], trace: Trace, a: TracedArray, *args: Any, **settings: Any
) -> TracedArray:
    return rearrange(_name(function), lambda numbers: function(numbers, *args, **settings), a)


@implements(np.full_like)
def _full(trace: Trace, a: TracedArray, fill_value: Any) -> TracedArray:
    return apply_elementwise(trace, lambda _, value: value, a, fill_value)


for _function in (
    *(np.reshape, np.ravel, np.transpose, np.matrix_transpose, np.linalg.matrix_transpose, np.swapaxes, np.moveaxis),
    *(np.expand_dims, np.squeeze, np.broadcast_to, np.flip, np.roll, np.take, np.repeat),
    *(np.diagonal, np.linalg.diagonal),
):
    FUNCTIONS[_function] = partial(_rearranging, _function)
FUNCTIONS |= {
    np.shape: lambda trace, a: a.shape,
    np.ndim: lambda trace, a: a.ndim,
    np.size: lambda trace, a: a.size,
    np.sum: partial(_reduction, np.add),
    np.prod: partial(_reduction, np.multiply),
    np.max: partial(_reduction, np.maximum),
    np.amax: partial(_reduction, np.maximum),
    np.min: partial(_reduction, np.minimum),
    np.amin: partial(_reduction, np.minimum),
    np.all: partial(_truth, np.multiply),
    np.any: partial(_truth, np.add),
    np.cumsum: partial(_accumulation, operator.add),
    np.cumprod: partial(_accumulation, operator.mul),
    np.where: lambda trace, condition, x, y, /: apply_elementwise(trace, where, condition, x, y),
    np.stack: partial(_joining, np.stack),
    np.concatenate: partial(_joining, np.concatenate),
    np.copy: lambda trace, a: a.copy(),
    np.zeros_like: lambda trace, a: _full(trace, a, 0.0),
    np.ones_like: lambda trace, a: _full(trace, a, 1.0),
    np.trace: partial(_trace, np.diagonal),
    np.linalg.trace: partial(_trace, np.linalg.diagonal),
}
