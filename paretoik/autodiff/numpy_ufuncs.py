"""NumPy's functions of numbers (ufuncs) that can be differentiated: each as operations of a tape.

A function is one operation, whose derivative stands in ``operation_derivatives``, or is composed of others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from paretoik.autodiff.operations import UFUNCS, Op
from paretoik.autodiff.tape import Expression, Tape, as_entry, where
from paretoik.errors import InvalidInput

ELEMENTARY: dict[str, Op] = {
    **{ufunc.__name__: op for op, ufunc in UFUNCS.items() if op is not Op.POWER},
    "fabs": Op.ABSOLUTE,
}
COMPOSED: dict[str, Callable[..., Any]] = {
    "square": lambda x: x * x,
    "positive": lambda x: x,
    "reciprocal": lambda x: 1.0 / x,
    "tan": lambda x: np.sin(x) / np.cos(x),
    "arctan": lambda x: np.arctan2(x, 1.0),
    "sinh": lambda x: (np.exp(x) - np.exp(-x)) / 2,
    "cosh": lambda x: (np.exp(x) + np.exp(-x)) / 2,
    "exp2": lambda x: np.exp(x * math.log(2.0)),
    "expm1": lambda x: np.exp(x) - 1.0,
    "log1p": lambda x: np.log(x + 1.0),
    "log2": lambda x: np.log(x) / math.log(2.0),
    "log10": lambda x: np.log(x) / math.log(10.0),
    "cbrt": lambda x: np.sign(x) * np.abs(x) ** (1.0 / 3.0),
    "hypot": lambda x, y: np.sqrt(x * x + y * y),
    "deg2rad": lambda x: x * (math.pi / 180.0),
    "radians": lambda x: x * (math.pi / 180.0),
    "rad2deg": lambda x: x * (180.0 / math.pi),
    "degrees": lambda x: x * (180.0 / math.pi),
    "greater": lambda x, y: np.less(y, x),
    "greater_equal": lambda x, y: np.less_equal(y, x),
    "equal": lambda x, y: np.less_equal(x, y) * np.less_equal(y, x),
    "not_equal": lambda x, y: 1.0 - np.equal(x, y),
    "isnan": lambda x: np.not_equal(x, x),
    "isfinite": lambda x: np.less(np.abs(x), math.inf),
    "fmax": lambda x, y: where(np.isnan(x), y, where(np.isnan(y), x, np.maximum(x, y))),
    "fmin": lambda x, y: where(np.isnan(x), y, where(np.isnan(y), x, np.minimum(x, y))),
    "logical_and": lambda x, y: np.not_equal(x, 0.0) * np.not_equal(y, 0.0),
    "logical_or": lambda x, y: np.maximum(np.not_equal(x, 0.0), np.not_equal(y, 0.0)),
    "logical_not": lambda x: np.equal(x, 0.0),
    "bitwise_and": lambda x, y: x * y,  # these three only of booleans, as in NumPy
    "bitwise_or": lambda x, y: np.maximum(x, y),
    "invert": lambda x: 1.0 - x,
}
COMPARISONS = frozenset({"less", "less_equal", "greater", "greater_equal", "equal", "not_equal", "isnan", "isfinite"})
BOOLEAN = COMPARISONS | {"logical_and", "logical_or", "logical_not", "bitwise_and", "bitwise_or", "invert"}


def apply_ufunc(tape: Tape, name: str, operands: Sequence[Any]) -> Any:
    """Apply NumPy's function ``name`` to numbers and expressions on a tape; return the result.

    Raises InvalidInput, naming the function, where its derivative is not known.
    """
    arguments = [Expression(tape, as_entry(tape, value)) for value in operands]
    if name in COMPOSED:
        return COMPOSED[name](*arguments)
    if name in ("power", "float_power"):
        return _power(tape, *arguments)
    op = ELEMENTARY.get(name)
    if op is None:
        raise InvalidInput(f"np.{name} has no derivative here; those that have: {', '.join(differentiable_ufuncs())}")
    return Expression(tape, tape.apply(op, *(value.index for value in arguments)))


def differentiable_ufuncs() -> list[str]:
    """Return the names of NumPy's functions of numbers that can be differentiated."""
    return sorted({*ELEMENTARY, *COMPOSED, "power"})


def _power(tape: Tape, base: Expression, exponent: Expression, *, largest_product: int = 8) -> Any:
    """Return a power: a product for whole exponents up to ``largest_product``."""
    number = tape.values.get(exponent.index, math.nan)
    if number.is_integer() and 0 < abs(number) <= largest_product:
        result = base
        for _ in range(abs(int(number)) - 1):
            result = result * base
        return result if number > 0 else 1.0 / result
    if number == 0:
        return Expression(tape, tape.constant(1.0))
    if number == 0.5:
        return np.sqrt(base)
    return Expression(tape, tape.apply(Op.POWER, base.index, exponent.index))
