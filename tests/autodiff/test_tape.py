"""Expressions: the tape computes what NumPy computes, each value once, and refuses what it cannot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings

from paretoik.autodiff.operations import Op
from paretoik.autodiff.tape import Tape, as_entry, where
from paretoik.errors import InvalidInput
from tests.autodiff.trees import KINKED, SMOOTH, evaluated, points, seeds, taped, trees


@settings(max_examples=60)
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
        lambda x: 0.0 + x,
        lambda x: x - 0,
        lambda x: x * 1,
        lambda x: 1.0 * x,
        lambda x: x / 1,
        lambda x: np.negative(-x),
        lambda x: -1 * (x * -1),
        lambda x: np.maximum(x, x),
        lambda x: where(np.less(x, 1.0), x, x),
        lambda x: where(1.0, x, 3.0),
        lambda x: x**1,
        lambda x: np.positive(x),
        lambda x: np.sqrt(x) * np.sqrt(x),
    ],
)
def test_an_identity_adds_no_entry(same):
    tape = Tape()
    x = tape.input()
    assert same(x).index == x.index


def test_differences_of_opposites_become_plain_sums():
    tape = Tape()
    x, y = tape.input(), tape.input()
    assert (x - (-y)).index == (x + y).index
    assert (x + (-y)).index == (x - y).index
    assert ((-x) + y).index == (y - x).index
    assert tape.entries[((-x) * y).index][0] is Op.NEGATE


def test_an_entry_uses_only_entries_before_it():
    tape, value, _ = taped(lambda x, y, z: np.hypot(np.sin(x * y), z) ** 2.5 / (1 + np.exp(x)))
    for i, (op, *operands) in enumerate(tape.entries):
        if op not in (Op.CONSTANT, Op.INPUT):
            assert max(operands) < i
    assert value < len(tape.entries)


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
        (lambda x: 1 if x else 0, "np.where is wanted"),
        (lambda x: float(x), "NumPy functions only"),
        (lambda x: math.sin(x), "NumPy functions only"),
        (lambda x: np.floor(x), "np.floor has no derivative here; those that have: absolute, add"),
        (lambda x: x % 1.0 if hasattr(x, "__mod__") else np.remainder(x, 1.0), "np.remainder has no derivative"),
        (lambda x: np.add(x, 1.0, dtype=float), "np.add.__call__: a plain call is wanted"),
        (lambda x: np.add.outer(x, x), "np.add.outer: a plain call is wanted"),
        (lambda x: x * 1j, "real numbers are wanted where derivatives are taken, got 1j"),
        (lambda x: x + None, "real numbers are wanted where derivatives are taken, got None"),
        (lambda x: x + "1", "real numbers are wanted where derivatives are taken, got '1'"),
    ],
)
def test_what_a_tape_cannot_hold_is_refused_in_one_line(asked, words):
    with pytest.raises(InvalidInput, match=words) as refused:
        asked(Tape().input())
    assert "\n" not in str(refused.value)
