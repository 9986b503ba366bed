"""An arm, its tools and its payloads."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.robot import dynamics, kinematics
from paretoik.robot.arm import Arm
from paretoik.robot.arms import tringali_3r
from tests.robot.laws import pose, positions, same, seeds, state_of, turns
from tests.robot.oracles import potential_energy

DH = {"a": [0.1, 0.2], "alpha": [0.0, 1.0], "d": [0.0, 0.1], "theta": [0.0, 0.0], "convention": "modified"}


def test_an_arm_cannot_be_changed():
    arm = tringali_3r()
    with pytest.raises(AttributeError):
        arm.name = "other"
    with pytest.raises(ValueError, match="read-only"):
        arm.position_limits[0, 0] = 0.0


def test_turning_joints_are_periodic_and_sliding_ones_are_not():
    assert Arm.from_dh(**DH, types=["continuous", "prismatic"]).periodic.tolist() == [True, False]


@given(seed=seeds, place=positions, turn=turns)
@settings(max_examples=15, deadline=None)
def test_a_tool_moves_the_tool_frame_and_its_mass_is_a_payload_there(anyarm_of, seed, place, turn):
    arm, tool = anyarm_of(seed), pose(place, turn)
    inertia = np.diag([0.02, 0.03, 0.04])
    equipped = arm.with_tool(tool, mass=1.5, center=tool.position, inertia=tool.rotation @ inertia @ tool.rotation.T)
    loaded = arm.with_tool(tool).with_payload(1.5, inertia=inertia)
    state = state_of(arm, seed)
    rotation, position = kinematics.forward_kinematics(arm, state[0])
    same(kinematics.forward_kinematics(equipped, state[0])[0], rotation @ tool.rotation)
    same(kinematics.forward_kinematics(equipped, state[0])[1], position + rotation @ tool.position)
    same(dynamics.inverse_dynamics(equipped, *state), dynamics.inverse_dynamics(loaded, *state))


# Joints fixed at a value


@given(seed=seeds, value=st.floats(-3, 3), joint=st.integers(0, 4))
@settings(max_examples=25, deadline=None)
def test_a_fixed_joint_is_the_full_arm_held_at_that_value(anyarm_of, seed, value, joint):
    arm = anyarm_of(seed)
    held = arm.fixed({arm.joint_names[joint]: value})
    rest = np.arange(arm.dof) != joint
    q, dq, ddq = state_of(arm, seed)
    q[:, joint], dq[:, joint], ddq[:, joint] = value, 0.0, 0.0
    for mine, whole in zip(
        kinematics.forward_kinematics(held, q[:, rest]), kinematics.forward_kinematics(arm, q), strict=True
    ):
        same(mine, whole)
    torque = dynamics.inverse_dynamics(held, q[:, rest], dq[:, rest], ddq[:, rest])
    same(torque, dynamics.inverse_dynamics(arm, q, dq, ddq)[:, rest], 1e-11)
    inertia = dynamics.inertia_matrix(arm, q)[:, rest][:, :, rest]
    same(dynamics.inertia_matrix(held, q[:, rest]), inertia, 1e-11)
    if joint:
        rise = potential_energy(arm, q) - potential_energy(held, q[:, rest])
        assert np.abs(rise).max() < 1e-10
