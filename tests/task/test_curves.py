"""Curves: straight, round and smooth, each through its ends, each a plain value that can be pickled."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.robot.pose import Pose, quaternion_to_matrix
from paretoik.task.curves import TIME_LAWS, Circle, Line, TimedCurve, interpolate, progress
from tests.task.paths import EVERY_KIND

FIRST = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60  # differences of sixth order
SECOND = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180
FRACTIONS = np.linspace(0.0, 1.0, 9)
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
LINE = Line(np.array([1.0, 2.0]), np.array([0.5, -1.0]), None, np.zeros(3))
CIRCLE = Circle(np.zeros(2), 0.3 * np.eye(2), 0.5, np.pi, None)


def test_a_line_is_covered_in_proportion():
    positions, quaternions = LINE(FRACTIONS)
    np.testing.assert_allclose(positions, [1.0, 2.0] + FRACTIONS[:, None] * [0.5, -1.0], atol=1e-15)
    assert quaternions is None


def test_a_line_rotates_about_one_axis_in_proportion():
    quaternions = Line(np.zeros(3), np.zeros(3), IDENTITY, np.array([0.0, 0.0, 1.2]))(FRACTIONS)[1]
    expected = [Pose.planar(0.0, 0.0, 1.2 * fraction).rotation for fraction in FRACTIONS]
    np.testing.assert_allclose(quaternion_to_matrix(quaternions), expected, atol=1e-15)


def test_a_circle_starts_at_its_phase_and_sweeps_its_angle():
    positions, _ = CIRCLE(FRACTIONS)
    angles = np.unwrap(np.arctan2(positions[:, 1], positions[:, 0]))
    np.testing.assert_allclose(angles, 0.5 + np.pi * FRACTIONS, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(positions, axis=1), 0.3, atol=1e-15)


@pytest.mark.parametrize("law", TIME_LAWS)
def test_a_timed_curve_is_its_shape_at_the_progress_of_its_law(law):
    times = np.linspace(0.0, 2.0, 7)
    timed = TimedCurve(CIRCLE, 2.0, law)
    np.testing.assert_array_equal(timed(times)[0], CIRCLE(progress(times, 2.0, law))[0])


def test_an_interpolation_goes_through_its_points_and_orientations():
    knots = np.array([0.0, 0.2, 0.7, 1.0])
    points = np.random.default_rng(0).normal(size=(4, 3))
    turned = np.stack([Pose.planar(0.0, 0.0, angle).quaternion for angle in (0.0, 0.4, 1.0, 1.5)])
    positions, quaternions = interpolate(knots, points, turned)(knots)
    np.testing.assert_allclose(positions, points, atol=1e-14)
    np.testing.assert_allclose(quaternion_to_matrix(quaternions), quaternion_to_matrix(turned), atol=1e-14)


@pytest.mark.parametrize("order", [1, 2])
def test_an_interpolation_whose_ends_meet_is_periodic(order):
    points = np.array([[0.0, 0.0], [1.0, 0.3], [0.4, 1.0], [0.0, 0.0]])
    spline = interpolate(np.linspace(0, 1, 4), points, None).positions
    np.testing.assert_allclose(spline(0.0, order), spline(1.0, order), atol=1e-12)


@pytest.mark.parametrize("curve", [LINE, CIRCLE, TimedCurve(LINE, 2.0, "quintic")], ids=lambda c: type(c).__name__)
def test_a_curve_survives_pickling(curve):
    times = np.linspace(0.0, 1.0, 5)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(curve))(times)[0], curve(times)[0])


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_rates_of_every_path_are_its_derivatives(kind):
    path, step = EVERY_KIND[kind], 1e-3
    t = np.linspace(0.01, 0.69, 68)
    t = t[np.abs(t[:, None] - np.append(path.times[1:-1], 0.35)).min(axis=1) > 3 * step]  # its third may jump there
    if kind.startswith("waypoints"):
        ends = [
            np.searchsorted(path.curve.shape.positions.x, progress(t + k * step, 0.7, path.curve.law)) for k in (-3, 3)
        ]
        t = t[ends[0] == ends[1]]  # and at the knots
    rates = path.rates(t)
    around = np.stack([path.at(t + k * step)[0] for k in range(-3, 4)])
    first, second = np.tensordot(FIRST, around, 1) / step, np.tensordot(SECOND, around, 1) / step**2
    np.testing.assert_allclose(rates.velocity, first, atol=1e-9 * (1 + np.abs(first).max()))
    np.testing.assert_allclose(rates.acceleration, second, atol=1e-7 * (1 + np.abs(second).max()))
    if path.quaternions is None:
        assert rates.angular_velocity is None
        return
    matrices = np.stack([quaternion_to_matrix(path.at(t + k * step)[1]) for k in range(-3, 4)])
    middle = np.swapaxes(matrices[3], -1, -2)
    turning = np.tensordot(FIRST, matrices, 1) / step @ middle  # Ṙ Rᵀ = [ω]
    bending = np.tensordot(SECOND, matrices, 1) / step**2 @ middle  # R̈ Rᵀ = [ω̇] + [ω]², whose skew part is [ω̇]
    bending = (bending - np.swapaxes(bending, -1, -2)) / 2
    for values, skew, tolerance in ((rates[2], turning, 1e-8), (rates[3], bending, 1e-6)):
        expected = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
        np.testing.assert_allclose(values, expected, atol=tolerance * (1 + np.abs(expected).max()))


@pytest.mark.parametrize("kind", ["line of poses", "circle of points"])
def test_rates_are_zero_at_the_ends_of_a_path_from_rest_to_rest(kind):
    for values in EVERY_KIND[kind].rates(np.array([0.0, 0.7])):
        assert values is None or np.abs(values).max() < 1e-12


def test_rates_outside_the_path_are_refused():
    with pytest.raises(InvalidInput, match=r"path: time t: must lie in \[0, 0\.7\] s, got 0\.71"):
        EVERY_KIND["timed poses"].rates(np.array([0.1, 0.71]))
