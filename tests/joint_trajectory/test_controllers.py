"""Controllers: named joints and positive limits, and arms that are not their own."""

from __future__ import annotations

import re

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.joint_trajectory.controllers import CONTROLLERS, FR3, Braking, Controller, find_controller
from paretoik.joint_trajectory.controllers import PANDA as CONTROLLERS_PANDA
from tests.joint_trajectory.motions import PANDA as PANDA_ARM

TWO = {"name": "bench", "joint_names": ("joint1", "joint2"), "rate": 250}
PLANAR = pk.Arm.planar(lengths=[0.3, 0.2])


def test_limits_are_one_a_joint_and_infinite_where_there_is_none():
    mine = Controller(**TWO, position=([-1, -2], [3, 4]), velocity=1.5, jerk=[5, 6])
    assert mine.position.tolist() == [[-1, 3], [-2, 4]]
    assert (mine.velocity.tolist(), mine.jerk.tolist()) == ([1.5, 1.5], [5.0, 6.0])
    assert np.isinf([mine.acceleration, mine.torque, mine.torque_rate]).all()
    assert mine.arranged_for(PLANAR) is mine
    assert repr(mine) == "Controller('bench', 250 Hz, 2 joints)"


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"rate": 0}, "controller bench: rate: must be positive, got 0 Hz"),
        ({"velocity": [1, 2, 3]}, "controller bench: velocity must be one value or 2, one per joint, got [1, 2, 3]"),
        ({"position": (1.0, -1.0)}, "controller bench: position of joint 1 must be lower ≤ upper, got 1.0 and -1.0"),
        (
            {"other_joint_names": [("a", "b", "c")]},
            "controller bench: other_joint_names must have 2 names per list, got",
        ),
    ],
)
def test_what_is_no_controller_is_refused(changed, message, unchecked):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        Controller(**{**TWO, **changed})


def test_names_with_one_prefix_are_the_controllers_joints():
    mine = Controller(**TWO)
    assert mine.arranged_for(pk.Arm.from_dh(**SCARA, joint_names=("left_joint1", "left_joint2"))) is mine


@pytest.mark.parametrize("names", [("left_joint2", "left_joint1"), ("elbow", "shoulder")])
def test_joints_in_another_order_have_their_own_limits_there(names):
    braking = Braking(
        double_deceleration=np.array([1.0, 2.0]), offset=np.array([3.0, 4.0]), position=np.array([[-1.0, 3], [-2, 4]])
    )
    other = [("shoulder", "elbow")]
    mine = Controller(
        **TWO, position=([-1, -2], [3, 4]), velocity=[5, 6], torque_rate=7, braking=braking, other_joint_names=other
    )
    turned = mine.arranged_for(pk.Arm.from_dh(**SCARA, joint_names=names))
    assert turned.position.tolist() == [[-2, 4], [-1, 3]]
    assert (turned.velocity.tolist(), turned.torque_rate.tolist()) == ([6.0, 5.0], [7.0, 7.0])
    q = np.random.default_rng(0).uniform(-1, 3, (5, 2))
    np.testing.assert_array_equal(turned.velocity_bounds(q), mine.velocity_bounds(q[:, ::-1])[..., ::-1])
    back = turned.arranged_for(PLANAR)
    assert (back.joint_names, back.position.tolist()) == (("joint1", "joint2"), mine.position.tolist())


@pytest.mark.parametrize("names", [("left_joint1", "right_joint2"), ("a", "b")])
def test_joints_of_other_names_are_not_the_controllers(names):
    arm = pk.Arm.from_dh(**SCARA, joint_names=names, name="scara")
    wanted = (
        f"controller bench: joints must be joint1, joint2, with one prefix or none, got {', '.join(names)} of scara"
    )
    with pytest.raises(InvalidInput, match=re.escape(wanted)):
        Controller(**TWO).arranged_for(arm)


SCARA = {"a": [0.3, 0.2], "alpha": [0.0, 0.0], "d": [0.0, 0.0], "theta": [0.0, 0.0], "convention": "modified"}


# The controllers of robots on sale: their figures as the vendors write them elsewhere, and how one is found.


every_one = pytest.mark.parametrize("name", CONTROLLERS)


def named(joints, name="arm"):
    zeros = [0.0] * len(joints)
    lengths = [0.2] * len(joints)
    return pk.Arm.from_dh(
        a=lengths, alpha=zeros, d=zeros, theta=zeros, convention="modified", joint_names=joints, name=name
    )


def test_limits_of_the_panda_are_those_of_its_urdf():
    np.testing.assert_array_equal(CONTROLLERS_PANDA.position, PANDA_ARM.position_limits)
    np.testing.assert_array_equal(CONTROLLERS_PANDA.velocity, PANDA_ARM.velocity_limits)
    np.testing.assert_array_equal(CONTROLLERS_PANDA.torque, PANDA_ARM.torque_limits)


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
def test_each_controller_has_a_source_and_moves_the_joints_of_its_vendor(name):
    controller = CONTROLLERS[name]
    assert controller.name == name
    assert controller.source
    assert len(controller.joint_names) == len(controller.velocity) == (6 if name.startswith("ur") else 7)
    assert np.isfinite(controller.velocity).all()
    assert find_controller(name, named(controller.joint_names)) is controller


@pytest.mark.parametrize(
    ("family", "joints", "name", "found"),
    [
        ("franka", [f"left_fer_joint{i}" for i in range(1, 8)], "arm", "panda"),
        ("franka", FR3.joint_names[::-1], "arm", "fr3"),
        ("ur", CONTROLLERS["ur5e"].joint_names, "UR10e_robot", "ur10e"),
    ],
)
def test_a_family_finds_its_member_by_the_joints_or_the_name_of_the_arm(family, joints, name, found):
    assert find_controller(family, named(joints, name)).name == found


@pytest.mark.parametrize(
    ("name", "arm", "words"),
    [
        ("ur", named(CONTROLLERS["ur5e"].joint_names), "one of ur3e, ur5e, ur10e, ur16e, got 'ur': joints and name of"),
        ("kuka", PANDA_ARM, r"controller must be one of franka, ur, kinova, panda, fr3, .*, got"),
        ("kinova", PANDA_ARM, r"controller gen3: joints must be joint_1, .*, got panda_joint1, .* of panda"),
    ],
    ids=["several members", "unknown", "another maker"],
)
def test_a_controller_that_is_not_the_arms_is_refused_with_what_there_is(name, arm, words):
    with pytest.raises(InvalidInput, match=words):
        find_controller(name, arm)
