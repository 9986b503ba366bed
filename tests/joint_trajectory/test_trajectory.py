"""Samples of a motion: on its curve, its derivatives in scaled time, in any order of its joints."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.errors import InvalidInput
from paretoik.joint_trajectory.trajectory import TimeScaling, time_scaling
from paretoik.task.retraction import ON_PATH_TOLERANCE, relative_errors
from tests.joint_trajectory.motions import MOTIONS, sampled

every_motion = pytest.mark.parametrize("name", MOTIONS)


@every_motion
def test_samples_that_are_the_motions_own_are_its_positions(name):
    motion = MOTIONS[name]
    trajectory = sampled(name, rate=2 * (len(motion.time) - 1) / float(motion.duration))
    np.testing.assert_allclose(trajectory.q[::2], motion.at(motion.time), atol=1e-12)
    np.testing.assert_allclose(trajectory.time[::2], motion.time, atol=1e-9)
    if motion.differences == "central":  # its curve leads through its samples
        np.testing.assert_allclose(trajectory.q[::2], motion.q, atol=1e-11)


@every_motion
@pytest.mark.parametrize(("ramp", "factor"), [(0.0, 1.0), (0.1, 1.7)])
def test_every_sample_is_on_the_path_however_it_is_timed(name, ramp, factor):
    motion, trajectory = MOTIONS[name], sampled(name, 100.0, ramp, factor)
    if not motion.tasks:
        return
    # The place of a sample on the path: at its time of the motion, found from its time scaling.
    share = np.arange(len(trajectory.time)) / (len(trajectory.time) - 1) * (1.0 + ramp)
    from_end = np.minimum(share, 1.0 + ramp - share)
    x = np.clip(from_end / ramp, 0, 1) if ramp else np.ones_like(share)
    covered = np.where(x < 1, ramp * (x**6 - 3 * x**5 + 2.5 * x**4), from_end - ramp / 2)
    at = np.where(share > (1 + ramp) / 2, 1.0 - covered, covered)
    targets = np.concatenate([task.targets(np.clip(at, 0.0, 1.0)) for task in motion.tasks], axis=1)
    errors, _ = relative_errors(motion.arm, motion.tasks, trajectory.q, targets)
    assert np.abs(errors).max() < 10 * ON_PATH_TOLERANCE


@every_motion
@pytest.mark.parametrize(("ramp", "factor"), [(0.0, 1.0), (0.3, 1.5)])
def test_velocities_and_accelerations_are_those_of_the_positions_in_their_own_time(name, ramp, factor):
    trajectory = sampled(name, 2000.0, ramp, factor)
    step = trajectory.time[1]
    velocity = (trajectory.q[2:] - trajectory.q[:-2]) / (2 * step)
    acceleration = (trajectory.dq[2:] - trajectory.dq[:-2]) / (2 * step)
    np.testing.assert_allclose(trajectory.dq[1:-1], velocity, atol=2e-5 * (1 + np.abs(velocity).max()))
    np.testing.assert_allclose(trajectory.ddq[1:-1], acceleration, atol=2e-2 * (1 + np.abs(acceleration).max()))


def test_columns_come_in_the_order_that_is_asked_for_by_name():
    trajectory = sampled("planar")
    turned = trajectory.reorder(["joint3", "joint1", "joint2"])
    assert turned.joint_names == ("joint3", "joint1", "joint2")
    for name in ("q", "dq", "ddq"):
        np.testing.assert_array_equal(getattr(turned, name), getattr(trajectory, name)[:, [2, 0, 1]])
    with pytest.raises(ValueError, match="read-only"):
        turned.q[0, 0] = 0.0


@pytest.mark.parametrize(
    ("names", "fact"),
    [
        (["joint1", "joint2", "wrist"], "got the unknown 'wrist'"),
        (["joint1", "joint2"], "got no 'joint3'"),
    ],
)
def test_joints_that_are_not_the_arms_are_refused(names, fact, unchecked):
    with pytest.raises(InvalidInput, match=re.escape(fact)):
        sampled("planar").reorder(names)


# Time scalings: monotone, exact at both ends, as smooth as they say, and never faster than the motion.


durations = st.floats(0.3, 20.0)
rates = st.sampled_from([50.0, 125.0, 300.0, 1000.0])


@given(durations, rates, st.floats(1.0, 3.0), st.just(0.0) | st.floats(0.02, 0.3))
@settings(max_examples=40)
def test_a_time_scaling_leads_from_0_to_the_duration_without_turning_back(duration, rate, factor, ramp):
    scaling = time_scaling(duration, rate, time_scale=factor, ramp=ramp)
    sigma, speed, _ = scaling.evaluate()
    assert (sigma[0], sigma[-1]) == (0.0, duration)
    assert np.diff(sigma).min() >= 0
    assert factor <= scaling.factor * (1 + 1e-9) <= factor + 1 / (rate * duration) + 1e-8
    assert speed.min() >= 0
    assert speed.max() <= 1 / factor + 1e-12
    np.testing.assert_allclose(np.diff(scaling.times()), 1 / rate, atol=1e-9)


@given(durations, rates, rates, st.just(0.0) | st.floats(0.05, 0.3))
@settings(max_examples=40)
def test_a_time_scaling_is_the_same_law_at_another_rate(duration, rate, other, ramp):
    scaling = time_scaling(duration, rate, ramp=ramp)
    times, values = scaling.times(other), scaling.evaluate(other)
    dense = np.stack([np.interp(times, scaling.times(), own) for own in scaling.evaluate()])
    assert values.shape == (3, len(times))
    assert (values[0, 0], values[0, -1]) == (0.0, duration)
    assert -1e-6 <= times[-1] - scaling.times()[-1] < 1 / other
    np.testing.assert_allclose(values[0], dense[0], atol=2 / rate**2 * (1 + 2 / max(ramp, 0.05)))
    np.testing.assert_array_equal(scaling.evaluate(rate), scaling.evaluate())


@given(durations, st.floats(0.05, 1.0))
@settings(max_examples=40)
def test_rates_of_a_time_scaling_are_its_derivatives(duration, share):
    scaling = TimeScaling(duration=duration, periods=4000, rate=4000 / duration / 1.3, ramp=share * duration)
    sigma, speed, bend = scaling.evaluate()
    step = 1 / scaling.rate
    np.testing.assert_allclose(speed[1:-1], (sigma[2:] - sigma[:-2]) / (2 * step), atol=2e-5 / share**2)
    np.testing.assert_allclose(bend[1:-1], (speed[2:] - speed[:-2]) / (2 * step), atol=2e-4 / share**3 / duration)


@given(durations, st.floats(0.05, 0.3))
@settings(max_examples=40)
def test_a_ramp_starts_and_stops_with_neither_velocity_nor_acceleration_and_costs_its_own_time(duration, ramp):
    scaling = time_scaling(duration, 1000.0, ramp=ramp)
    _, speed, bend = scaling.evaluate()
    assert np.abs([speed[[0, -1]], bend[[0, -1]]]).max() == 0.0
    assert scaling.times()[-1] == pytest.approx(duration + ramp, abs=1.01e-3)
    assert speed[np.searchsorted(scaling.times(), ramp) + 1] == pytest.approx(1 / scaling.factor, abs=1e-6)


@pytest.mark.parametrize("rate", [300.0, 7.0])
def test_times_are_whole_nanoseconds_that_ros_keeps_exactly(rate):
    times = time_scaling(3.0, rate).times()
    nanoseconds = np.rint(times * 1e9).astype(int)
    np.testing.assert_array_equal(nanoseconds / 1e9, times)
    np.testing.assert_allclose(nanoseconds, np.arange(len(times)) * 1e9 / rate, atol=0.5)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"time_scale": 0.5}, "time_scale must be 1 or more, to slow down, got 0.5"),
        ({"ramp": 1.1}, "ramp must be 0, or from one period to the motion's 1 s, got 1.1 s"),
        ({"rate": 2.0}, "from 3 to 1000000 periods, got 2 Hz for 1 s"),
    ],
)
def test_what_is_no_scaling_is_refused(changed, message):
    with pytest.raises(InvalidInput, match=message):
        time_scaling(**{"duration": 1.0, "rate": 100.0, **changed})
