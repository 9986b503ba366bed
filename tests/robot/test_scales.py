"""An arm's length is that from its first joint to its tool; slides are measured in it."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.robot.kinematics import characteristic_length, joint_scales


def gantry(limits):
    """Three slides at one place."""
    return pk.Arm.from_dh(
        a=[0.0, 0.0, 0.0],
        alpha=[0.0, np.pi / 2, np.pi / 2],
        d=[0.0, 0.0, 0.0],
        theta=[0.0, np.pi / 2, 0.0],
        types=["prismatic"] * 3,
        position_limits=limits,
        convention="modified",
    )


def test_an_arms_length_is_the_sum_of_its_links_wherever_it_is_mounted():
    arm = pk.Arm.planar(lengths=[0.3, 0.2, 0.1])
    assert characteristic_length(arm) == pytest.approx(0.6)
    assert characteristic_length(arm.mounted(base=pk.Pose([9.0, 0.0, 0.0]))) == pytest.approx(0.6)
    assert characteristic_length(arm.with_tool(pk.Pose([0.4, 0.0, 0.0]))) == pytest.approx(1.0)


def test_slides_without_links_are_measured_in_the_longest_of_their_ranges():
    lengths = [characteristic_length(gantry(limits)) for limits in (None, [0.5, 2.0, np.inf])]
    assert lengths == [1.0, 4.0]


def test_joints_that_turn_are_measured_in_radians_and_slides_in_the_arms_length():
    arm = pk.Arm.from_dh(
        a=[0.0, 0.5],
        alpha=[0.0, 0.0],
        d=[0.0, 0.0],
        theta=[0.0, 0.0],
        types=["prismatic", "revolute"],
        convention="modified",
    ).with_tool(pk.Pose([1.5, 0.0, 0.0]))
    np.testing.assert_allclose(joint_scales(arm), [2.0, 1.0])
