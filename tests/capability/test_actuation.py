"""Motors and sliders: curves, gears, and how fast and how strongly joints turn with the best of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.capability.actuation import JointActuation, MotorCurve, check_actuation, kim_sliders
from paretoik.capability.joint_capability import joint_speeds
from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm
from paretoik.robot.arms import marcos_nr, wan_7r
from tests.capability.drives import sliders

seeds = st.integers(0, 10**6)
STEP = 1e-30


@given(seed=seeds)
def test_gears_are_the_rates_of_the_rods_geometry(seed):
    rng = np.random.default_rng(seed)
    actuation = sliders(bend=rng.choice([-1.0, 1.0], 2))
    angle, front = rng.uniform(0.3, 1.9, 2), rng.uniform(0.03, 0.075, 2)
    q = actuation.zero + actuation.bend * angle
    back, a, b = actuation.gears(q, front)
    closed = front**2 + back**2 + 2 * front * back * np.cos(angle)
    assert np.allclose(closed, actuation.rod**2, rtol=1e-13)
    along = actuation.gears(q, front + 1j * STEP)[0].imag / STEP
    turned = actuation.gears(q + 1j * STEP, front)[0].imag / STEP
    assert np.allclose(along, -a / b, rtol=1e-11)
    assert np.allclose(turned, 1 / b, rtol=1e-11)


def test_motors_of_an_arm_are_its_own_limits():
    arm = wan_7r()
    motors = JointActuation.of(arm).motors
    assert np.array_equal(motors.fastest, arm.velocity_limits)
    assert np.isinf(motors.stall).all()
    assert np.array_equal(motors.speeds(np.full(7, 1e6))[1], arm.velocity_limits)
    with pytest.raises(InvalidInput, match="joint1 wants a velocity limit"):
        JointActuation.of(marcos_nr(3))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: MotorCurve(stall=[1.0, 0.0], fastest=[1.0, 1.0]), "stall wants positive numbers"),
        (lambda: MotorCurve(stall=[1.0], fastest=[np.inf]), "fastest wants finite speeds"),
        (lambda: MotorCurve(stall=[1.0], fastest=[np.nan]), "fastest wants positive numbers"),
        (lambda: MotorCurve(stall=[1.0, 1.0], fastest=[1.0]), "2 fastest wanted, one for each stall, got 1"),
        (lambda: MotorCurve(stall="abc", fastest=[1.0]), "stall wants positive numbers"),
        (lambda: MotorCurve(stall=[[1.0], [2.0, 3.0]], fastest=[1.0]), "stall wants positive numbers"),
        (lambda: JointActuation(motors=[1.0]), "motors wants a MotorCurve"),
        (lambda: JointActuation.of(None), "an Arm wanted"),
        (lambda: sliders(back_bounds=(1.0, 2.0)), "sliders that reach a rod's angle"),
        (lambda: MotorCurve(stall=1.0, fastest=1.0, shape="round"), "shape must be one of diamond"),
        (lambda: sliders(rod=[0.08, -0.1]), "joint 2: a rod longer than 0"),
        (lambda: sliders(rod=[0.07, 0.09]), "joint 1: front sliders no farther"),
        (lambda: sliders(bend=0.5), "joint 1: bend 1 or −1 wanted, got 0.5"),
        (lambda: sliders(zero=[0.0, np.nan]), "zero: must be finite"),
        (lambda: sliders(front_bounds=(0.07, 0.03)), "front bounds 0 < lower ≤ upper wanted"),
        (lambda: sliders(back_bounds=(0.0, 0.03)), "back bounds 0 < lower ≤ upper wanted"),
        (lambda: sliders(rod=[0.08, 0.08, 0.08]), "rod wants shape"),
        (lambda: sliders(back=MotorCurve(stall=1.0, fastest=1.0)), "back wants 2 motors"),
        (lambda: sliders(least_angle=0.0), "a least angle between 0 and π"),
        (lambda: check_actuation(kim_sliders(), marcos_nr(4)), "4 joints of Marcos 4R wanted, got 3"),
        (lambda: check_actuation("motors", marcos_nr(4)), "a JointActuation or DistributedActuation wanted"),
        (lambda: joint_speeds(kim_sliders(), np.zeros(2), np.zeros(2)), r"arrays \(..., 3\) wanted"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_what_cannot_be_is_refused_by_name(make, said):
    with pytest.raises(InvalidInput, match=said):
        make()


def test_rods_turn_joints_and_slide_none():
    table = {"a": [0.1, 0.1], "alpha": [0.0, 0.0], "d": [0.0, 0.0], "theta": [0.0, 0.0]}
    arm = Arm.from_dh(**table, convention="standard", types=["revolute", "prismatic"])
    with pytest.raises(InvalidInput, match="joint2 of DH arm slides"):
        check_actuation(sliders(), arm)
