"""Postures to begin with and to climb from: within limits in any turn, holdable, and the same from any seed."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.capability.joint_capability import torque_capacity
from paretoik.capability.motor_curves import SHAPES
from paretoik.capability.posture_samples import restrict_to_rods, sample_holdable_postures, sample_postures_at
from paretoik.capability.posture_values import gravity_torques
from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot import kinematics
from problems import panda

WAYS = np.array([[1.0, 0.2], [-0.3, 1.0], [-1.0, -0.7], [0.6, -1.0]])
QUANTITIES = ("velocity", "force")
UNIT = WAYS / np.linalg.norm(WAYS, axis=1, keepdims=True)


def planar(links, length=0.3, mass=0.4, limits=None):
    arm = pk.Arm.planar(
        lengths=[length] * links,
        masses=[mass] * links,
        centers=[length / 2] * links,
        inertias=[0.0] * links,
        position_limits=limits,
    )
    return arm.mounted(gravity=[0.0, -9.81, 0.0])


def motors(stall, shape="diamond"):
    fastest = np.linspace(1.0, 2.0, len(stall))
    return pk.capability.JointActuation(motors=pk.capability.MotorCurve(stall=stall, fastest=fastest, shape=shape))


def rods(dof, zero):
    curve = pk.capability.MotorCurve(
        stall=[195.9, 95.8, 75.8, 55.8][:dof], fastest=[1.8e-3, 7.1e-3, 7.1e-3, 7.1e-3][:dof]
    )
    return pk.capability.DistributedActuation(front=curve, rod=0.080, front_bounds=(0.037, 0.077), zero=zero)


@pytest.mark.parametrize("limits", [(1.0, np.inf), (-np.inf, -1.0), (4.0, np.inf), (-9.0, -4.0), (-np.inf, 20.0)])
def test_joints_come_into_limits_in_whatever_turn_they_are(limits):
    arm = planar(4, limits=tuple([one] * 4 for one in limits))
    found = sample_postures_at(arm, np.array([0.5, 0.2]), 200, np.random.default_rng(0))
    assert len(found) > 150
    inside = (found >= limits[0] - 1e-9) & (found <= limits[1] + 1e-9)
    if np.ptp(limits) >= 2 * np.pi:
        assert inside.all()
    else:
        assert inside.all(axis=1).any()
        assert np.abs(found - np.mean(limits)).max() <= np.ptp(limits) / 2 + 2 * np.pi
    tool = kinematics.forward_kinematics(arm, found)[1][:, :2]
    assert tool == pytest.approx(np.tile([0.5, 0.2], (len(found), 1)), abs=1e-9)


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


def test_postures_that_can_be_held_are_found_where_none_of_few_can_be():
    arm, place = planar(6, mass=1.0), np.array([0.6, 0.3])
    actuation = motors([8.0] * 6)
    drawn = sample_postures_at(arm, place, 400, np.random.default_rng(1))
    assert (np.abs(gravity_torques(arm, drawn)) <= 8.0).all(axis=1).sum() <= 1
    for seed in range(2):
        found = sample_holdable_postures(arm, actuation, place, 10, np.random.default_rng(seed))
        assert len(found)
        assert np.abs(gravity_torques(arm, found)).max() <= 8.0 * (1 + 1e-9)
        tool = kinematics.forward_kinematics(arm, found)[1][:, :2]
        assert tool == pytest.approx(np.tile(place, (len(found), 1)), abs=1e-7)


def test_where_no_posture_can_be_held_the_joint_of_the_best_is_named():
    """With 40 kg at 0.6 m the first joint bears at least 129 N m, wherever the links are."""
    arm = planar(6, mass=1.0).with_payload(40.0)
    said = r"joint\d: a torque of at most 8 N m wanted, .*; that is the best of \d+ postures looked at"
    with pytest.raises(Infeasible, match=said) as found:
        sample_holdable_postures(arm, motors([8.0] * 6), np.array([0.6, 0.3]), 10, np.random.default_rng(0))
    assert found.value.violation >= 129.0 / 8.0 - 1.0
    assert found.value.limit.startswith("torque of joint")


@pytest.mark.parametrize(("turn", "bend"), [(0, 1.0), (1, 1.0), (-2, 1.0), (1, -1.0), (0, -1.0)])
def test_limits_and_rods_are_compared_in_the_turn_of_the_limits(turn, bend):
    curve = pk.capability.MotorCurve(stall=[50.0] * 3, fastest=[0.01] * 3)
    actuation = pk.capability.DistributedActuation(
        front=curve, rod=0.080, front_bounds=(0.037, 0.077), zero=0.4, bend=bend
    )
    reached = np.sort(0.4 + bend * actuation.angle_bounds[0]) + 2 * np.pi * turn
    inner, past = np.array([0.3, -0.3]), np.array([-0.2, 0.2])
    wanted = np.array([reached + inner, reached + past, [reached[0] + 0.2, reached[1] + 0.2]])
    kept = restrict_to_rods(planar(3, limits=tuple(wanted.T)), actuation).position_limits
    assert kept == pytest.approx(np.array([reached + inner, reached, [reached[0] + 0.2, reached[1]]]))
    wanted[1] = reached[1] + np.array([0.1, 0.4])
    with pytest.raises(InvalidInput, match="joint2: limits that overlap with what its rod reaches wanted"):
        restrict_to_rods(planar(3, limits=tuple(wanted.T)), actuation)


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
    turned = np.stack([np.linalg.solve(table[k], UNIT.T).T for k in range(2)])
    most = np.where(turned > 0, high[:, None], low[:, None]) / turned
    assert pk.directional_maxima(arm, actuation, place, UNIT).values == pytest.approx(most.min(axis=2).max(axis=0))
    pushed = np.einsum("pja,ka->pkj", np.swapaxes(table, 1, 2), UNIT)
    stall = actuation.motors.stall
    most = np.where(pushed > 0, stall - load[:, None], -stall - load[:, None]) / pushed
    found = pk.directional_maxima(arm, actuation, place, UNIT, quantity="force")
    assert found.values == pytest.approx(most.min(axis=2).max(axis=0))


@pytest.mark.parametrize(("dof", "joint"), [(3, 0), (3, 1), (3, 2), (4, 0), (4, 3)])
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_motor_that_bears_any_load_is_the_limit_of_a_very_strong_one(dof, joint, quantity):
    arm, stall = planar(dof), np.array([9.0, 6.0, 4.0, 3.0])[:dof]
    one, other = (
        pk.directional_maxima(
            arm,
            motors(np.where(np.arange(dof) == joint, most, stall)),
            [0.5, 0.2],
            UNIT[:2],
            quantity=quantity,
            starts=60,
        )
        for most in (np.inf, 1e9)
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
