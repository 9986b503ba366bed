"""The best that postures do: the same in any turn of joints and rods, from any seed, and in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.capability.actuation import SHAPES
from paretoik.capability.joint_capability import torque_capacity
from problems import panda
from tests.capability.drives import motors, planar, rods

WAYS = np.array([[1.0, 0.2], [-0.3, 1.0], [-1.0, -0.7], [0.6, -1.0]])
QUANTITIES = ("velocity", "force")
UNIT = WAYS / np.linalg.norm(WAYS, axis=1, keepdims=True)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_limits_a_turn_away_change_no_maximum(quantity):
    actuation = motors([9.0, 7.0, 5.0, 3.0])
    low, high = np.array([-1.5, -2.0, 0.2, -2.0]), np.array([1.5, 2.0, 2.5, 2.0])
    one, other = (
        pk.directional_maxima(
            planar(4, limits=(low + turn, high + turn)), actuation, [0.5, 0.2], UNIT, quantity=quantity, starts=100
        )
        for turn in (0.0, 2 * np.pi * np.array([1, -1, 0, 2]))
    )
    assert other.values == pytest.approx(one.values, rel=1e-7)
    assert (other.q[:, 3] >= low[3] + 4 * np.pi - 1e-9).all()


@pytest.mark.parametrize(("dof", "turns"), [(3, [1, 0, 0]), (3, [-1, 2, -3]), (4, [-1, 2, 0, -3])])
def test_a_rods_zero_a_turn_away_changes_nothing(dof, turns):
    arm, zero = planar(dof, length=0.114, mass=0.3), np.deg2rad([-120.0, 0.0, 0.0, 0.0])[:dof]
    drives = [rods(dof, zero + 2 * np.pi * np.array(each)) for each in ([0] * dof, turns)]
    place = [0.2, -0.15]
    for quantity in QUANTITIES:
        one, other = (
            pk.directional_maxima(arm, each, place, UNIT[:2], quantity=quantity, starts=40).values for each in drives
        )
        assert other == pytest.approx(one, rel=1e-7)
    problems = [pk.DirectionalMaxima(arm, each, place, UNIT[:2], starts=60) for each in drives]
    genes = problems[0].sample_starts(20, np.random.default_rng(0))
    values = [each.evaluate(genes, return_values_of=["F", "G"]) for each in problems]
    assert values[1][0] == pytest.approx(values[0][0], rel=1e-6, abs=1e-9)
    assert np.array_equal(values[1][1] <= 1e-6, values[0][1] <= 1e-6)


@pytest.mark.parametrize("shape", SHAPES)
def test_an_arm_of_two_joints_does_what_its_two_postures_allow(shape):
    arm, actuation, place = planar(2, mass=1.0), motors([6.0, 2.0], shape), np.array([0.35, 0.1])
    directions = UNIT[:2]
    reach = np.linalg.norm(place)
    elbow = np.arccos(reach**2 / (2 * 0.3**2) - 1.0) * np.array([1.0, -1.0])
    q = np.stack([np.arctan2(place[1], place[0]) - elbow / 2, elbow], axis=1)
    x = np.stack([np.cos(q[:, 0]), np.cos(q.sum(axis=1))])
    load = 9.81 * 0.15 * np.array([3 * x[0] + x[1], x[1]]).T
    share = load / actuation.motors.stall
    assert (np.abs(share) < 1.0).all()
    room = {"diamond": [1 - abs(share)] * 2, "box": [1 + 0 * share] * 2}
    room["strip"] = [np.minimum(1.0, 1 + share), np.minimum(1.0, 1 - share)]
    low, high = (sign * each * actuation.motors.fastest for sign, each in zip((-1, 1), room[shape], strict=True))
    first = np.array([[-place[1], place[0]]] * 2)
    second = 0.3 * np.stack([-np.sin(q.sum(axis=1)), np.cos(q.sum(axis=1))], axis=1)
    table = np.stack([first, second], axis=2)
    turned = np.stack([np.linalg.solve(table[k], directions.T).T for k in range(2)])
    largest = np.where(turned > 0, high[:, None], low[:, None]) / turned
    assert pk.directional_maxima(arm, actuation, place, directions).values == pytest.approx(
        largest.min(axis=2).max(axis=0)
    )
    pushed = np.einsum("pja,ka->pkj", np.swapaxes(table, 1, 2), directions)
    stall = actuation.motors.stall
    largest = np.where(pushed > 0, stall - load[:, None], -stall - load[:, None]) / pushed
    forces = pk.directional_maxima(arm, actuation, place, directions, quantity="force")
    assert forces.values == pytest.approx(largest.min(axis=2).max(axis=0))


@pytest.mark.parametrize(("dof", "joint"), [(3, 0), (3, 1), (3, 2), (4, 0), (4, 3)])
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_motor_that_bears_any_load_is_the_limit_of_a_very_strong_one(dof, joint, quantity):
    arm, stall = planar(dof), np.array([9.0, 6.0, 4.0, 3.0])[:dof]
    one, other = (
        pk.directional_maxima(
            arm,
            motors(np.where(np.arange(dof) == joint, joint_stall, stall)),
            [0.5, 0.2],
            UNIT[:2],
            quantity=quantity,
            starts=60,
        )
        for joint_stall in (np.inf, 1e9)
    )
    assert np.isfinite(one.values).all()
    assert one.values == pytest.approx(other.values, rel=1e-6)


@pytest.mark.parametrize("dof", [3, 4])
def test_motors_that_bear_any_load_push_without_end_and_are_as_fast_as_without_gravity(dof):
    arm, actuation = planar(dof), motors([np.inf] * dof)
    pushed = pk.directional_maxima(arm, actuation, [0.5, 0.2], UNIT, quantity="force", starts=40)
    assert np.isposinf(pushed.values).all()
    moved, free = (
        pk.directional_maxima(each, actuation, [0.5, 0.2], UNIT[:2], starts=60).values
        for each in (arm, arm.mounted(gravity=[0.0, 0.0, 0.0]))
    )
    assert moved == pytest.approx(free, rel=1e-9)


def test_forces_of_a_panda_are_the_same_from_any_seed():
    arm = panda.panda()
    actuation = pk.capability.JointActuation.of(arm)
    values = [
        pk.directional_maxima(arm, actuation, [0.45, 0.1, 0.4], 3, quantity="force", starts=60, seed=seed).values
        for seed in range(3)
    ]
    assert np.ptp(values, axis=0) == pytest.approx(np.zeros(3), abs=1e-6 * np.min(values))
    able, _ = torque_capacity(actuation, np.zeros(7))
    assert np.array_equal(able, arm.torque_limits)


def test_arms_with_rods_that_turn_the_other_way_are_mirrored():
    zero = np.deg2rad([-120.0, 10.0, 0.0])
    one = rods(3, zero)
    curve = one.front
    other = pk.capability.DistributedActuation(
        front=curve, rod=0.080, front_bounds=(0.037, 0.077), zero=-zero, bend=-1.0
    )
    arm, mirror = planar(3, length=0.114, mass=0.5), np.array([1.0, -1.0])
    turned = arm.mounted(gravity=[0.0, 9.81, 0.0])
    for quantity in QUANTITIES:
        values = pk.directional_maxima(arm, one, [0.2, -0.15], UNIT, quantity=quantity).values
        again = pk.directional_maxima(turned, other, [0.2, 0.15], UNIT * mirror, quantity=quantity).values
        assert again == pytest.approx(values, rel=1e-9)
