"""Every operation of the interpreter beside NumPy's function, at zeros, infinities and what is no number as well."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.interpreter import run_first
from paretoik.autodiff.operations import UFUNCS, Op
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


def test_a_choice_takes_the_second_where_the_first_is_not_zero():
    condition, first, second = (each.ravel() for each in np.meshgrid(VALUES, VALUES, VALUES))
    chosen = evaluated(Op.WHERE, condition, first, second)
    np.testing.assert_array_equal(chosen, np.where(condition != 0, first, second))


def test_a_masked_product_is_zero_where_its_first_factor_is():
    first, second = (each.ravel() for each in np.meshgrid(VALUES, VALUES))
    with np.errstate(invalid="ignore"):
        expected = np.where(first == 0, 0.0, first * second)
    np.testing.assert_array_equal(evaluated(Op.MASKED_MULTIPLY, first, second), expected)


def test_points_beyond_the_first_are_left_alone():
    tape = Tape()
    x = tape.input()
    evaluator = compile_evaluator(tape, [(x * x + 1.0).index, tape.constant(7.0)])
    inputs, outputs = np.arange(300.0)[None], np.full((2, 300), -1.0)
    run_first(evaluator.arrays, inputs, outputs, 130)
    np.testing.assert_array_equal(outputs[:, :130], [inputs[0, :130] ** 2 + 1, np.full(130, 7.0)])
    assert (outputs[:, 130:] == -1.0).all()
