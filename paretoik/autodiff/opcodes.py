"""The elementary operations of a tape and their NumPy functions."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum, auto
from typing import Any

import numpy as np

NO_OPERAND = -1


class Op(IntEnum):
    """The operation of a tape's entry; comparisons give 1 or 0."""

    CONSTANT = 0
    INPUT = auto()
    ADD = auto()
    SUBTRACT = auto()
    MULTIPLY = auto()
    DIVIDE = auto()
    NEGATE = auto()
    SINE = auto()
    COSINE = auto()
    SQUARE_ROOT = auto()
    EXPONENTIAL = auto()
    LOGARITHM = auto()
    ARC_TANGENT = auto()  # arc tangent of first / second, in all four quadrants
    ARC_SINE = auto()
    ARC_COSINE = auto()
    TANH = auto()
    POWER = auto()
    ABSOLUTE = auto()
    SIGN = auto()
    MAXIMUM = auto()
    MINIMUM = auto()
    LESS = auto()
    LESS_EQUAL = auto()
    MASKED_MULTIPLY = auto()  # first · second, 0 if first is 0, even if second is inf or NaN
    WHERE = auto()  # second if first is not 0, else third


class Fused(IntEnum):
    """Additional instructions: a product in a sum or a difference, and a sine with its cosine."""

    MULTIPLY_ADD = len(Op)  # first · second + third
    MULTIPLY_SUBTRACT = len(Op) + 1  # first · second − third
    SUBTRACT_PRODUCT = len(Op) + 2  # third − first · second
    SINE_COSINE = len(Op) + 3  # sine and cosine of the first; the second operand is the register of the cosine


COMMUTATIVE = frozenset({Op.ADD, Op.MULTIPLY, Op.MAXIMUM, Op.MINIMUM})
PIECEWISE = frozenset({Op.MAXIMUM, Op.MINIMUM, Op.WHERE})
PIECEWISE_CONSTANT = frozenset({Op.CONSTANT, Op.SIGN, Op.LESS, Op.LESS_EQUAL})
UFUNCS: dict[Op, np.ufunc] = {
    Op.ADD: np.add,
    Op.SUBTRACT: np.subtract,
    Op.MULTIPLY: np.multiply,
    Op.DIVIDE: np.divide,
    Op.NEGATE: np.negative,
    Op.SINE: np.sin,
    Op.COSINE: np.cos,
    Op.SQUARE_ROOT: np.sqrt,
    Op.EXPONENTIAL: np.exp,
    Op.LOGARITHM: np.log,
    Op.ARC_TANGENT: np.arctan2,
    Op.ARC_SINE: np.arcsin,
    Op.ARC_COSINE: np.arccos,
    Op.TANH: np.tanh,
    Op.POWER: np.power,
    Op.ABSOLUTE: np.absolute,
    Op.SIGN: np.sign,
    Op.MAXIMUM: np.maximum,
    Op.MINIMUM: np.minimum,
    Op.LESS: np.less,
    Op.LESS_EQUAL: np.less_equal,
}


def compute(op: Op, *values: float) -> float:
    """Return the result of an operation on numbers."""
    with np.errstate(all="ignore"):
        return float(_FUNCTIONS[op](*(np.float64(value) for value in values)))


_FUNCTIONS: dict[Op, Callable[..., Any]] = {
    **UFUNCS,
    Op.MASKED_MULTIPLY: lambda first, second: first * second if first else 0.0,
    Op.WHERE: lambda condition, first, second: first if condition else second,
}
