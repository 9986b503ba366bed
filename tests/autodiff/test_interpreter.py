"""Operations of the interpreter compared with NumPy's functions, also at zeros, infinities and NaN."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.interpreter import MAX_REDUCED, cosines, run_first, sines
from paretoik.autodiff.opcodes import UFUNCS, Op
from paretoik.autodiff.tape import Tape

VALUES = np.array([-np.inf, -2.5, -1.0, -0.3, -0.0, 0.0, 0.3, 1.0, 2.5, np.inf, np.nan])


def evaluated(op, *arguments):
    tape = Tape()
    inputs = [tape.input().index for _ in arguments]
    return compile_evaluator(tape, [tape.apply(op, *inputs)])(np.array(arguments))[0]


@pytest.mark.parametrize("op", UFUNCS, ids=lambda op: op.name)
def test_an_operation_is_numpys_function(op):
    arguments = np.meshgrid(*[VALUES] * UFUNCS[op].nin)
    flat = [each.ravel() for each in arguments]
    with np.errstate(all="ignore"):
        expected = UFUNCS[op](*flat).astype(float)
    np.testing.assert_allclose(evaluated(op, *flat), expected, rtol=2e-15)


def test_a_masked_product_is_zero_where_its_first_factor_is():
    first, second = (each.ravel() for each in np.meshgrid(VALUES, VALUES))
    with np.errstate(invalid="ignore"):
        expected = np.where(first == 0, 0.0, first * second)
    np.testing.assert_array_equal(evaluated(Op.MASKED_MULTIPLY, first, second), expected)


def test_a_choice_takes_its_second_operand_unless_the_first_is_zero():
    condition, first = (each.ravel() for each in np.meshgrid(VALUES, VALUES))
    chosen = evaluated(Op.WHERE, condition, first, np.full(condition.shape, 7.0))
    np.testing.assert_array_equal(chosen, np.where(condition != 0, first, 7.0))


def test_points_beyond_the_first_are_left_alone():
    tape = Tape()
    x = tape.input()
    evaluator = compile_evaluator(tape, [(x * x + 1.0).index, tape.constant(7.0)])
    inputs, outputs = np.arange(300.0)[None], np.full((2, 300), -1.0)
    run_first(evaluator.arrays, inputs, outputs, 130)
    np.testing.assert_array_equal(outputs[:, :130], [inputs[0, :130] ** 2 + 1, np.full(130, 7.0)])
    assert (outputs[:, 130:] == -1.0).all()


def written(function, x):
    values = np.empty(len(x))
    function(values, x, len(x))
    return values


@pytest.mark.parametrize(("function", "known"), [(sines, np.sin), (cosines, np.cos)])
@pytest.mark.parametrize("largest", [1e-300, 0.1, 1e3, MAX_REDUCED, 10 * MAX_REDUCED])
def test_every_digit_is_right(function, known, largest):
    x = np.random.default_rng(0).uniform(-largest, largest, size=5000)
    expected = known(x)
    assert np.all(np.abs(written(function, x) - expected) <= np.spacing(np.abs(expected)))


@pytest.mark.parametrize(("function", "known"), [(sines, np.sin), (cosines, np.cos)])
def test_places_where_reduced_angles_change_sign_or_vanish(function, known):
    turns = np.arange(-4000, 4001) * (np.pi / 4)
    x = np.concatenate([turns, np.nextafter(turns, np.inf), np.nextafter(turns, -np.inf)])
    np.testing.assert_allclose(written(function, x), known(x), rtol=3e-16, atol=1e-20)


@pytest.mark.parametrize("function", [sines, cosines])
def test_sine_and_cosine_of_no_angle_are_nan(function):
    assert np.isnan(written(function, np.array([np.nan, np.inf, -np.inf]))).all()
    assert np.isfinite(written(function, np.array([0.0, np.nan, 1.0]))).tolist() == [True, False, True]
