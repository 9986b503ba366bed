"""Derivatives: exact for smooth functions; at a kink those of the active piece."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings

from paretoik.autodiff.differentiation import gradient, hessian, tangents
from paretoik.autodiff.tape import COMPOSED, ELEMENTARY, Tape, where
from tests.autodiff.trees import KINKED, SMOOTH, VARIABLES, evaluated, points, seeds, taped, trees

STEP = 1e-6


@settings(max_examples=30)
@given(trees(SMOOTH), seeds)
def test_the_gradient_is_that_of_the_complex_step(tree, seed):
    tape, value, variables = taped(tree)
    at = points(seed)
    slopes = evaluated(tape, gradient(tape, value, variables), at)
    for i in range(VARIABLES):
        stepped = at.astype(complex)
        stepped[i] += 1e-30j
        expected = np.broadcast_to(np.imag(tree(*stepped)) / 1e-30, at.shape[1:])
        np.testing.assert_allclose(slopes[i], expected, rtol=1e-8, atol=1e-10 * max(1.0, np.abs(slopes).max()))


@settings(max_examples=30)
@given(trees({**SMOOTH, **KINKED}), seeds)
def test_the_gradient_is_that_of_central_differences(tree, seed):
    tape, value, variables = taped(tree)
    at = points(seed)
    slopes = evaluated(tape, gradient(tape, value, variables), at)
    curved = evaluated(tape, hessian(tape, value, variables).values(), at)
    assume(np.abs(curved).max(initial=0.0) < 1e4)  # a point near a kink: sqrt(a² + b²) with both small
    scale = max(1.0, np.abs(slopes).max(), np.abs(evaluated(tape, [value], at)).max())
    for i, slope in enumerate(slopes):
        agree(slope, differences(tape, [value], at, i)[0], scale, 1e-6)


@settings(max_examples=30)
@given(trees({**SMOOTH, **KINKED}), seeds)
def test_second_derivatives_are_differences_of_the_gradient_and_symmetric(tree, seed):
    tape, value, variables = taped(tree)
    at = points(seed)
    first = gradient(tape, value, variables)
    whole = np.array(
        [evaluated(tape, tangents(tape, first, {variable: tape.constant(1.0)}), at) for variable in variables]
    )
    scale = max(1.0, np.abs(whole).max(), np.abs(evaluated(tape, first, at)).max())
    assume(scale < 1e4)
    np.testing.assert_allclose(whole, whole.swapaxes(0, 1), rtol=0, atol=1e-9 * scale)
    for (i, j), slope in hessian(tape, value, variables).items():
        assert i >= j
        np.testing.assert_allclose(evaluated(tape, [slope], at)[0], whole[j, i], rtol=0, atol=1e-12 * scale)
    for j in range(VARIABLES):
        agree(whole[j], differences(tape, first, at, j), scale, 1e-5)


def differences(tape, outputs, at, i):
    """Return central differences; NaN if those of two steps differ: then a kink is in between."""

    def with_step(step):
        ahead, behind = at.copy(), at.copy()
        ahead[i] += step
        behind[i] -= step
        return (evaluated(tape, outputs, ahead) - evaluated(tape, outputs, behind)) / (2 * step)

    slopes, nearer = with_step(STEP), with_step(STEP / 3)
    return np.where(np.abs(slopes - nearer) < 1e-4 * (1.0 + np.abs(slopes) + np.abs(at).max()), slopes, np.nan)


def agree(slopes, differences, scale, tolerance):
    smooth = np.isfinite(differences)
    assert smooth.mean() > 0.5
    np.testing.assert_allclose(slopes[smooth], differences[smooth], rtol=0, atol=tolerance * scale)


FLAT = {"less", "less_equal", "greater", "greater_equal", "equal", "not_equal", "isnan", "isfinite"}
FLAT |= {"logical_and", "logical_or", "logical_not", "sign"}
OF_BOOLEANS = {"bitwise_and", "bitwise_or", "invert"}


@pytest.mark.parametrize("name", sorted({*ELEMENTARY, *COMPOSED, "power"} - OF_BOOLEANS))
def test_every_function_has_its_first_and_second_derivatives(name):
    function = getattr(np, name)
    tape = Tape()
    variables = [tape.input() for _ in range(function.nin)]
    indices = [variable.index for variable in variables]
    value = function(*variables).index
    at = np.array([[0.31, 0.52, 0.83], [0.67, 0.24, 0.95]])[: function.nin]
    first = gradient(tape, value, indices)
    slope = evaluated(tape, first, at)
    assert np.all(slope == 0) == (name in FLAT)
    for i, variable in enumerate(indices):
        np.testing.assert_allclose(slope[i], differences(tape, [value], at, i)[0], rtol=1e-6, atol=1e-7)
        second = evaluated(tape, tangents(tape, first, {variable: tape.constant(1.0)}), at)
        np.testing.assert_allclose(second, differences(tape, first, at, i), rtol=1e-5, atol=1e-6)


C, S = np.cos(1.0), np.sin(1.0)


def at_points(function, *at):
    """Return value, first and second derivative of a function of one number at numbers."""
    tape = Tape()
    x = tape.input()
    y = function(x)
    first = gradient(tape, y.index, [x.index])
    return evaluated(tape, [y.index, *first, *tangents(tape, first, {x.index: tape.constant(1.0)})], np.array(at))


@pytest.mark.parametrize(
    ("function", "at", "value", "slope", "second"),
    [
        (np.abs, -2.0, 2.0, -1.0, 0.0),
        (np.abs, 0.0, 0.0, 0.0, 0.0),
        (lambda x: np.maximum(x, 0.0) ** 2, 3.0, 9.0, 6.0, 2.0),
        (lambda x: np.minimum(x * x, 2.0), 1.0, 1.0, 2.0, 2.0),
        (lambda x: where(np.greater(x, 0), np.sqrt(x), 0.0), 0.0, 0.0, 0.0, 0.0),
        (lambda x: where(np.greater(x, 0), np.sqrt(x), 0.0), 4.0, 2.0, 0.25, -1 / 32),
        (lambda x: where(np.greater(x, 0), np.log(x) * x, x * x), 0.0, 0.0, 0.0, 2.0),
        (lambda x: where(np.not_equal(x, 0), np.sin(x) / x, 1 - x * x / 6), 0.0, 1.0, 0.0, -1 / 3),
        (lambda x: where(np.less(np.abs(x), 1), x**1.5 + x**-2.5, x), -2.0, -2.0, 1.0, 0.0),
        (lambda x: np.maximum(np.log(x), -5.0) ** 2, 0.0, 25.0, 0.0, 0.0),
        (lambda x: np.minimum(1.0 / x, 3.0), 0.0, 3.0, 0.0, 0.0),
        (lambda x: np.sin(where(np.less(0, x), np.sqrt(x), x)) * x, -1.0, S, -C - S, 2 * C - S),
        (lambda x: np.hypot(x, 0.0 * x), 0.0, 0.0, 0.0, 0.0),
    ],
)
def test_at_a_kink_the_derivative_is_that_of_the_piece_that_is_taken(function, at, value, slope, second):
    np.testing.assert_allclose(at_points(function, at)[:, 0], [value, slope, second], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("function", [np.maximum, np.minimum])
def test_where_two_are_equal_the_slopes_of_both_sum_to_one(function):
    tape = Tape()
    x, y = tape.input(), tape.input()
    slopes = evaluated(tape, gradient(tape, function(x, y).index, [x.index, y.index]), [[1.0], [1.0]])
    assert sorted(slopes.ravel()) == [0.0, 1.0]


@pytest.mark.parametrize("at", [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_the_length_of_nothing_grows_nowhere(at):
    tape, value, variables = taped(lambda x, y, z: np.sqrt(x * x + y * y) + z)
    first = gradient(tape, value, variables)
    second = [slope for variable in variables for slope in tangents(tape, first, {variable: tape.constant(1.0)})]
    derivatives = evaluated(tape, [*first, *second], np.array(at)[:, None])[:, 0]
    np.testing.assert_array_equal(derivatives, [0.0, 0.0, 1.0, *[0.0] * 9])
