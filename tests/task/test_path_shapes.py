"""Curves: straight, round and smooth, each through its ends, each a plain value that can be pickled."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.robot.pose import quaternion_to_matrix
from paretoik.task.path_shapes import TIME_LAWS, interpolate, progress, progress_rates
from tests.task.paths import EVERY_KIND

FIRST = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60  # differences of sixth order
SECOND = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180


@pytest.mark.parametrize("order", [1, 2])
def test_an_interpolation_whose_ends_meet_is_periodic(order):
    points = np.array([[0.0, 0.0], [1.0, 0.3], [0.4, 1.0], [0.0, 0.0]])
    spline = interpolate(np.linspace(0, 1, 4), points, None).positions
    np.testing.assert_allclose(spline(0.0, order), spline(1.0, order), atol=1e-12)


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


# Time laws: rest at both ends, symmetry, and the peaks of the papers


laws = st.sampled_from(TIME_LAWS)
durations = st.floats(0.01, 100.0)
shares = st.floats(0.0, 1.0)


@given(laws, durations, st.lists(shares, min_size=2, max_size=20))
def test_progress_never_goes_back_nor_leaves_zero_to_one(law, duration, taus):
    covered = progress(np.sort(taus) * duration, duration, law)
    assert (np.diff(covered) >= -1e-15).all()
    assert covered.min() >= -1e-15
    assert covered.max() <= 1 + 1e-15


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
