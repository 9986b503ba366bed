"""The controllers of robots on sale: their figures as the vendors write them elsewhere, and how one is found."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.joint_trajectory.controllers import CONTROLLERS, FAMILIES, FR3, PANDA, find_controller
from tests.joint_trajectory.motions import PANDA as PANDA_ARM

every_one = pytest.mark.parametrize("name", CONTROLLERS)


def named(joints, name="arm"):
    zeros = [0.0] * len(joints)
    lengths = [0.2] * len(joints)
    return pk.Arm.from_dh(
        a=lengths, alpha=zeros, d=zeros, theta=zeros, convention="modified", joint_names=joints, name=name
    )


def test_limits_of_the_panda_are_those_of_its_urdf():
    np.testing.assert_array_equal(PANDA.position, PANDA_ARM.position_limits)
    np.testing.assert_array_equal(PANDA.velocity, PANDA_ARM.velocity_limits)
    np.testing.assert_array_equal(PANDA.torque, PANDA_ARM.torque_limits)


def test_velocity_limits_of_the_fr3_are_those_that_libfranka_computes():
    q = np.random.default_rng(0).uniform(*FR3.position.T, (200, 7))
    lower, upper = FR3.velocity_bounds(q)
    root = [lambda x: np.sqrt(np.maximum(0.0, x))] * 7
    theirs = [
        (2.62, 0.30, 12.0 * (2.75010 - q[:, 0]), 12.0 * (2.750100 + q[:, 0])),
        (2.62, 0.20, 5.17 * (1.79180 - q[:, 1]), 5.17 * (1.791800 + q[:, 1])),
        (2.62, 0.20, 7.00 * (2.90650 - q[:, 2]), 7.00 * (2.906500 + q[:, 2])),
        (2.62, 0.30, 8.00 * (-0.1458 - q[:, 3]), 8.00 * (3.048100 + q[:, 3])),
        (5.26, 0.35, 34.0 * (2.81010 - q[:, 4]), 34.0 * (2.810100 + q[:, 4])),
        (4.18, 0.35, 11.0 * (4.52050 - q[:, 5]), 11.0 * (-0.54092 + q[:, 5])),
        (5.26, 0.35, 34.0 * (3.01960 - q[:, 6]), 34.0 * (3.019600 + q[:, 6])),
    ]
    for joint, (most, offset, above, below) in enumerate(theirs):
        expected = np.minimum(most, np.maximum(0.0, -offset + root[joint](above)))
        np.testing.assert_allclose(upper[:, joint], expected, atol=1e-12)
        expected = np.maximum(-most, np.minimum(0.0, offset - root[joint](below)))
        np.testing.assert_allclose(lower[:, joint], expected, atol=1e-12)
    assert (upper < FR3.velocity - 0.01).any(axis=0).all()  # every joint brakes somewhere


@every_one
def test_each_says_its_source_and_moves_the_joints_of_its_vendor(name):
    controller = CONTROLLERS[name]
    assert controller.name == name
    assert controller.source
    assert len(controller.joint_names) == len(controller.velocity) == (6 if name.startswith("ur") else 7)
    assert np.isfinite(controller.velocity).all()
    assert find_controller(name, named(controller.joint_names)) is controller


@every_one
def test_limits_that_are_not_published_are_not_there(name):
    controller = CONTROLLERS[name]
    published = {kind for kind in ("acceleration", "jerk") if np.isfinite(getattr(controller, kind)).all()}
    expected = {"franka": {"acceleration", "jerk"}, "ur": set(), "kinova": {"acceleration"}}
    assert published == next(expected[family] for family, members in FAMILIES.items() if controller in members)


@pytest.mark.parametrize(
    ("family", "joints", "name", "found"),
    [
        ("franka", PANDA.joint_names, "arm", "panda"),
        ("franka", [f"left_fer_joint{i}" for i in range(1, 8)], "arm", "panda"),
        ("panda", [f"fer_joint{i}" for i in range(1, 8)], "arm", "panda"),
        ("franka", FR3.joint_names[::-1], "arm", "fr3"),
        ("franka", [f"left_{joint}" for joint in FR3.joint_names], "arm", "fr3"),
        ("kinova", CONTROLLERS["gen3"].joint_names, "arm", "gen3"),
        ("ur", CONTROLLERS["ur5e"].joint_names, "UR10e_robot", "ur10e"),
    ],
)
def test_a_family_finds_its_member_by_the_joints_or_the_name_of_the_arm(family, joints, name, found):
    assert find_controller(family, named(joints, name)).name == found


def test_a_family_that_leaves_a_choice_says_between_what():
    wanted = "controller 'ur': say which of ur3e, ur5e, ur10e, ur16e, as the joints and the name of arm do not"
    with pytest.raises(InvalidInput, match=wanted):
        find_controller("ur", named(CONTROLLERS["ur5e"].joint_names))


@pytest.mark.parametrize("wrong", ["kuka", "", None, 5, ["panda"]])
def test_an_unknown_controller_is_refused_with_those_that_are_known(wrong, unchecked):
    with pytest.raises(InvalidInput, match=r"controller: one of franka, ur, kinova, panda, fr3, .* wanted, got"):
        find_controller(wrong, PANDA_ARM)


def test_a_family_refuses_an_arm_of_another_maker():
    with pytest.raises(
        InvalidInput, match=r"controller gen3: wants the joints joint_1, .*, got panda_joint1, .* of panda"
    ):
        find_controller("kinova", PANDA_ARM)
