"""Frames, nodes and Jacobians; test_oracle compares them with Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.robot import kinematics
from paretoik.robot.arms import tringali_3r
from paretoik.robot.kinematics import arm_constants, characteristic_length, joint_scales


def test_a_frame_before_a_joint_does_not_feel_it(panda_arm):
    q = np.random.default_rng(5).normal(size=(4, 7))
    jacobian = kinematics.jacobian(panda_arm, q, "panda_link4")
    assert np.all(jacobian[:, :, 4:] == 0.0)
    assert np.abs(jacobian[:, :, :4]).max() > 0.1


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda arm: arm.pose([0.1, 0.2]), "q: must have shape \\(..., 3\\), one per joint, got shape"),
        (lambda arm: arm.pose([0.0] * 3, frame="hand"), "frame must be one of .*: tool, base, .* got 'hand'"),
    ],
)
def test_what_is_no_posture_or_no_frame_is_refused(call, message):
    with pytest.raises(InvalidInput, match=message.replace("tringali_3r", tringali_3r().name)):
        call(tringali_3r())


# Constants of an arm: regrouped inertias and exact right angles


def test_the_first_links_regrouped_inertia_is_that_of_the_arm_without_bends():
    # Khalil & Kleinfinger 1987: J_i + m_i c_i² + l_i² times the mass of all links further out.
    arm = tringali_3r()
    masses, centers = [body.mass for body in arm.bodies], [body.center[0] for body in arm.bodies]
    inertias, lengths = [body.inertia[2, 2] for body in arm.bodies], [0.176, 0.176, 0.1375]
    for i, link in enumerate(arm_constants(arm).links):
        expected = inertias[i] + masses[i] * centers[i] ** 2 + lengths[i] ** 2 * sum(masses[i + 1 :])
        np.testing.assert_allclose(link.inertia[2][2], expected, rtol=1e-14)


# An arm's length, which is the unit of slides


def test_an_arms_length_is_the_sum_of_its_links_wherever_it_is_mounted():
    arm = pk.Arm.planar(lengths=[0.3, 0.2, 0.1])
    assert characteristic_length(arm) == pytest.approx(0.6)
    assert characteristic_length(arm.mounted(base=pk.Pose([9.0, 0.0, 0.0]))) == pytest.approx(0.6)
    assert characteristic_length(arm.with_tool(pk.Pose([0.4, 0.0, 0.0]))) == pytest.approx(1.0)


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
