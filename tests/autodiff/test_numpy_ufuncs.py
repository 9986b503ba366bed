"""NumPy's functions of numbers on a tape: their values are NumPy's, for every number, inf and NaN."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paretoik.autodiff.operations import Op
from paretoik.autodiff.tape import COMPOSED, ELEMENTARY, Tape, as_entry, differentiable_ufuncs
from tests.autodiff.trees import evaluated

NAN, INF = math.nan, math.inf
NUMBERS = np.array([-2.5, -1.0, -0.5, 0.0, 0.3, 0.5, 1.0, 2.0])
OF_BOOLEANS = ("bitwise_and", "bitwise_or", "invert")


@pytest.mark.parametrize("name", differentiable_ufuncs())
def test_every_function_is_numpys_at_numbers_and_at_expressions(name):
    function = getattr(np, name)
    count = function.nin
    pairs = np.array(np.meshgrid(*[NUMBERS] * count)).reshape(count, -1)
    if name in OF_BOOLEANS:
        pairs = (pairs > 0).astype(float)
    with np.errstate(all="ignore"):
        expected = function(*(pairs.astype(bool) if name in OF_BOOLEANS else pairs)).astype(float)
    tape = Tape()
    operands = [tape.input() for _ in range(count)]
    values = evaluated(tape, [function(*operands).index], pairs)[0]
    np.testing.assert_allclose(values, expected, rtol=1e-13, atol=1e-15)
    for numbers, value in zip(pairs.T, expected, strict=True):
        folded = function(*(operands[0] * 0.0 + number for number in numbers))
        assert tape.values[folded.index] == pytest.approx(value, rel=1e-13, abs=1e-15, nan_ok=True)


@pytest.mark.parametrize("exponent", [-9, -8, -2, -1.5, -1, 0, 0.5, 1, 2, 3, 8, 9, 2.5])
def test_powers_of_every_kind_are_numpys(exponent):
    tape = Tape()
    x = tape.input()
    at = np.array([0.3, 1.0, 2.0] + ([-1.5] if float(exponent).is_integer() else []))
    np.testing.assert_allclose(evaluated(tape, [as_entry(tape, x**exponent)], at)[0], at**exponent, rtol=1e-13)


@pytest.mark.parametrize("name", ["maximum", "minimum", "fmax", "fmin", "less", "equal", "not_equal", "greater_equal"])
@pytest.mark.parametrize("pair", [(NAN, 1.0), (1.0, NAN), (NAN, NAN), (INF, 1.0), (-INF, INF)])
def test_nan_and_inf_are_treated_as_in_numpy(name, pair):
    tape = Tape()
    x, y = tape.input(), tape.input()
    function = getattr(np, name)
    for operands, numbers in (((x, y), pair), ((y, x), pair[::-1])):
        values = evaluated(tape, [function(*operands).index], np.array([pair]).T)[0, 0]
        np.testing.assert_equal(values, float(function(*numbers)))


def test_isnan_and_isfinite():
    tape = Tape()
    x = tape.input()
    at = np.array([NAN, INF, -INF, 0.0, 1.0])
    values = evaluated(tape, [np.isnan(x).index, np.isfinite(x).index], at)
    np.testing.assert_array_equal(values, [np.isnan(at), np.isfinite(at)])


def test_every_operation_has_a_ufunc():
    assert set(Op) - set(ELEMENTARY.values()) == {
        Op.CONSTANT,
        Op.INPUT,
        Op.POWER,
        Op.MASKED_MULTIPLY,
        Op.WHERE,
    }
    assert not set(COMPOSED) & set(ELEMENTARY)
