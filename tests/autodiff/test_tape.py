"""Expressions: the tape computes NumPy's values, each once, and refuses unsupported code."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings

from paretoik.autodiff.tape import Tape, as_entry, differentiable_ufuncs, where
from paretoik.errors import InvalidInput
from tests.autodiff.trees import KINKED, SMOOTH, evaluated, points, seeds, taped, trees


@settings(max_examples=30)
@given(trees({**SMOOTH, **KINKED}), seeds)
def test_any_expression_has_the_value_that_numpy_gives_it(tree, seed):
    tape, value, _ = taped(tree)
    at = points(seed)
    expected = np.broadcast_to(tree(*at), at.shape[1:])
    scale = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(evaluated(tape, [value], at)[0], expected, rtol=1e-9, atol=1e-11 * scale)


def test_equal_expressions_are_one_entry():
    tape = Tape()
    x, y = tape.input(), tape.input()
    assert (x + y).index == (y + x).index
    assert (x * y).index == (y * x).index
    assert np.maximum(x, y).index == np.maximum(y, x).index
    assert np.sin(x * y + 2).index == np.sin(2 + y * x).index
    assert (x - y).index != (y - x).index
    before = len(tape.entries)
    assert (np.cos(x - y) * np.cos(x - y)).index == (np.cos(x - y) ** 2).index
    assert len(tape.entries) == before + 2


def test_constants_fold():
    tape = Tape()
    x = tape.input()
    constant = x * 0.0 + 2.0
    for folded, value in (
        (np.sqrt(constant), math.sqrt(2.0)),
        (constant**3, 8.0),
        (np.where(True, 1, 0) + constant, 3.0),
        (where(constant, 5.0, x), 5.0),
        (np.maximum(constant, 7.0), 7.0),
        (np.less(constant, 7.0), 1.0),
        (x - x, 0.0),
        (x**0, 1.0),
    ):
        assert tape.values[as_entry(tape, folded)] == value


@pytest.mark.parametrize(
    "same",
    [
        lambda x: x + 0,
        lambda x: x - 0,
        lambda x: 1.0 * x,
        lambda x: -1 * (x * -1),
        lambda x: where(np.less(x, 1.0), x, x),
        lambda x: np.sqrt(x) * np.sqrt(x),
    ],
)
def test_an_identity_adds_no_entry(same):
    tape = Tape()
    x = tape.input()
    assert same(x).index == x.index


def test_plain_arrays_meet_expressions_element_by_element():
    tape = Tape()
    x = tape.input()
    for made in (x * np.array([1.0, 2.0]), np.array([1.0, 2.0]) * x):
        assert made.shape == (2,)
        assert made[0].index == x.index
    assert (x + np.array(1.0)).index == (x + 1).index == (np.float64(1.0) + x).index


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda x: 1 if x else 0, "use np.where"),
        (lambda x: math.sin(x), "use only NumPy functions"),
        (lambda x: np.floor(x), "np.floor has no derivative here; functions that have one: absolute, add"),
        (lambda x: np.add(x, 1.0, dtype=float), "np.add.__call__ must be a plain call"),
        (lambda x: x * 1j, "values must be real numbers where derivatives are taken, got 1j"),
    ],
)
def test_what_a_tape_cannot_hold_is_refused_in_one_line(asked, words):
    with pytest.raises(InvalidInput, match=words) as refused:
        asked(Tape().input())
    assert "\n" not in str(refused.value)


# NumPy's functions of numbers on a tape have NumPy's values for every number, inf and NaN.


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


@pytest.mark.parametrize("exponent", [-9, -1.5, -1, 0, 0.5, 3, 8, 2.5])
def test_powers_of_every_kind_are_numpys(exponent):
    tape = Tape()
    x = tape.input()
    at = np.array([0.3, 1.0, 2.0] + ([-1.5] if float(exponent).is_integer() else []))
    np.testing.assert_allclose(evaluated(tape, [as_entry(tape, x**exponent)], at)[0], at**exponent, rtol=1e-13)


@pytest.mark.parametrize("name", ["maximum", "fmin", "less", "not_equal"])
@pytest.mark.parametrize("pair", [(NAN, 1.0), (NAN, NAN), (-INF, INF)])
def test_nan_and_inf_are_treated_as_in_numpy(name, pair):
    tape = Tape()
    x, y = tape.input(), tape.input()
    function = getattr(np, name)
    for operands, numbers in (((x, y), pair), ((y, x), pair[::-1])):
        values = evaluated(tape, [function(*operands).index], np.array([pair]).T)[0, 0]
        np.testing.assert_equal(values, float(function(*numbers)))
