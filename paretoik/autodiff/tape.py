"""A tape: the operations of NumPy code in a computable order.

Equal expressions are one entry, constants are folded, and products and sums with 0 and 1 are simplified. An
``Expression`` is an entry of a tape that behaves like a number: Python's operators and NumPy's functions of numbers
extend the tape instead of computing.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any, TypeAlias

import numpy as np

from paretoik.autodiff.opcodes import COMMUTATIVE, NO_OPERAND, UFUNCS, Op, compute
from paretoik.errors import InvalidInput
from paretoik.inputs import shown

Entry: TypeAlias = tuple[Op, int, int, int]


class Tape:
    """Operations in order; entry i uses only entries before it."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self.values: dict[int, float] = {}  # values of constants
        self.inputs: list[int] = []
        self._indices: dict[Entry, int] = {}
        self._constants: dict[float, int] = {}

    def input(self) -> Expression:
        """Return a new input."""
        self.entries.append((Op.INPUT, len(self.inputs), NO_OPERAND, NO_OPERAND))
        self.inputs.append(len(self.entries) - 1)
        return Expression(self, self.inputs[-1])

    def constant(self, value: float) -> int:
        """Return the entry of a constant."""
        value = float(value) + 0.0
        if value not in self._constants:
            self.entries.append((Op.CONSTANT, len(self._constants), NO_OPERAND, NO_OPERAND))
            self._constants[value] = len(self.entries) - 1
            self.values[len(self.entries) - 1] = value
        return self._constants[value]

    def apply(self, op: Op, first: int, second: int = NO_OPERAND, third: int = NO_OPERAND) -> int:
        """Return the entry of an operation: existing, simpler, or new."""
        values = self.values
        if first in values and (second == NO_OPERAND or second in values) and (third == NO_OPERAND or third in values):
            return self.constant(compute(op, *(values[i] for i in (first, second, third) if i != NO_OPERAND)))
        simpler = self._simplify(op, first, second, third)
        if simpler is not None:
            return simpler
        if op in COMMUTATIVE and second < first:
            first, second = second, first
        entry = (op, first, second, third)
        index = self._indices.get(entry)
        if index is None:
            index = len(self.entries)
            self.entries.append(entry)
            self._indices[entry] = index
        return index

    def _simplify(self, op: Op, first: int, second: int, third: int) -> int | None:
        if op is Op.MULTIPLY or (op is Op.MASKED_MULTIPLY and (first in self.values or second in self.values)):
            for one, other in ((first, second), (second, first)):
                value = self.values.get(one)
                if value == 0.0:
                    return one
                if value == 1.0:
                    return other
                if value == -1.0:
                    return self.apply(Op.NEGATE, other)
                if first == second and self.entries[one][0] is Op.SQUARE_ROOT:
                    return self.entries[one][1]
                if first == second and self.entries[one][0] is Op.ABSOLUTE:
                    return self.apply(Op.MULTIPLY, self.entries[one][1], self.entries[one][1])
                if self.entries[one][0] is Op.NEGATE:
                    return self.apply(Op.NEGATE, self.apply(Op.MULTIPLY, self.entries[one][1], other))
            return None
        if op is Op.ADD or op is Op.SUBTRACT:
            if self.values.get(second) == 0.0:
                return first
            if self.values.get(first) == 0.0:
                return second if op is Op.ADD else self.apply(Op.NEGATE, second)
            if op is Op.SUBTRACT and first == second:
                return self.constant(0.0)
            if self.entries[second][0] is Op.NEGATE:
                return self.apply(Op.SUBTRACT if op is Op.ADD else Op.ADD, first, self.entries[second][1])
            if op is Op.ADD and self.entries[first][0] is Op.NEGATE:
                return self.apply(Op.SUBTRACT, second, self.entries[first][1])
            return None
        if op is Op.DIVIDE:
            if self.values.get(first) == 0.0:
                return first
            if second in self.values and self.values[second] != 0.0:
                return self.apply(Op.MULTIPLY, first, self.constant(1.0 / self.values[second]))
        if op is Op.NEGATE and self.entries[first][0] is Op.NEGATE:
            return self.entries[first][1]
        if op is Op.WHERE:
            if second == third:
                return second
            if first in self.values:
                return second if self.values[first] else third
            # a choice by comparison that equals a maximum, minimum or absolute value; else None
            op, low, high, _ = self.entries[first]
            if op not in (Op.LESS, Op.LESS_EQUAL):
                return None
            if (second, third) in ((low, high), (high, low)):
                return self.apply(Op.MINIMUM if second == low else Op.MAXIMUM, low, high)
            for zero, value, positive in ((low, high, second), (high, low, third)):
                negative = third if positive == second else second
                if self.values.get(zero) == 0.0 and positive == value and negative == self.apply(Op.NEGATE, value):
                    return self.apply(Op.ABSOLUTE, value)
            return None
        if op in (Op.MAXIMUM, Op.MINIMUM) and first == second:
            return first
        return None


def _operator(op: Op, *, reflected: bool = False) -> Callable[[Expression, Any], Any]:
    """Return the method of an operation; the expression is its first operand, or second if ``reflected``."""

    def operate(self: Expression, other: Any) -> Any:
        if isinstance(other, np.ndarray) and other.ndim:
            return NotImplemented  # NumPy then applies the operator element by element
        first, second = self.index, as_entry(self.tape, other)
        if reflected:
            first, second = second, first
        return Expression(self.tape, self.tape.apply(op, first, second))

    return operate


class Expression:
    """An entry of a tape that NumPy's functions treat as a number.

    Raises InvalidInput if code needs its value, as ``if``, ``float`` and unsupported functions do.
    """

    __slots__ = ("index", "tape")

    def __init__(self, tape: Tape, index: int) -> None:
        self.tape = tape
        self.index = index

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **settings: Any) -> Any:
        """Apply a ufunc on the tape, element by element for arrays of objects."""
        if method != "__call__" or settings:
            raise InvalidInput(f"np.{ufunc.__name__}.{method} must be a plain call where derivatives are taken")
        if any(isinstance(value, np.ndarray) and value.ndim for value in inputs):
            arrays = np.broadcast_arrays(*(np.asarray(value, dtype=object) for value in inputs))
            result = np.empty(arrays[0].shape, dtype=object)
            for index in np.ndindex(result.shape):
                result[index] = apply_ufunc(self.tape, ufunc.__name__, [array[index] for array in arrays])
            return result
        return apply_ufunc(self.tape, ufunc.__name__, inputs)

    __add__, __radd__ = _operator(Op.ADD), _operator(Op.ADD, reflected=True)
    __sub__, __rsub__ = _operator(Op.SUBTRACT), _operator(Op.SUBTRACT, reflected=True)
    __mul__, __rmul__ = _operator(Op.MULTIPLY), _operator(Op.MULTIPLY, reflected=True)
    __truediv__, __rtruediv__ = _operator(Op.DIVIDE), _operator(Op.DIVIDE, reflected=True)

    def __neg__(self) -> Expression:
        return Expression(self.tape, self.tape.apply(Op.NEGATE, self.index))

    def __pow__(self, other: Any) -> Any:
        return self.__array_ufunc__(np.power, "__call__", self, other)

    def __rpow__(self, other: Any) -> Any:
        return self.__array_ufunc__(np.power, "__call__", other, self)

    def __bool__(self) -> bool:
        raise InvalidInput("a comparison cannot decide an `if` where derivatives are taken; use np.where")

    def __float__(self) -> float:
        raise InvalidInput("a value whose derivatives are taken cannot become a plain number; use only NumPy functions")


def as_entry(tape: Tape, value: Any) -> int:
    """Return the entry of an expression or number on a tape; raise InvalidInput for anything else."""
    if isinstance(value, np.ndarray):
        value = value[()]
    if isinstance(value, Expression):
        assert value.tape is tape, "expressions must be of one tape"
        return value.index
    if not isinstance(value, float | int | np.bool_ | np.integer | np.floating):
        raise InvalidInput(f"values must be real numbers where derivatives are taken, got {shown(value)}")
    return tape.constant(float(value))


def where(condition: Any, first: Any, second: Any) -> Any:
    """Return ``first`` if the condition is true, else ``second``: np.where of numbers and expressions."""
    tapes = [value.tape for value in (condition, first, second) if isinstance(value, Expression)]
    if not tapes:
        return first if condition else second
    operands = (as_entry(tapes[0], value) for value in (condition, first, second))
    return Expression(tapes[0], tapes[0].apply(Op.WHERE, *operands))


# Differentiable NumPy functions of numbers (ufuncs) as operations of a tape: each is one operation, with its derivative
# in ``differentiation.partial_derivatives``, or is composed of others.


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
    "bitwise_and": lambda x, y: x * y,  # these three operations are only for booleans, as in NumPy
    "bitwise_or": lambda x, y: np.maximum(x, y),
    "invert": lambda x: 1.0 - x,
}
COMPARISONS = frozenset({"less", "less_equal", "greater", "greater_equal", "equal", "not_equal", "isnan", "isfinite"})
BOOLEAN = COMPARISONS | {"logical_and", "logical_or", "logical_not", "bitwise_and", "bitwise_or", "invert"}


def apply_ufunc(tape: Tape, name: str, operands: Sequence[Any]) -> Any:
    """Return the result of the ufunc ``name`` for numbers and expressions on a tape.

    Raises InvalidInput, naming the function, if its derivative is not known.
    """
    arguments = [Expression(tape, as_entry(tape, value)) for value in operands]
    if name in COMPOSED:
        return COMPOSED[name](*arguments)
    if name in ("power", "float_power"):
        base, exponent = arguments
        number = tape.values.get(exponent.index, math.nan)
        if number.is_integer() and 0 < abs(number) <= 8:  # short enough for a product
            product = reduce(operator.mul, [base] * abs(int(number)))
            return product if number > 0 else 1.0 / product
        if number == 0:
            return Expression(tape, tape.constant(1.0))
        return np.sqrt(base) if number == 0.5 else Expression(tape, tape.apply(Op.POWER, base.index, exponent.index))
    op = ELEMENTARY.get(name)
    if op is None:
        raise InvalidInput(
            f"np.{name} has no derivative here; functions that have one: {', '.join(differentiable_ufuncs())}"
        )
    return Expression(tape, tape.apply(op, *(value.index for value in arguments)))


def differentiable_ufuncs() -> list[str]:
    """Return the names of differentiable ufuncs."""
    return sorted({*ELEMENTARY, *COMPOSED, "power"})
