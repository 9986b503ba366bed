"""The tree of a robot's description."""

from __future__ import annotations

import numpy as np

from paretoik.robot.urdf_description import LinkDescription
from paretoik.robot.urdf_reading import read_robot
from tests.robot.conftest import PANDA
from tests.robot.urdf_text import joint, link


def test_a_tree_has_its_root_its_leaves_and_every_joint_after_its_parent(write_urdf):
    links = [link(name) for name in "dcbae"]
    robot = read_robot(write_urdf(*links, joint("cd", "c", "d"), joint("bc", "b", "c"), joint("be", "b", "e")))
    assert robot.roots == ["b", "a"]
    assert robot.leaves == ["d", "a", "e"]
    assert [joint.name for joint in robot.joints_below("b")] == ["bc", "be", "cd"]
    assert robot.joints_below("d") == []


def test_the_panda_below_its_hand_has_its_two_fingers():
    below = read_robot(PANDA).joints_below("panda_hand")
    assert {joint.child for joint in below} == {"panda_hand_tcp", "panda_leftfinger", "panda_rightfinger"}


def test_the_inertia_of_a_link_is_symmetric_with_its_entries_in_place():
    inertia = LinkDescription(name="a", inertia_entries=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)).inertia
    assert np.array_equal(inertia, [[1, 2, 3], [2, 4, 5], [3, 5, 6]])
