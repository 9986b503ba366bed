"""The paper's form of the model: radii and an angle come back where they are polynomials, and fail where they turn."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.capability.ellipsoid_fits import fit_axes, fit_ellipsoids
from paretoik.capability.polynomials import Polynomials
from paretoik.capability.speed_models import PolynomialEllipsoids
from paretoik.capability.speed_samples import fit_errors
from tests.capability.fields import axes_field, grid, units, within


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
