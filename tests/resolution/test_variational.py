"""The integration of motions: known solutions within tolerances, each motion by itself, starts that are refused."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik import kinetic_energy, line
from paretoik.errors import InvalidInput
from paretoik.resolution.variational import check_tolerance, integrate, starts_on_path
from paretoik.robot.arms import tringali_3r
from paretoik.robot.kinematics import forward_kinematics
from tests.self_motion.test_motion_starts import task_of

TIMES = np.linspace(0.0, 2.0, 11)
START = np.array([[1.0, 0.0], [0.0, 3.0], [0.5, -0.5]])


def oscillator(t, state):
    """x'' = −4 x."""
    return np.stack([state[:, 1], -4.0 * state[:, 0]], axis=1)


def exact(start, t):
    x, v = start[:, None, 0], start[:, None, 1]
    return np.stack([x * np.cos(2 * t) + v / 2 * np.sin(2 * t), v * np.cos(2 * t) - 2 * x * np.sin(2 * t)], axis=-1)


@pytest.mark.usefixtures("unchecked")  # the oscillator is no EquationOfMotion
def test_an_oscillator_is_integrated_the_better_the_finer_the_tolerance():
    coarse, fine = (
        np.abs(integrate(oscillator, START, TIMES, tolerance) - exact(START, TIMES)).max()
        for tolerance in (1e-5, 1e-11)
    )
    assert coarse < 1e-3
    assert fine < 1e-9 < coarse


@pytest.mark.usefixtures("unchecked")
def test_a_motion_is_the_same_bits_whoever_is_integrated_with_it():
    tolerances = np.array([1e-6, 1e-9, 1e-7])
    together = integrate(oscillator, START, TIMES, tolerances)
    for i in range(3):
        np.testing.assert_array_equal(
            together[i : i + 1], integrate(oscillator, START[i : i + 1], TIMES, tolerances[i])
        )


@pytest.mark.usefixtures("unchecked")
def test_a_motion_ends_where_its_rates_grow_without_bound():
    states = integrate(lambda t, y: y**2, np.array([[1.0], [0.1]]), TIMES, 1e-9)  # y = y₀ / (1 − y₀ t)
    assert np.isfinite(states[0, :5]).all()
    assert np.isnan(states[0, 6:]).all()
    np.testing.assert_allclose(states[1, :, 0], 0.1 / (1 - 0.1 * TIMES), rtol=1e-7)


def test_starts_off_the_path_and_tolerances_out_of_range_are_refused_and_others_lie_on_it():
    q = np.array([0.0, 0.327, -0.754])
    first = forward_kinematics(tringali_3r(), q)[1][:2]
    task = task_of(tringali_3r(), line(first, first - 0.05, duration=1.0, samples=11), objectives=[kinetic_energy])
    near = starts_on_path(task, q + 1e-8)
    np.testing.assert_allclose(forward_kinematics(tringali_3r(), near)[1][:2], first, atol=1e-11)
    with pytest.raises(InvalidInput, match=r"start 1 is .* off the path"):
        starts_on_path(task, np.stack([q, q + 0.1]))
    with pytest.raises(InvalidInput, match="tolerance must be"):
        check_tolerance(np.array([1e-6, 0.1]))
