"""What a controller is: named joints and positive limits, and arms that are not its own."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.joint_trajectory.controllers import Braking, Controller
from tests.joint_trajectory.motions import PANDA

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
        ({"rate": "fast"}, "controller bench: rate: must hold real numbers, got text"),
        ({"velocity": [1, 2, 3]}, "controller bench: velocity wants one value or 2, one a joint, got [1, 2, 3]"),
        ({"jerk": -1.0}, "controller bench: jerk wants positive values, got -1.0"),
        ({"position": (1.0, -1.0)}, "controller bench: position of joint 1: wants lower ≤ upper, got 1.0 and -1.0"),
        ({"joint_names": ("a", "a")}, "joint_names: each joint once wanted, got a twice"),
        ({"joint_names": "ab"}, "joint_names: a list of joint names wanted, got 'ab'"),
        ({"other_joint_names": [("a", "b", "c")]}, "controller bench: other_joint_names: 2 in each list wanted, got"),
        ({"rest_acceleration": 1}, "controller bench: rest_acceleration: True or False wanted, got 1"),
    ],
)
def test_what_is_no_controller_is_refused(changed, message, unchecked):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        Controller(**{**TWO, **changed})


@pytest.mark.parametrize("names", [("left_joint1", "left_joint2"), ("joint1", "joint2")])
def test_names_with_one_prefix_are_the_controllers_joints(names):
    mine = Controller(**TWO)
    assert mine.arranged_for(pk.Arm.from_dh(**SCARA, joint_names=names)) is mine


@pytest.mark.parametrize("names", [("joint2", "joint1"), ("left_joint2", "left_joint1"), ("elbow", "shoulder")])
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


def test_a_controller_may_be_changed_in_one_thing():
    slower = replace(pk.controllers.PANDA, rate=500)
    assert slower.rate == 500
    np.testing.assert_array_equal(slower.position, pk.controllers.PANDA.position)


@pytest.mark.parametrize("names", [("left_joint1", "right_joint2"), ("a", "b"), ("joint1", "joint1_joint2")])
def test_joints_of_other_names_are_not(names):
    arm = pk.Arm.from_dh(**SCARA, joint_names=names, name="scara")
    wanted = (
        f"controller bench: wants the joints joint1, joint2, with one prefix or none, got {', '.join(names)} of scara"
    )
    with pytest.raises(InvalidInput, match=re.escape(wanted)):
        Controller(**TWO).arranged_for(arm)


def test_an_arm_with_a_joint_fixed_is_not_the_controllers():
    with pytest.raises(
        InvalidInput, match=r"panda: wants the joints panda_joint1, .* or fer_joint1, .*, got panda_joint1"
    ):
        pk.controllers.PANDA.arranged_for(PANDA.fixed(panda_joint3=0.0))


SCARA = {"a": [0.3, 0.2], "alpha": [0.0, 0.0], "d": [0.0, 0.0], "theta": [0.0, 0.0], "convention": "modified"}
