"""Motors and sliders: curves, gears, and how fast and how strongly joints turn with the best of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.capability.actuation import DistributedActuation, JointActuation, check_actuation
from paretoik.capability.joint_capability import joint_speeds, overload_error, torque_capacity
from paretoik.capability.kim_actuations import kim_joint_motors, kim_sliders
from paretoik.capability.motor_curves import SHAPES, MotorCurve
from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm
from paretoik.robot.arms import kim_3r, marcos_nr, wan_7r

seeds = st.integers(0, 10**6)
shapes = st.sampled_from(SHAPES)
STEP = 1e-30


def sliders(shape="diamond", bend=1.0, **changed):
    motors = MotorCurve(stall=[60.0, 40.0], fastest=[0.01, 0.02], shape=shape)
    given = {"rod": [0.08, 0.09], "front_bounds": (0.03, 0.075), "back_bounds": (0.02, 0.085), "zero": [0.3, -0.2]}
    return DistributedActuation(front=motors, bend=bend, **{**given, **changed})


@given(seed=seeds, shape=shapes)
def test_what_a_curve_allows_is_where_its_room_is_not_negative(seed, shape):
    rng = np.random.default_rng(seed)
    curve = MotorCurve(stall=[2.0, 0.5], fastest=[3.0, 7.0], shape=shape)
    effort, speed = curve.stall * rng.uniform(-1.2, 1.2, (50, 2)), curve.fastest * rng.uniform(-1.2, 1.2, (50, 2))
    low, high = curve.speeds(effort)
    within, room = (low <= speed) & (speed <= high), curve.slacks(effort, speed).min(axis=-1)
    assert (room[within] >= -1e-12).all()
    assert (room[~within] <= 1e-12).all()


def test_a_diamond_is_the_papers_curve_a_strip_lets_a_load_drive_the_motor():
    effort = np.array([-1.0, 0.0, 1.0])[:, None]
    speeds = {shape: MotorCurve(stall=2.0, fastest=4.0, shape=shape).speeds(effort) for shape in SHAPES}
    assert np.ravel(speeds["diamond"][1]).tolist() == [2.0, 4.0, 2.0]
    assert np.ravel(speeds["strip"][1]).tolist() == [4.0, 4.0, 2.0]
    assert np.ravel(speeds["strip"][0]).tolist() == [-2.0, -4.0, -4.0]
    assert np.ravel(speeds["box"][0]).tolist() == [-4.0, -4.0, -4.0]


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


@given(seed=seeds, shape=shapes)
@settings(max_examples=25)
def test_no_slider_turns_a_joint_faster_than_the_best(seed, shape):
    rng = np.random.default_rng(seed)
    actuation = sliders(shape, bend=rng.choice([-1.0, 1.0], 2), least_angle=0.05)
    q = actuation.zero + actuation.bend * rng.uniform(0.0, 2.2, (6, 2))
    torque = rng.normal(size=(6, 2)) * rng.choice([0.05, 0.5, 2.0])
    found, able = joint_speeds(actuation, q, torque), torque_capacity(actuation, q)[0]
    front = np.linspace(*actuation.front_bounds[0], 4001)[:, None, None] + np.zeros_like(q)
    q = np.broadcast_to(q, front.shape)
    with np.errstate(invalid="ignore"):
        back, a, b = actuation.gears(q, front)
        fits = (back >= actuation.back_bounds[:, 0]) & (back <= actuation.back_bounds[:, 1])
        fits &= actuation.angles(q) >= actuation.least_angle
        limits = [np.sort([a * s for s in actuation.front.speeds(a * torque)], axis=0)]
        limits += [np.sort([b * s for s in actuation.back.speeds(b * torque)], axis=0)]
        low, high = sum(each[0] for each in limits), sum(each[1] for each in limits)
        hold = np.minimum(actuation.front.stall / abs(a), actuation.back.stall / abs(b))
    held = fits & ~np.isnan(high)
    assert (held <= ~np.isnan(found.high)).all()
    high, low, hold = (np.where(held, high, 0.0), np.where(held, low, 0.0), np.where(fits, hold, 0.0))
    assert (high <= np.nan_to_num(found.high) * (1 + 1e-9)).all()
    assert (low >= np.nan_to_num(found.low) * (1 + 1e-9)).all()
    assert (hold <= np.nan_to_num(able) * (1 + 1e-9)).all()


@given(seed=seeds, shape=shapes)
@settings(max_examples=25)
def test_the_best_slider_gives_the_speed_that_is_said_of_it(seed, shape):
    rng = np.random.default_rng(seed)
    actuation = sliders(shape, bend=-1.0)
    q = actuation.zero - rng.uniform(0.2, 2.0, (8, 2))
    torque = rng.normal(size=(8, 2))
    found = joint_speeds(actuation, q, torque)
    can = ~np.isnan(found.high)
    back, a, b = actuation.gears(q, np.where(can, found.front_high, 0.05))
    speeds = [np.where(g > 0, *reversed(c.speeds(g * torque))) for g, c in ((a, actuation.front), (b, actuation.back))]
    assert np.allclose((a * speeds[0] + b * speeds[1])[can], found.high[can], rtol=1e-12)
    assert (back[can] >= actuation.back_bounds[0, 0] - 1e-12).all()
    assert (back[can] <= actuation.back_bounds[0, 1] + 1e-12).all()


def test_sliders_hold_exactly_what_they_can_bear():
    actuation = kim_sliders()
    q = actuation.zero + np.array([0.9, 1.2, 1.9])
    able, _ = torque_capacity(actuation, q)
    assert np.isfinite(joint_speeds(actuation, q, 0.999999 * able).high).all()
    assert np.isnan(joint_speeds(actuation, q, 1.000001 * able).high).all()


def test_a_joint_beyond_what_its_rod_reaches_cannot_hold():
    actuation = kim_sliders()
    for angle in (0.0, 0.1, np.deg2rad(117.5), -0.5):
        q = actuation.zero + np.full(3, angle)
        assert np.isnan(joint_speeds(actuation, q, np.zeros(3)).high).all()
        assert np.isnan(torque_capacity(actuation, q)[0]).all()
    turned = actuation.zero + 1.0
    again = joint_speeds(actuation, turned + 2 * np.pi, np.zeros(3)).high
    assert np.allclose(again, joint_speeds(actuation, turned, np.zeros(3)).high)


def test_an_overload_names_joint_torque_and_limit():
    arm = kim_3r()
    said = overload_error(kim_joint_motors(), arm, np.zeros(3), np.array([1.0, 4.0, 0.1]))
    assert "joint2: a torque of at most 3.5 N m wanted" in str(said)
    assert said.violation == pytest.approx(4.0 / 3.5 - 1)
    assert "joint1: a rod's angle" in str(overload_error(kim_sliders(), arm, np.full(3, 3.0), np.zeros(3)))


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
