"""Curves: straight, round and smooth, each through its ends, each a plain value that can be pickled."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from paretoik.robot.pose import Pose, quaternion_to_matrix
from paretoik.task.curves import Circle, Line, TimedCurve, interpolate
from paretoik.task.time_laws import TIME_LAWS, progress

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
