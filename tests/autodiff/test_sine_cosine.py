import numpy as np
import pytest

from paretoik.autodiff.interpreter import MAX_REDUCED, cosines, sines


def written(function, x):
    values = np.empty(len(x))
    function(values, x, len(x))
    return values


@pytest.mark.parametrize(("function", "known"), [(sines, np.sin), (cosines, np.cos)])
@pytest.mark.parametrize("largest", [1e-300, 1e-8, 0.1, 1.0, 10.0, 1e3, MAX_REDUCED, 10 * MAX_REDUCED])
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
def test_what_is_no_angle_is_no_number(function):
    assert np.isnan(written(function, np.array([np.nan, np.inf, -np.inf]))).all()
    assert np.isfinite(written(function, np.array([0.0, np.nan, 1.0]))).tolist() == [True, False, True]


def test_only_the_first_numbers_are_written():
    values = np.full(4, 7.0)
    sines(values, np.zeros(4), 2)
    assert values.tolist() == [0.0, 0.0, 7.0, 7.0]
