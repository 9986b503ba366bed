"""Fits of ellipsoids: models are recovered, units and axes do not matter, safe fits are below every sample."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from paretoik.capability.speed_fit import fit_axes, fit_ellipsoids, fit_errors
from paretoik.capability.speed_models import PolynomialEllipsoids, Polynomials, monomials
from paretoik.errors import InvalidInput
from tests.capability.fields import (
    TASKS,
    arm_maxima,
    axes_field,
    constant_shape,
    field,
    grid,
    log_errors,
    units,
    within,
)


@pytest.fixture(scope="module")
def arm():
    """Return positions (the paper's nine and more), directions, and maxima that no ellipse fits well."""
    return grid(4), units(16), arm_maxima(grid(4), units(16))


def symmetric_errors(model, positions, directions, speeds):
    """Return the errors whose sum of squares a fit minimises."""
    return np.sum(np.sinh(log_errors(model, positions, directions, speeds)) ** 2)


def nudged(model, rng, *, size):
    """Return the model with other polynomials for the entries of Q."""
    moved = size * rng.normal(size=model.polynomials.coefficients.shape)
    moved[:, 0] = 0.0  # the scale is fitted before
    return replace(model, polynomials=replace(model.polynomials, coefficients=model.polynomials.coefficients + moved))


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("degree", [0, 2])
def test_ellipsoids_of_one_shape_and_any_size_come_back(task, degree):
    truth = constant_shape(field(task, degree=degree, seed=degree))
    positions, directions = within(truth, len(monomials(task, degree)) + 5), units(9, task=task)
    fitted = fit_ellipsoids(positions, directions, truth.speeds(positions, directions), degree=degree)
    inside, across = within(fitted, 40, seed=9), units(33, task=task, seed=9)
    assert log_errors(fitted, inside, across, truth.speeds(inside, across)) == pytest.approx(0.0, abs=1e-4)
    assert np.all(fitted.lower == positions.min(axis=0))
    assert np.all(fitted.upper == positions.max(axis=0))


@pytest.mark.parametrize("task", TASKS)
def test_ellipsoids_of_any_shape_come_back_better_with_a_higher_degree(task):
    truth = field(task, degree=1)
    positions, directions = within(truth, 40), units(9, task=task)
    samples = positions, directions, truth.speeds(positions, directions)
    errors = [np.abs(log_errors(fit_ellipsoids(*samples, degree=degree), *samples)).max() for degree in (1, 2, 3)]
    assert errors[2] < 0.3 * errors[1] < 0.1 * errors[0]


@pytest.mark.parametrize("size", [1e-4, 1e-2])
def test_no_other_model_has_smaller_errors(arm, size):
    fitted, rng = fit_ellipsoids(*arm), np.random.default_rng(0)
    errors = symmetric_errors(fitted, *arm)
    for _ in range(20):
        assert symmetric_errors(nudged(fitted, rng, size=size), *arm) > errors


def test_units_of_length_do_not_matter(arm):
    positions, directions, speeds = arm
    meters = fit_ellipsoids(positions, directions, speeds, safe=True)
    millimeters = fit_ellipsoids(1e3 * positions, directions, 1e3 * speeds, safe=True)
    inside = within(meters, 20)
    assert millimeters.speeds(1e3 * inside, directions) == pytest.approx(
        1e3 * meters.speeds(inside, directions), rel=1e-6
    )


@pytest.mark.parametrize(("degree", "margin"), [(1, 0.05), (2, 0.0)])
def test_safe_fits_are_below_every_sample_and_nearer_than_a_shrunk_fit(arm, degree, margin):
    free = fit_ellipsoids(*arm, degree=degree)
    safe = fit_ellipsoids(*arm, degree=degree, safe=True, margin=margin)
    shrunk = free.scaled(np.exp(-margin) / (1 + fit_errors(free, *arm).overestimate))
    errors, plain = log_errors(safe, *arm), log_errors(shrunk, *arm)
    assert np.all(errors <= -margin)
    assert errors.max() == pytest.approx(-margin, abs=1e-9)
    assert np.sum(errors**2) < 0.8 * np.sum(plain**2)
    assert -errors.mean() < -plain.mean()


@pytest.mark.parametrize("seed", range(2))
def test_no_other_model_below_the_samples_has_smaller_errors(seed):
    rng, truth = np.random.default_rng(seed), field(2, degree=1, seed=seed)
    positions, directions = within(truth, 8), units(12)
    speeds = truth.speeds(positions, directions) * np.exp(rng.uniform(-0.2, 0.2, size=(8, 12)))
    safe = fit_ellipsoids(positions, directions, speeds, degree=1, safe=True)
    errors = symmetric_errors(safe, positions, directions, speeds)
    for size in np.geomspace(1e-4, 1e-1, 50):
        other = nudged(safe, rng, size=size)
        other = other.scaled(np.exp(-log_errors(other, positions, directions, speeds).max()))
        assert symmetric_errors(other, positions, directions, speeds) > errors


def test_between_directions_a_safe_fit_is_safer_the_more_there_are():
    positions, across = grid(3), units(90)
    truth = arm_maxima(positions, across)
    few, many = (
        fit_errors(
            fit_ellipsoids(positions, units(k), arm_maxima(positions, units(k)), safe=True), positions, across, truth
        )
        for k in (8, 32)
    )
    assert few.overestimate > 0.1  # sixteen directions around the circle, as in the paper
    assert many.overestimate < 0.05


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"degree": -1}, "degree must be an integer of at least 0, got -1"),
        ({"margin": 0.1}, "and 0 unless safe, got 0.1"),
    ],
)
def test_settings_that_mean_nothing_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        fit_ellipsoids(grid(3), units(8), np.ones((9, 8)), **settings)


def test_axes_that_are_polynomials_come_back_with_angles_continued():
    truth = axes_field(turn=0.8)
    speeds = truth.speeds(grid(5), units(8))
    inside = within(truth, 30)
    fitted = fit_axes(grid(5), units(8), speeds)
    assert fitted.speeds(inside, units(7)) == pytest.approx(truth.speeds(inside, units(7)), rel=1e-5)


def test_where_ellipses_turn_around_a_position_an_angle_cannot_follow():
    entries = np.array([[1.0, 0, 1.0], [0.9, 0, -0.9], [0, 0.9, 0]])  # half a turn of c around the center
    center = np.array([0.15, -0.15])
    columns = np.column_stack([np.zeros(3), entries])
    polynomials = Polynomials(degree=1, center=center, scale=0.1, coefficients=columns)
    truth = PolynomialEllipsoids(polynomials=polynomials, lower=center - 0.05, upper=center + 0.05)
    samples = (grid(4), units(8), truth.speeds(grid(4), units(8)))
    inside = within(truth, 100)
    held_out = (inside, units(8), truth.speeds(inside, units(8)))
    assert fit_errors(fit_ellipsoids(*samples), *held_out).rms < 0.02
    assert fit_errors(fit_axes(*samples), *held_out).rms > 0.1


# Errors of fits, and samples that are refused.


def test_errors_are_shares_of_the_true_speed_and_say_where():
    model, directions = field(2), units(4)
    positions = within(model, 3)
    factor = np.ones((3, 4))
    factor[1, 2], factor[2, 0] = 1 / 1.25, 2.0
    errors = fit_errors(model, positions, directions, factor * model.speeds(positions, directions))
    assert errors.overestimate == pytest.approx(0.25)
    assert errors.underestimate == pytest.approx(0.5)
    assert errors.rms == pytest.approx(np.sqrt((0.25**2 + 0.5**2) / 12))
    assert np.all(errors.position == positions[1])
    assert np.all(errors.direction == directions[2])


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p, d, v: (p, d, v[:, :3]), "speeds must have shape (9, 8), got (9, 3)"),
        (lambda p, d, v: (p, 2 * d, v), "directions must be unit vectors, got length 2 at direction 0"),
        (lambda p, d, v: (p, d[[0, 3]], v[:, :2]), "directions must determine the 3 numbers of an ellipsoid"),
        (lambda p, d, v: (p * [1, 0], d, v), "in general position, got 9 that determine only 3 of 6 terms"),
    ],
)
@pytest.mark.parametrize("fit", [fit_ellipsoids, fit_axes])
def test_what_cannot_be_fitted_is_refused_by_name(change, message, fit):
    with pytest.raises(InvalidInput, match=re.escape(message)) as caught:
        fit(*change(grid(3), units(8), np.ones((9, 8))))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("wrong", [np.nan, -1.0])
def test_a_wrong_speed_is_named_with_its_position_and_direction(wrong):
    speeds = np.ones((9, 8))
    speeds[4, 6] = wrong
    for use in (fit_ellipsoids, fit_axes, lambda *samples: fit_errors(field(2), *samples)):
        with pytest.raises(InvalidInput, match=f"must be positive numbers, got {wrong} at position 4, direction 6"):
            use(grid(3), units(8), speeds)
