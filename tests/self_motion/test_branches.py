"""Labels of branches: signs flip just where links align, and say nothing about where the arm stands."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik import Arm, Motion, Pose
from paretoik.robot.arms import marcos_nr, tringali_3r
from paretoik.task.self_motion import bend_signs, branch_labels
from tests.formulations.problems import panda, random_arm

ARMS = {"3R": tringali_3r(), "4R": marcos_nr(4), "random": random_arm(3, 6)}
every_arm = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS.keys())


def motion_of(arm, *postures):
    """Return the motion that goes evenly from posture to posture, in 21 samples."""
    knots = np.linspace(0, 1, len(postures))
    t = np.linspace(0, 1, 21)
    q = np.stack([np.interp(t, knots, column) for column in np.array(postures).T], axis=-1)
    return Motion(arm=arm, time=t, q=q[None])


def test_joints_of_a_planar_arm_bend_with_the_sign_of_their_sine():
    places = np.array([-np.pi, -3.0, -np.pi / 2, -1e-6, 0.0, 1e-6, 1.0, np.pi, 4.0, 2 * np.pi, 7.0])
    q = np.stack(np.meshgrid([0.3], places, places, places), axis=-1).reshape(-1, 4)
    sines = np.sin(q[:, 1:])
    expected_signs = np.where(np.abs(sines) < 1e-9, 0, np.sign(sines))
    np.testing.assert_array_equal(bend_signs(marcos_nr(4), q), expected_signs)


def test_the_sign_of_the_pandas_elbow_and_wrist_flips_where_their_sine_does():
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (2000, 7))
    bends = bend_signs(panda(), q)
    assert bends.shape == (2000, 5)
    for joint, outward in ((1, 1), (3, 1), (5, 1)):  # axes on either side meet this joint's at right angles
        signs = bends[:, joint - 1] * np.sign(np.sin(q[:, joint]))
        assert abs(signs.sum()) == 2000 * outward


@pytest.mark.parametrize("joint", [2, 3, 4])
def test_a_spatial_joint_changes_its_sign_just_where_its_neighbours_align(joint):
    arm = ARMS["random"]
    q = np.tile(np.random.default_rng(1).uniform(-2, 2, 6), (4001, 1))
    q[:, joint - 1] = np.linspace(-np.pi, np.pi, len(q))
    signs = bend_signs(arm, q)
    changes = np.flatnonzero(np.diff(signs[:, joint - 2]))
    spread = np.array([triple_product(arm, q[i], joint - 1) for i in changes])
    largest = max(abs(triple_product(arm, q[i], joint - 1)) for i in range(0, len(q), 100))
    assert len(changes) == 2
    assert np.abs(spread).max() < 5e-3 * largest
    others = np.delete(signs, joint - 2, axis=1)
    assert (others == others[0]).all()


def triple_product(arm, q, joint):
    """Return (axis before × axis after) · axis, from poses of the links alone."""
    pose, axes = arm.base, []
    for placement, angle in zip(arm.placements, q, strict=True):
        pose = pose @ placement @ Pose.from_rpy((0, 0, 0), (0, 0, angle))
        axes.append(pose.rotation[:, 2])
    return np.cross(axes[joint - 1], axes[joint + 1]) @ axes[joint]


@every_arm
@settings(max_examples=20)
@given(seed=st.integers(0, 1000))
def test_bends_do_not_depend_on_where_the_arm_stands(arm, seed):
    rng = np.random.default_rng(seed)
    q, spin = rng.uniform(-3, 3, (50, arm.dof)), rng.normal(size=4)
    moved = arm.mounted(base=Pose(rng.normal(size=3), spin / np.linalg.norm(spin)))
    np.testing.assert_array_equal(bend_signs(arm, q), bend_signs(moved, q))


@every_arm
def test_bends_of_a_posture_do_not_depend_on_its_batch(arm):
    q = np.random.default_rng(2).uniform(-3, 3, (4, 5, arm.dof))
    q[0, 0] = 0.0
    together = bend_signs(arm, q)
    for place in np.ndindex(4, 5):
        np.testing.assert_array_equal(bend_signs(arm, q[place]), together[place])


def test_a_stretched_panda_is_straight_whatever_stands_beside_it():
    alone, beside = bend_signs(panda(), np.zeros(7)), bend_signs(panda(), np.stack([np.zeros(7), np.full(7, 0.5)]))[0]
    np.testing.assert_array_equal(alone, 0)
    np.testing.assert_array_equal(beside, 0)


def test_an_arm_of_two_joints_has_no_bends():
    assert bend_signs(Arm.planar(lengths=[1.0, 1.0]), np.zeros((3, 2))).shape == (3, 0)


def test_a_label_says_how_each_joint_is_bent_all_the_way():
    arm = marcos_nr(4)
    motion = motion_of(arm, [0.0, 1.0, -1.0, 0.5], [0.5, 0.5, -2.0, 1.5])
    assert branch_labels(motion) == ["+-+"]


def test_a_label_marks_the_joint_that_passes_through_straight():
    arm = tringali_3r()
    assert branch_labels(motion_of(arm, [0.0, 1.0, 1.0], [0.0, -1.0, 1.0])) == ["~-+"]
    assert branch_labels(motion_of(arm, [0.0, -1.0, 1.0], [0.0, -1.0, -1.0])) == ["-~-"]


def test_touching_straight_from_one_side_is_no_passage():
    assert branch_labels(motion_of(tringali_3r(), [0.0, 1.0, 1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0])) == ["++"]


def test_every_motion_of_a_batch_has_the_label_that_it_has_alone():
    q = np.random.default_rng(5).uniform(-2, 2, (30, 1, 3)) + np.linspace(0, 0.5, 11)[:, None]
    motions = Motion(arm=tringali_3r(), time=np.linspace(0, 1, 11), q=q)
    assert branch_labels(motions) == [branch_labels(motions[i : i + 1])[0] for i in range(30)]
    assert len(set(branch_labels(motions))) > 4
