"""A fixed joint leaves the rest of the arm as it was."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.robot import dynamics, kinematics
from paretoik.robot.arm import joint_motion
from paretoik.robot.arms import tringali_3r
from tests.robot.laws import same, seeds, state_of
from tests.robot.oracles import potential_energy


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


def test_fixing_a_joint_keeps_the_other_joints_limits_and_names():
    arm = tringali_3r().fixed(joint2=0.5)
    assert arm.joint_names == ("joint1", "joint3")
    assert arm.position_limits == pytest.approx(tringali_3r().position_limits[[0, 2]])


def test_joint_motion_turns_about_and_slides_along_z():
    assert joint_motion("revolute", np.pi / 2).apply([1.0, 0.0, 0.0]) == pytest.approx([0.0, 1.0, 0.0])
    assert joint_motion("prismatic", 0.3).apply([1.0, 0.0, 0.0]) == pytest.approx([1.0, 0.0, 0.3])
