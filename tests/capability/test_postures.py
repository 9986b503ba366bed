"""Initial postures: within limits in any turn, at the position, and held by the motors."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.capability.postures import restrict_to_rods, sample_holdable_postures, sample_postures_at
from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot import kinematics
from paretoik.robot.dynamics import gravity_torques
from tests.capability.drives import motors, planar


@pytest.mark.parametrize("limits", [(1.0, np.inf), (-np.inf, -1.0), (4.0, np.inf), (-9.0, -4.0), (-np.inf, 20.0)])
def test_joints_come_into_limits_in_whatever_turn_they_are(limits):
    arm = planar(4, limits=tuple([one] * 4 for one in limits))
    postures = sample_postures_at(arm, np.array([0.5, 0.2]), 200, np.random.default_rng(0))
    assert len(postures) > 150
    inside = (postures >= limits[0] - 1e-9) & (postures <= limits[1] + 1e-9)
    if np.ptp(limits) >= 2 * np.pi:
        assert inside.all()
    else:
        assert inside.all(axis=1).any()
        assert np.abs(postures - np.mean(limits)).max() <= np.ptp(limits) / 2 + 2 * np.pi
    tool = kinematics.forward_kinematics(arm, postures)[1][:, :2]
    assert tool == pytest.approx(np.tile([0.5, 0.2], (len(postures), 1)), abs=1e-9)


def test_postures_that_can_be_held_are_found_if_no_sample_can_be_held():
    arm, place = planar(6, mass=1.0), np.array([0.6, 0.3])
    actuation = motors([8.0] * 6)
    drawn = sample_postures_at(arm, place, 400, np.random.default_rng(1))
    assert (np.abs(gravity_torques(arm, drawn)) <= 8.0).all(axis=1).sum() <= 1
    postures = sample_holdable_postures(arm, actuation, place, 10, np.random.default_rng(0))
    assert len(postures)
    assert np.abs(gravity_torques(arm, postures)).max() <= 8.0 * (1 + 1e-9)
    tool = kinematics.forward_kinematics(arm, postures)[1][:, :2]
    assert tool == pytest.approx(np.tile(place, (len(postures), 1)), abs=1e-7)


def test_a_refusal_names_the_joint_of_the_best_posture():
    """With 40 kg at 0.6 m the first joint bears at least 129 N m in every posture."""
    arm = planar(6, mass=1.0).with_payload(40.0)
    said = r"joint\d must bear a torque of at most 8 N m, .*; that is the best of \d+ postures tried"
    with pytest.raises(Infeasible, match=said) as refusal:
        sample_holdable_postures(arm, motors([8.0] * 6), np.array([0.6, 0.3]), 10, np.random.default_rng(0))
    assert refusal.value.violation >= 129.0 / 8.0 - 1.0
    assert refusal.value.limit.startswith("torque of joint")


@pytest.mark.parametrize(("turn", "bend"), [(0, 1.0), (-2, 1.0), (1, -1.0)])
def test_limits_and_rods_are_compared_in_the_turn_of_the_limits(turn, bend):
    curve = pk.capability.MotorCurve(stall=[50.0] * 3, fastest=[0.01] * 3)
    actuation = pk.capability.DistributedActuation(
        front=curve, rod=0.080, front_bounds=(0.037, 0.077), zero=0.4, bend=bend
    )
    reached = np.sort(0.4 + bend * actuation.angle_bounds[0]) + 2 * np.pi * turn
    inner, past = np.array([0.3, -0.3]), np.array([-0.2, 0.2])
    ranges = np.array([reached + inner, reached + past, [reached[0] + 0.2, reached[1] + 0.2]])
    restricted = restrict_to_rods(planar(3, limits=tuple(ranges.T)), actuation).position_limits
    assert restricted == pytest.approx(np.array([reached + inner, reached, [reached[0] + 0.2, reached[1]]]))
    ranges[1] = reached[1] + np.array([0.1, 0.4])
    with pytest.raises(InvalidInput, match="joint2: limits must overlap with what its rod reaches"):
        restrict_to_rods(planar(3, limits=tuple(ranges.T)), actuation)
