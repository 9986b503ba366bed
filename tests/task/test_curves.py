"""Curves: straight, round and smooth, each through its ends, each a plain value that can be pickled."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.errors import InvalidInput
from paretoik.robot.pose import Pose, quaternion_to_matrix
from paretoik.task.curves import TIME_LAWS, Circle, Line, TimedCurve, interpolate, progress, progress_rates
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


# Time laws: rest at both ends, symmetry, and the peaks of the papers


laws = st.sampled_from(TIME_LAWS)
durations = st.floats(0.01, 100.0)
shares = st.floats(0.0, 1.0)


@pytest.mark.parametrize("law", TIME_LAWS)
def test_progress_runs_from_exactly_zero_to_exactly_one(law):
    assert progress(np.array([0.0, 0.7]), 0.7, law).tolist() == [0.0, 1.0]


@given(laws, durations, st.lists(shares, min_size=2, max_size=20))
def test_progress_never_goes_back_nor_leaves_zero_to_one(law, duration, taus):
    covered = progress(np.sort(taus) * duration, duration, law)
    assert (np.diff(covered) >= -1e-15).all()
    assert covered.min() >= -1e-15
    assert covered.max() <= 1 + 1e-15


@given(laws, durations, shares)
def test_the_second_half_mirrors_the_first(law, duration, tau):
    t = np.array([tau * duration])
    assert progress(duration - t, duration, law) == pytest.approx(1 - progress(t, duration, law), abs=1e-12)


def test_raised_cosine_is_equation_19_with_its_lost_half():
    duration = 1.3
    tau, omega = duration / 2, 4 * np.pi / duration
    t = np.linspace(0, tau, 50)
    printed = (t**2 / 2 + (np.cos(omega * t) - 1) / omega**2) / tau**2
    np.testing.assert_allclose(progress(t, duration, "raised-cosine"), printed, atol=1e-15)


def test_raised_cosine_has_the_stated_peaks_and_rests_at_both_ends_and_the_middle():
    t = np.linspace(0, 2.0, 4001)
    rates = np.gradient(progress(t, 2.0, "raised-cosine"), t, edge_order=2)
    accelerations = np.gradient(rates, t, edge_order=2)
    assert rates.max() == pytest.approx(2 / 2.0, rel=1e-5)
    assert np.abs(accelerations).max() == pytest.approx(8 / 2.0**2, rel=1e-5)
    np.testing.assert_allclose(rates[[0, -1]], 0, atol=1e-5)
    np.testing.assert_allclose(accelerations[[0, 2000, -1]], 0, atol=1e-4)


def test_quintic_is_the_polynomial_of_least_jerk():
    tau = np.linspace(0, 1, 101)
    np.testing.assert_allclose(progress(3 * tau, 3.0, "quintic"), 10 * tau**3 - 15 * tau**4 + 6 * tau**5, atol=1e-14)
    change = np.diff(progress(np.array([1.5 - 1e-4, 1.5 + 1e-4]), 3.0, "quintic"))
    assert change / 2e-4 == pytest.approx(15 / 8 / 3)


def test_an_unknown_law_is_refused_with_the_names_of_the_known():
    with pytest.raises(InvalidInput, match=r"raised-cosine, quintic, uniform, got 'cubic'"):
        TimedCurve(CIRCLE, 1.0, "cubic")


@given(laws, durations, st.floats(0.001, 0.999))
def test_rates_of_progress_are_its_derivatives(law, duration, share):
    step = 1e-3 * min(share, 1 - share)
    around = progress((share + step * np.arange(-1, 2)) * duration, duration, law)
    speed, acceleration = progress_rates(np.array(share * duration), duration, law)
    assert speed * duration == pytest.approx((around[2] - around[0]) / (2 * step), abs=1e-4)
    if abs(share - 0.5) > step:  # the third derivative of a raised cosine turns its sign there
        assert acceleration * duration**2 == pytest.approx(
            progress_rates(np.array((share + step) * duration), duration, law)[0] * duration / (2 * step)
            - progress_rates(np.array((share - step) * duration), duration, law)[0] * duration / (2 * step),
            abs=1e-3,
        )
