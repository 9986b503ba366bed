"""Self-motion curves: on the path, tangent to the null space, evenly cut, in all turns within limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik import Motion, Pose
from paretoik.robot.arms import marcos_nr, tringali_3r
from paretoik.task.random_starts import wrap_difference
from paretoik.task.retraction import task_errors
from paretoik.task.self_motion import (
    bend_signs,
    branch_labels,
    postures_along_path,
    resample_curve,
    trace_curves,
    unwrap_nodes,
)
from tests.formulations.problems import random_arm
from tests.task.tasks import ARM, task

TASK = task()


@pytest.fixture(scope="module")
def curves():
    seeds, pace = postures_along_path(TASK, np.random.default_rng(0))
    assert pace > 0
    return seeds, trace_curves(TASK, seeds)


def test_curves_stay_on_the_path_along_the_null_space(curves):
    for sample, of_sample in enumerate(curves[1]):
        for q, directions in of_sample:
            error, jacobian = task_errors(ARM, TASK.tasks, q, TASK.targets[sample])
            assert np.abs(error).max() < 1e-9
            closes = np.linalg.norm(wrap_difference(q[-1] - q[0], ARM.periodic)) < 1e-9
            inner = len(q) - closes  # the closing node has the direction of the step just before it
            assert np.abs(jacobian @ directions[..., None])[:inner].max() < 1e-9
            np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-12)
            assert (np.sum(directions[1:] * directions[:-1], axis=1) > 0).all()


@settings(max_examples=25)
@given(count=st.integers(20, 80), spacing=st.floats(0.05, 1.0), share=st.floats(0.3, 1.0))
def test_an_arc_is_cut_evenly_and_a_circle_closes(count, spacing, share):
    angle = 2 * np.pi * share * np.linspace(0, 1, count)
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    tangents = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    nodes, following = resample_curve(ARM, (circle, tangents), spacing)
    np.testing.assert_allclose(np.linalg.norm(nodes[:, :2], axis=1), 1.0, atol=1e-3)
    steps = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    turn = 2 * np.pi * share / (count - 1)
    assert steps.max() <= spacing * (1 + turn**2 / 24 + turn**4)  # chords are so much shorter than their arcs
    np.testing.assert_allclose(steps, steps[:1].repeat(len(steps)), rtol=1e-2)
    closed = np.linalg.norm(circle[-1] - circle[0]) < 1e-9
    assert following[-1] == (0 if closed and len(nodes) > 2 else -1)
    np.testing.assert_array_equal(following[:-1], np.arange(1, len(nodes)))


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), low=st.floats(-7.0, 0.0), width=st.floats(0.5, 14.0))
def test_nodes_come_in_all_turns_within_the_ranges_and_in_no_other(seed, low, width):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (5, 2))
    ranges, periodic = np.array([[low, low + width], [np.nan, np.nan]]), np.array([True, False])
    nodes, which = unwrap_nodes(q, ranges, periodic)
    expected = [
        (k, turn) for k in range(5) for turn in range(-4, 5) if low <= q[k, 0] + 2 * np.pi * turn <= low + width
    ]
    assert sorted(which) == sorted(k for k, _ in expected)
    np.testing.assert_allclose(wrap_difference(nodes - q[which], periodic), 0.0, atol=1e-9)
    assert ((nodes[:, 0] >= low - 1e-9) & (nodes[:, 0] <= low + width + 1e-9)).all()


# Labels of branches: signs flip only if links align, and do not depend on the arm's place


ARMS = {"3R": tringali_3r(), "4R": marcos_nr(4), "random": random_arm(3, 6)}


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


@pytest.mark.parametrize("joint", [2, 4])
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
    """Return (axis before × axis after) · axis, only from poses of the links."""
    pose, axes = arm.base, []
    for placement, angle in zip(arm.placements, q, strict=True):
        pose = pose @ placement @ Pose.from_rpy((0, 0, 0), (0, 0, angle))
        axes.append(pose.rotation[:, 2])
    return np.cross(axes[joint - 1], axes[joint + 1]) @ axes[joint]


def test_a_label_says_how_each_joint_is_bent_all_the_way():
    arm = marcos_nr(4)
    motion = motion_of(arm, [0.0, 1.0, -1.0, 0.5], [0.5, 0.5, -2.0, 1.5])
    assert branch_labels(motion) == ["+-+"]


def test_a_label_marks_the_joint_that_passes_through_straight():
    arm = tringali_3r()
    assert branch_labels(motion_of(arm, [0.0, 1.0, 1.0], [0.0, -1.0, 1.0])) == ["~-+"]
    assert branch_labels(motion_of(arm, [0.0, -1.0, 1.0], [0.0, -1.0, -1.0])) == ["-~-"]
