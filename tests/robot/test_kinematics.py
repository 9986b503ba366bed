"""Frames, nodes and Jacobians; Pinocchio is their oracle in test_oracle."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.robot import kinematics
from paretoik.robot.arms import tringali_3r
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


def test_the_pose_of_many_postures_is_a_batch_of_those_of_each(panda_arm):
    q = np.random.default_rng(6).normal(size=(2, 3, 7))
    poses, jacobians = panda_arm.pose(q), panda_arm.jacobian(q, frame="panda_link4")
    assert (len(poses), poses.rotation.shape, jacobians.shape) == (2, (2, 3, 3, 3), (2, 3, 6, 7))
    for i, row in enumerate(poses):
        for j, one in enumerate(row):
            np.testing.assert_array_equal(one.matrix, poses.matrix[i, j])
            same(one.matrix, panda_arm.pose(q[i, j]).matrix, 1e-14)
            same(jacobians[i, j], panda_arm.jacobian(q[i, j], frame="panda_link4"), 1e-14)
    rotation, position = kinematics.forward_kinematics(panda_arm, q)
    same(poses.rotation, rotation, 1e-14)
    np.testing.assert_array_equal(poses.position, position)


def test_a_planar_arm_moves_in_three_rows_of_its_jacobian():
    arm = tringali_3r()
    jacobian = arm.jacobian(np.random.default_rng(7).normal(size=(5, 3)))
    assert np.all(jacobian[:, [2, 3, 4]] == 0.0)
    assert np.all(jacobian[:, 5] == 1.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda arm: arm.pose([0.1, 0.2]), "q: must have shape \\(..., 3\\), one a joint, got shape"),
        (lambda arm: arm.jacobian([0.1, np.nan, 0.2]), "q: must be finite, got nan at index 1"),
        (lambda arm: arm.pose([0.0] * 3, frame="hand"), "frame: one of tool, base, .* got 'hand'"),
        (lambda arm: arm.jacobian("home"), "q: must hold real numbers, got text"),
    ],
)
def test_what_is_no_posture_or_no_frame_is_refused(call, message):
    with pytest.raises(InvalidInput, match=message.replace("tringali_3r", tringali_3r().name)):
        call(tringali_3r())
