"""Samples of a motion: on its curve, its derivatives in scaled time, in any order of its joints."""

from __future__ import annotations

import re

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.task.retraction import ON_PATH_TOLERANCE, relative_errors
from tests.joint_trajectory.motions import MOTIONS, sampled

every_motion = pytest.mark.parametrize("name", MOTIONS)


@every_motion
def test_samples_that_are_the_motions_own_are_its_positions(name):
    motion = MOTIONS[name]
    trajectory = sampled(name, rate=2 * (len(motion.time) - 1) / float(motion.duration))
    np.testing.assert_allclose(trajectory.q[::2], motion.at(motion.time), atol=1e-12)
    np.testing.assert_allclose(trajectory.time[::2], motion.time, atol=1e-9)
    if motion.differences == "central":  # whose curve leads through its samples
        np.testing.assert_allclose(trajectory.q[::2], motion.q, atol=1e-11)


@every_motion
@pytest.mark.parametrize(("ramp", "factor"), [(0.0, 1.0), (0.2, 1.0), (0.1, 1.7)])
def test_every_sample_is_on_the_path_however_it_is_timed(name, ramp, factor):
    motion, trajectory = MOTIONS[name], sampled(name, 500.0, ramp, factor)
    if not motion.tasks:
        return
    # Where on the path a sample is: at the time of the motion at which it is, found again by its time scaling.
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


def test_slowed_down_its_rates_fall_and_its_positions_stay():
    own, slow = sampled(rate=400.0), sampled(rate=200.0, factor=2.0)
    np.testing.assert_allclose(slow.q, own.q, atol=1e-12)
    np.testing.assert_allclose(slow.dq, own.dq / 2, atol=1e-12)
    np.testing.assert_allclose(slow.ddq, own.ddq / 4, atol=1e-11)


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
        (["joint1", "joint2", "wrist"], "got 'wrist', which is none of them"),
        (["joint1", "joint2"], "got 'joint3', which is missing"),
        (["joint1", "joint2", "joint2"], "joint_names: each joint once wanted, got joint2 twice"),
        ("joint1", "joint_names: a list of joint names wanted, got 'joint1'"),
        ([1, 2, 3], "joint_names: a list of joint names wanted, got [1, 2, 3]"),
    ],
)
def test_joints_that_are_not_the_arms_are_refused(names, fact, unchecked):
    with pytest.raises(InvalidInput, match=re.escape(fact)):
        sampled("planar").reorder(names)
