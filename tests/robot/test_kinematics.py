"""Frames, nodes and Jacobians; Pinocchio is their oracle in test_oracle."""

from __future__ import annotations

import numpy as np

from paretoik.robot import kinematics
from tests.robot.laws import same


def test_link_nodes_run_from_the_base_over_every_joint_to_the_tool(panda_arm):
    q = np.random.default_rng(4).normal(size=(3, 7))
    nodes = kinematics.link_nodes(panda_arm, q)
    names = ["base", *panda_arm.joint_names, "tool"]
    for i, name in enumerate(names):
        same(nodes[:, i], kinematics.forward_kinematics(panda_arm, q, name)[1], 1e-15)


def test_a_frame_before_a_joint_does_not_feel_it(panda_arm):
    q = np.random.default_rng(5).normal(size=(4, 7))
    jacobian = kinematics.jacobian(panda_arm, q, "panda_link4")
    assert np.all(jacobian[:, :, 4:] == 0.0)
    assert np.abs(jacobian[:, :, :4]).max() > 0.1
