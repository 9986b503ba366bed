"""Sliders of random rods, at loads up to nearly their capacity, compared with a scan of all their places."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.capability.actuation import SHAPES, DistributedActuation, MotorCurve
from paretoik.capability.joint_capability import joint_speeds, torque_capacity
from paretoik.errors import InvalidInput

PLACES = 2001
SHARES = (0.3, 0.7, 0.9, 0.99, 0.999, 0.9999)


def rods(rng, shape="diamond", stalls=(10.0, 100.0)):
    """Return the geometry of a rod that may or may not reach an angle, and its motors."""
    rod = rng.uniform(0.05, 0.2)
    low, other = rod * rng.uniform(0.1, 0.8), rod * rng.uniform(0.1, 1.5)
    high = min(rod, low * rng.uniform(1.02, 3.0))
    front, back = (
        MotorCurve(stall=[rng.uniform(*stalls)], fastest=[rng.uniform(0.002, 0.02)], shape=shape) for _ in range(2)
    )
    return {
        "front": front,
        "back": back,
        "rod": rod,
        "front_bounds": (low, high),
        "back_bounds": (other, other * rng.uniform(1.02, 3.0)),
        "zero": rng.uniform(-3.0, 3.0),
        "bend": rng.choice([-1.0, 1.0]),
        "least_angle": rng.uniform(0.02, 0.3),
    }


def reaching(rng, shape="diamond", **changed):
    """Return the sliders of the next random rod that reaches an angle."""
    while True:
        try:
            return DistributedActuation(**rods(rng, shape) | changed)
        except InvalidInput:
            continue


def gears_at(actuation, angle, front):
    """Return back sliders and both gears from the rod's length; NaN if the back slider exceeds its bounds."""
    cosine, sine = np.cos(angle), np.sin(angle)
    back = -front * cosine + np.sqrt(actuation.rod**2 - (front * sine) ** 2)
    low, high = actuation.back_bounds[0]
    back = np.where((back >= low) & (back <= high), back, np.nan)
    across = front * back * sine * actuation.bend
    return np.stack([(front + back * cosine) / across, (back + front * cosine) / across])


def fastest_at(actuation, gears, torque):
    """Return the highest joint speed with given gears, motors at their limits; NaN if one cannot bear its effort."""
    speed = 0.0
    for gear, curve in zip(gears, (actuation.front, actuation.back), strict=True):
        share = gear * torque / curve.stall * np.sign(gear)
        room = {"diamond": 1 - abs(share), "strip": np.minimum(1.0, 1 - share), "box": np.ones_like(share)}[curve.shape]
        speed = speed + np.where(abs(share) <= 1.0, abs(gear) * curve.fastest * room, np.nan)
    return speed


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seed", range(4))
def test_no_place_of_thousands_turns_a_joint_faster_however_little_it_can_hold_beyond_its_load(seed, shape):
    rng = np.random.default_rng(seed)
    actuation = reaching(rng, shape)
    front = np.linspace(*actuation.front_bounds[0], PLACES)[:, None]
    lowest_angle, highest_angle = actuation.angle_bounds[0]
    angle = np.repeat(lowest_angle + (highest_angle - lowest_angle) * rng.uniform(0.0, 1.0, 12), len(SHARES))
    q = (actuation.zero + actuation.bend * angle)[:, None]
    able = torque_capacity(actuation, q)[0]
    gears = gears_at(actuation, angle, front)
    with np.errstate(divide="ignore"):
        hold = np.min([actuation.front.stall / abs(gears[0]), actuation.back.stall / abs(gears[1])], axis=0)
    assert (np.nan_to_num(hold).max(axis=0) <= np.nan_to_num(able[:, 0]) * (1 + 1e-9)).all()
    torque = able * np.tile(SHARES, 12)[:, None] * rng.choice([-1.0, 1.0], len(q))[:, None]
    speeds = joint_speeds(actuation, q, torque)
    assert np.array_equal(np.isnan(speeds.high), np.isnan(able))
    for ours, place, turned in ((speeds.high, speeds.front_high, torque), (-speeds.low, speeds.front_low, -torque)):
        brute = np.nan_to_num(fastest_at(actuation, gears, turned[:, 0]), nan=0.0).max(axis=0)
        assert (brute <= np.nan_to_num(ours[:, 0]) * (1 + 1e-9)).all()
        held = ~np.isnan(ours[:, 0])
        own = fastest_at(actuation, gears_at(actuation, angle[held], place[held, 0]), turned[held, 0] * (1 - 1e-9))
        fits = ~np.isnan(own)  # at its bound a slider may exceed it by rounding
        assert fits.mean() > 0.5
        assert own[fits] == pytest.approx(ours[held, 0][fits], rel=1e-4)


@pytest.mark.parametrize("shape", SHAPES)
def test_no_load_that_some_place_can_hold_is_refused(shape):
    rng, refused = np.random.default_rng(5), 0
    for _ in range(20):
        actuation = reaching(rng, shape)
        front = np.linspace(*actuation.front_bounds[0], PLACES)[:, None]
        angle = rng.uniform(*actuation.angle_bounds[0], 40)
        q = (actuation.zero + actuation.bend * angle)[:, None]
        torque = rng.uniform(0.9, 1.1, (40, 1)) * np.nan_to_num(torque_capacity(actuation, q)[0], nan=1.0)
        brute = ~np.isnan(fastest_at(actuation, gears_at(actuation, angle, front), torque[:, 0])).all(axis=0)
        ours = ~np.isnan(joint_speeds(actuation, q, torque).high[:, 0])
        assert (brute <= ours).all()
        refused += int((~ours).sum())
    assert 100 < refused < 700


def test_a_motor_that_bears_any_load_leaves_the_other_to_its_own():
    rng = np.random.default_rng(0)
    for _ in range(20):
        curves = MotorCurve(stall=[20.0], fastest=[0.01]), MotorCurve(stall=[np.inf], fastest=[0.01])
        actuation = reaching(rng, **dict(zip(("front", "back"), rng.permutation(curves), strict=True)))
        front = np.linspace(*actuation.front_bounds[0], PLACES)[:, None]
        angle = rng.uniform(*actuation.angle_bounds[0], 10)
        q, torque = (actuation.zero + actuation.bend * angle)[:, None], rng.uniform(-3.0, 3.0, (10, 1))
        brute = fastest_at(actuation, gears_at(actuation, angle, front), torque[:, 0])
        ours = joint_speeds(actuation, q, torque).high[:, 0]
        assert (np.isnan(brute).all(axis=0) >= np.isnan(ours)).all()
        assert (np.nan_to_num(brute).max(axis=0) <= np.nan_to_num(ours) * (1 + 1e-9)).all()
