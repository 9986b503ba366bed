"""Speed models: their roots are those of their ellipsoids, with exact derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import sqrtm

from paretoik.capability.speed_models import Polynomials, monomials, planar_roots, spectral_roots, upper_triangle
from tests.capability.fields import TASKS, axes_field, differences, field, units, within


@pytest.mark.parametrize("task", TASKS)
def test_the_root_is_that_of_the_polynomials(task):
    model = field(task)
    (position,) = within(model, 1)
    x = (position - model.polynomials.center) / model.polynomials.scale
    monomials = [1.0, *x, *(x[i] * x[j] for i in range(task) for j in range(i, task))]
    log_scale, *entries = monomials @ model.polynomials.coefficients
    matrix = np.zeros((task, task))
    matrix[np.triu_indices(task)] = entries
    root = sqrtm(matrix + np.triu(matrix, 1).T) / np.exp(log_scale)
    assert model.roots(position)[0] == pytest.approx(root, rel=1e-12)


@pytest.mark.parametrize("task", TASKS)
def test_along_every_direction_the_speed_is_on_the_ellipsoid_and_the_same_backwards(task):
    model, directions = field(task), units(20, task=task)
    positions = within(model, 5)
    speeds, (roots, _) = model.speeds(positions, directions), model.roots(positions)
    tips = speeds[..., None] * directions
    assert np.linalg.norm(tips @ roots, axis=-1) == pytest.approx(1.0)
    assert model.speeds(positions, -directions) == pytest.approx(speeds, rel=1e-14)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("degree", [0, 3])
def test_derivatives_are_those_of_differences(task, degree):
    model = field(task, degree=degree)
    positions = within(model, 30)
    assert model.roots(positions)[1] == pytest.approx(differences(lambda p: model.roots(p)[0], positions), abs=1e-6)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("away", [0.0, 1e-9])
def test_derivatives_are_exact_where_radii_are_equal_or_nearly_so(task, away):
    model = field(task, degree=1, seed=3)
    columns = model.polynomials.coefficients.copy()
    columns[0] = np.append(0.0, np.eye(task)[np.triu_indices(task)])  # a ball at the center: R = I, dR = dQ/2 − ds
    model = replace(model, polynomials=replace(model.polynomials, coefficients=columns))
    position = model.polynomials.center + away * np.array([0.6, -0.8, 0.1])[:task]
    entries = columns[1:, 1:][:, upper_triangle(columns.shape[1] - 1)]
    first_order = entries / 2 - columns[1:, 0, None, None] * np.eye(task)
    gradient = model.roots(position)[1]
    expected = np.moveaxis(first_order, 0, -1) / model.polynomials.scale
    assert gradient == pytest.approx(expected, abs=1e-12 + 1e3 * away)
    assert gradient == pytest.approx(differences(lambda p: model.roots(p)[0], position), abs=1e-6)


@pytest.mark.parametrize("roots", [planar_roots, spectral_roots])
@pytest.mark.parametrize("entries", [(1.0, 0.0, -1.0), (-1.0, 0.0, -1.0)])
def test_what_has_no_root_is_not_finite(roots, entries):
    values, changes = roots(np.array([0.0, *entries]), np.ones((4, 1)))
    assert not np.isfinite(values).all()
    assert not np.isfinite(changes).all()


def test_roots_of_axes_have_these_axes_and_the_derivatives_of_differences():
    model = axes_field(turn=0.8)
    positions = within(model, 30)
    (a, b, c), (roots, gradients) = model.axes(positions)[0].T, model.roots(positions)
    for radius, angle in ((a, c), (b, c + np.pi / 2)):
        along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        assert np.einsum("nij,nj->ni", roots, along) == pytest.approx(along / radius[:, None])
    assert gradients == pytest.approx(differences(lambda p: model.roots(p)[0], positions), abs=1e-6)


# Polynomials: values, derivatives, and bounds over a box by Bernstein coefficients.


def polynomials(task, degree, columns=2, seed=0):
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=(len(monomials(task, degree)), columns))
    return Polynomials(degree=degree, center=rng.normal(size=task), scale=0.7, coefficients=coefficients)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("degree", [0, 3])
def test_bernstein_coefficients_are_the_values_at_corners_and_bound_all_between(task, degree):
    polynomial, rng = polynomials(task, degree), np.random.default_rng(2)
    lower, upper = -np.ones(task), np.linspace(1.0, 2.0, task)
    bounds = polynomial.bernstein(lower, upper) @ polynomial.coefficients
    assert bounds[0] == pytest.approx(polynomial(lower)[0], rel=1e-10)
    assert bounds[-1] == pytest.approx(polynomial(upper)[0], rel=1e-10)
    values = polynomial(rng.uniform(lower, upper, size=(2000, task)))[0]
    assert np.all(values <= bounds.max(axis=0) + 1e-9)
    assert np.all(values >= bounds.min(axis=0) - 1e-9)
