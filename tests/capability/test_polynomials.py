"""Polynomials: values, derivatives, and bounds over a box by Bernstein coefficients."""

import numpy as np
import pytest

from paretoik.capability.speed_models import Polynomials, monomials, orthogonal_design
from tests.capability.fields import TASKS, differences


def polynomials(task, degree, columns=2, seed=0):
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=(len(monomials(task, degree)), columns))
    return Polynomials(degree=degree, center=rng.normal(size=task), scale=0.7, coefficients=coefficients)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("degree", [0, 1, 2, 4])
def test_derivatives_are_those_of_differences(task, degree):
    polynomial, positions = polynomials(task, degree), np.random.default_rng(1).normal(size=(5, task))
    gradients = differences(lambda p: polynomial(p)[0], positions)
    assert polynomial(positions)[1] == pytest.approx(gradients, rel=1e-6, abs=1e-5)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_bernstein_coefficients_are_the_values_at_corners_and_bound_all_between(task, degree):
    polynomial, rng = polynomials(task, degree), np.random.default_rng(2)
    lower, upper = -np.ones(task), np.linspace(1.0, 2.0, task)
    bounds = polynomial.bernstein(lower, upper) @ polynomial.coefficients
    assert bounds[0] == pytest.approx(polynomial(lower)[0], rel=1e-10)
    assert bounds[-1] == pytest.approx(polynomial(upper)[0], rel=1e-10)
    values = polynomial(rng.uniform(lower, upper, size=(2000, task)))[0]
    assert np.all(values <= bounds.max(axis=0) + 1e-9)
    assert np.all(values >= bounds.min(axis=0) - 1e-9)


def test_a_box_without_width_has_one_value():
    polynomial, place = polynomials(2, 2), np.array([0.3, -0.2])
    bounds = polynomial.bernstein(place, place) @ polynomial.coefficients
    assert bounds == pytest.approx(np.tile(polynomial(place)[0], (9, 1)), rel=1e-12)


def test_orthogonal_designs_have_unit_mean_squares():
    polynomial, positions = polynomials(2, 2), np.random.default_rng(1).normal(size=(12, 2))
    design, triangular = orthogonal_design(polynomial, positions)
    assert design.T @ design / 12 == pytest.approx(np.eye(6), abs=1e-12)
    assert design @ triangular == pytest.approx(polynomial.design(positions))
