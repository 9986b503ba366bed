"""Motors and sliders: curves, gears, and the highest speeds and torques of joints."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.capability.actuation import SHAPES, JointActuation, MotorCurve, angle_range, check_actuation, kim_sliders
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
    with pytest.raises(InvalidInput, match="joint1 must have a velocity limit"):
        JointActuation.of(marcos_nr(3))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: MotorCurve(stall=[1.0, 0.0], fastest=[1.0, 1.0]), "stall must be positive numbers"),
        (lambda: MotorCurve(stall=[1.0, 1.0], fastest=[1.0]), "fastest must be 2 numbers, one per stall, got 1"),
        (lambda: JointActuation(motors=[1.0]), "motors must be a MotorCurve"),
        (lambda: MotorCurve(stall=1.0, fastest=1.0, shape="round"), "shape must be one of diamond"),
        (lambda: sliders(back_bounds=(0.0, 0.03)), "back bounds must be 0 < lower ≤ upper"),
        (lambda: check_actuation(kim_sliders(), marcos_nr(4)), "4 joints of Marcos 4R, got 3"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_what_cannot_be_is_refused_by_name(make, said):
    with pytest.raises(InvalidInput, match=said):
        make()


def test_rods_turn_joints_and_slide_none():
    table = {"a": [0.1, 0.1], "alpha": [0.0, 0.0], "d": [0.0, 0.0], "theta": [0.0, 0.0]}
    arm = Arm.from_dh(**table, convention="standard", types=["revolute", "prismatic"])
    with pytest.raises(InvalidInput, match=r"no prismatic joints .*, got joint2 of DH arm"):
        check_actuation(sliders(), arm)


# Speeds of motors under a load, by the shape of their curve.


shapes = st.sampled_from(SHAPES)


@given(seed=seeds, shape=shapes)
def test_a_curve_allows_exactly_the_speeds_with_slacks_not_negative(seed, shape):
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


# Angles of rods compared with all pairs of their sliders, and impossible geometry.


def test_a_rods_angles_are_those_of_all_pairs_of_sliders():
    rng, reached, refused = np.random.default_rng(1), 0, 0
    for _ in range(200):
        rod, margin = rng.uniform(0.05, 0.2), rng.uniform(0.02, 0.3)
        first, second = rod * rng.uniform(0.1, 0.8), rod * rng.uniform(0.1, 1.5)
        bounds = (
            np.array([first, min(rod, first * rng.uniform(1.02, 3.0))]),
            second * np.array([1, rng.uniform(1.02, 3)]),
        )
        front, back = (np.linspace(*pair, 301) for pair in bounds)
        cosine = (rod**2 - front[:, None] ** 2 - back**2) / (2 * front[:, None] * back)
        angles = np.arccos(cosine[np.abs(cosine) <= 1.0])
        inside = angles[(angles >= margin) & (angles <= np.pi - margin)]
        if not len(inside):
            refused += 1
            with pytest.raises(InvalidInput, match="sliders must reach a rod's angle"):
                angle_range(rod, *bounds, margin)
            continue
        reached += 1
        low, high = angle_range(rod, *bounds, margin)
        assert low <= inside.min() + 1e-9
        assert high >= inside.max() - 1e-9
        assert low == pytest.approx(max(angles.min(), margin), abs=0.02)
        assert high == pytest.approx(min(angles.max(), np.pi - margin), abs=0.02)
    assert reached > 100
    assert refused > 5
