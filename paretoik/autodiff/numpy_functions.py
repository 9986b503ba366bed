"""NumPy's functions of arrays whose derivatives are known, in terms of its operators, sums and indices."""

from __future__ import annotations

import inspect
import operator
from collections.abc import Callable, Sequence
from itertools import accumulate
from typing import Any

import numpy as np

from paretoik.autodiff.tape import choose
from paretoik.autodiff.tracing import (
    Trace,
    Traced,
    elementwise,
    entries_of,
    moved,
    product_of_matrices,
    reduced,
)
from paretoik.errors import InvalidInput


def called(trace: Trace, function: Callable[..., Any], args: Any, settings: Any) -> Any:
    """Return what NumPy's function makes of its arguments; raise InvalidInput, naming it, where that is not known."""
    name = _name(function)
    known = FUNCTIONS.get(function)
    if known is None:
        others = ", ".join(sorted(_name(other) for other in FUNCTIONS))
        raise InvalidInput(f"{name} has no derivative here; those that have: {others}")
    try:
        inspect.signature(known).bind(trace, *args, **settings)
    except TypeError as error:
        raise InvalidInput(f"{name}: {error} where derivatives are taken") from None
    return known(trace, *args, **settings)


def _name(function: Callable[..., Any]) -> str:
    return f"{function.__module__.replace('numpy', 'np')}.{function.__name__}"


def _folded(ufunc: np.ufunc) -> Callable[..., Any]:
    def folded(trace: Trace, a: Traced, axis: Any = None, *, keepdims: bool = False) -> Traced:
        return reduced(ufunc, a, axis=axis, keepdims=keepdims)

    return folded


def _mean(trace: Trace, a: Traced, axis: Any = None, *, keepdims: bool = False) -> Any:
    total = reduced(np.add, a, axis=axis, keepdims=keepdims)
    return total * (max(total.entries.size, 1) / max(a.entries.size, 1))


def _variance(trace: Trace, a: Traced, axis: Any = None, *, ddof: int = 0, keepdims: bool = False) -> Any:
    away = a - _mean(trace, a, axis, keepdims=True)
    total = reduced(np.add, away * away, axis=axis, keepdims=keepdims)
    return total / (max(a.entries.size, 1) / max(total.entries.size, 1) - ddof)


def _deviation(trace: Trace, a: Traced, axis: Any = None, *, ddof: int = 0, keepdims: bool = False) -> Any:
    return np.sqrt(_variance(trace, a, axis, ddof=ddof, keepdims=keepdims))


def _reach(trace: Trace, a: Traced, axis: Any = None, *, keepdims: bool = False) -> Any:
    ends = [reduced(ufunc, a, axis=axis, keepdims=keepdims) for ufunc in (np.maximum, np.minimum)]
    return ends[0] - ends[1]


def _all(trace: Trace, a: Traced, axis: Any = None, *, keepdims: bool = False) -> Traced:
    return reduced(np.multiply, a != 0, axis=axis, keepdims=keepdims).astype(bool)


def _any(trace: Trace, a: Traced, axis: Any = None, *, keepdims: bool = False) -> Traced:
    return reduced(np.add, a != 0, axis=axis, keepdims=keepdims).astype(bool)


def _norm(trace: Trace, x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    if ord not in (None, 2, 1, np.inf) or (ord is not None and x.ndim > 1 and not isinstance(axis, int | np.integer)):
        raise InvalidInput(f"np.linalg.norm(ord={ord}) has no derivative here; ord 1, 2 and inf of vectors have")
    if ord == 1:
        return np.sum(np.abs(x), axis=axis, keepdims=keepdims)
    if ord == np.inf:
        return np.max(np.abs(x), axis=axis, keepdims=keepdims)
    return np.sqrt(np.sum(x * x, axis=axis, keepdims=keepdims))


def _where(trace: Trace, condition: Any, x: Any, y: Any, /) -> Traced:
    return elementwise(trace, choose, condition, x, y)


def _clip(trace: Trace, a: Any, a_min: Any = None, a_max: Any = None, *, min: Any = None, max: Any = None) -> Any:
    low, high = (a_min if min is None else min), (a_max if max is None else max)
    above = np.positive(a) if low is None else np.maximum(a, low)
    return above if high is None else np.minimum(above, high)


def _accumulated(join: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    def accumulated(trace: Trace, a: Traced, axis: int | None = None) -> Traced:
        if axis is None:
            a, axis = a.ravel(), -1
        (place,) = a.places(axis)
        rows = list(accumulate(np.moveaxis(a.entries, place, 0), join))
        return Traced(trace, np.stack(rows, axis=place) if rows else a.entries)

    return accumulated


def _diff(trace: Trace, a: Traced, n: int = 1, axis: int = -1) -> Traced:
    (place,) = a.places(axis)
    rows = np.moveaxis(a.entries, place, 0)
    for _ in range(n):
        rows = rows[1:] - rows[:-1]
    return Traced(trace, np.moveaxis(rows, 0, place))


def _joined(join: Callable[..., Any]) -> Callable[..., Any]:
    def joined(trace: Trace, arrays: Sequence[Any], axis: int | None = 0) -> Traced:
        parts = [array if isinstance(array, Traced) else _standing(trace, np.asarray(array)) for array in arrays]
        return moved(_name(join), lambda *numbers: join(numbers, axis=axis), *parts).copy()

    return joined


def _standing(trace: Trace, array: np.ndarray) -> Traced:
    """Return a plain array (time, ...) as one that is traced."""
    if trace.samples is not None and (array.ndim == 0 or len(array) != trace.samples):
        raise InvalidInput(f"an array of shape {array.shape} cannot be joined with one of {trace.samples} samples")
    return Traced(trace, entries_of(trace, array, max(array.ndim - 1, 0)))


def _dot(trace: Trace, a: Any, b: Any) -> Any:
    if np.ndim(a) == 0 or np.ndim(b) == 0:
        return a * b
    if np.ndim(b) > 2 and np.ndim(a) > 1:
        raise InvalidInput("np.dot of stacks of matrices has no derivative here: a @ b is wanted")
    return product_of_matrices(a, b)


def _cross(trace: Trace, a: Any, b: Any, *, axis: int = -1) -> Any:
    a, b = (side if isinstance(side, Traced) else np.asarray(side) for side in (a, b))
    if axis != -1 or a.shape[-1:] != (3,) or b.shape[-1:] != (3,):
        raise InvalidInput(f"np.cross wants vectors of 3 numbers along the last axis, got {a.shape} and {b.shape}")
    (x, y, z), (u, v, w) = ([side[..., k] for k in range(3)] for side in (a, b))
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def _einsum(trace: Trace, subscripts: str, *operands: Any, optimize: Any = False) -> Any:
    given, arrow, wanted = str(subscripts).replace(" ", "").partition("->")
    terms, letters = given.split(","), sorted(set(given) - set(".,"))
    if not arrow:
        wanted = "..." * ("..." in given) + "".join(letter for letter in letters if given.count(letter) == 1)
    order = wanted.removeprefix("...")
    inside = [term.replace("...", "") for term in terms]
    twice = any(len(set(term)) < len(term) for term in (*inside, order))
    dots = ("..." in given) == wanted.startswith("...") and "." not in order
    if len(terms) != len(operands) or twice or not dots or not set(order) <= set(letters):
        raise InvalidInput(f"np.einsum({subscripts!r}) has no derivative here; sums like '...ij,...j->...i' have")
    summed = [letter for letter in letters if letter not in order]
    found: Any = 1.0
    for term, operand in zip(terms, operands, strict=True):
        found = found * _laid_out(term, operand, [*order, *summed])
    return np.sum(found, axis=tuple(range(-len(summed), 0))) if summed else found


def _laid_out(term: str, operand: Any, order: list[str]) -> Any:
    """Return an operand of np.einsum with an axis for each letter, after those that ``...`` stands for."""
    before, dots, after = term.partition("...")
    free = np.ndim(operand) - len(before) - len(after)
    if free < 0 or (free and not dots):
        raise InvalidInput(f"np.einsum: {term!r} does not name the axes of an array of shape {np.shape(operand)}")
    named = [*before, *[None] * free, *after]
    axes = [axis for axis, letter in enumerate(named) if letter is None]
    axes += [named.index(letter) for letter in order if letter in named]
    laid = np.transpose(operand, axes)
    return laid[(..., *(slice(None) if letter in named else None for letter in order))]


def _determinant(trace: Trace, a: Traced) -> Traced:
    """By Laplace's rule, minors of the last rows first: no division, no choice of pivots."""
    if a.shape[-1:] != a.shape[-2:-1]:
        raise InvalidInput(f"np.linalg.det wants square matrices, got shape {a.shape}")
    a.places((-2, -1))
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


def _trace(diagonal: Callable[..., Any]) -> Callable[..., Any]:
    def traced(trace: Trace, a: Traced, *args: Any, **settings: Any) -> Any:
        return diagonal(a, *args, **settings).sum(axis=-1)

    return traced


def _moving(function: Callable[..., Any]) -> Callable[..., Any]:
    def moving(trace: Trace, a: Traced, *args: Any, **settings: Any) -> Traced:
        return moved(_name(function), lambda numbers: function(numbers, *args, **settings), a)

    return moving


def _filled(trace: Trace, a: Traced, fill_value: Any) -> Traced:
    return elementwise(trace, lambda _, value: value, a, fill_value)


MOVING: tuple[Callable[..., Any], ...] = (
    np.reshape,
    np.ravel,
    np.transpose,
    np.matrix_transpose,
    np.linalg.matrix_transpose,
    np.swapaxes,
    np.moveaxis,
    np.expand_dims,
    np.squeeze,
    np.flip,
    np.roll,
    np.take,
    np.repeat,
    np.diagonal,
    np.linalg.diagonal,
    np.broadcast_to,
)
FUNCTIONS: dict[Callable[..., Any], Callable[..., Any]] = {
    **{function: _moving(function) for function in MOVING},
    np.shape: lambda trace, a: a.shape,
    np.ndim: lambda trace, a: a.ndim,
    np.size: lambda trace, a: a.size,
    np.sum: _folded(np.add),
    np.prod: _folded(np.multiply),
    np.max: _folded(np.maximum),
    np.amax: _folded(np.maximum),
    np.min: _folded(np.minimum),
    np.amin: _folded(np.minimum),
    np.mean: _mean,
    np.var: _variance,
    np.std: _deviation,
    np.ptp: _reach,
    np.all: _all,
    np.any: _any,
    np.cumsum: _accumulated(operator.add),
    np.cumprod: _accumulated(operator.mul),
    np.diff: _diff,
    np.where: _where,
    np.clip: _clip,
    np.stack: _joined(np.stack),
    np.concatenate: _joined(np.concatenate),
    np.copy: lambda trace, a: a.copy(),
    np.zeros_like: lambda trace, a: _filled(trace, a, 0.0),
    np.ones_like: lambda trace, a: _filled(trace, a, 1.0),
    np.full_like: _filled,
    np.dot: _dot,
    np.cross: _cross,
    np.linalg.cross: _cross,
    np.einsum: _einsum,
    np.trace: _trace(np.diagonal),
    np.linalg.trace: _trace(np.linalg.diagonal),
    np.linalg.norm: _norm,
    np.linalg.det: _determinant,
}
