"""Retraction: Newton's method back to the path, sample by sample, and its failures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from paretoik import Arm, Pose, Task, line
from paretoik.robot.arms import marcos_nr, tringali_3r
from paretoik.robot.kinematics import forward_kinematics
from paretoik.task.retraction import (
    ON_PATH_TOLERANCE,
    error_evaluator,
    retract,
    retract_nearest,
    row_space_basis,
    task_errors,
)
from tests.formulations.problems import panda, random_arm
from tests.task.test_task import FLAT_POSES, POINTS_2D, POSES, SPATIAL, targets_at, through
from tests.task.test_task import KINDS as EVERY_KIND

KINDS = [EVERY_KIND[i] for i in (0, 2, 7, 8, 10, 12)]
every_kind = pytest.mark.parametrize(("arm", "axes", "path"), KINDS, ids=[f"{a.name}-{x}-{p}" for a, x, p in KINDS])


def disturbed(arm, axes, path, size, count=300, seed=0):
    """Return task, postures a little off the path, targets, and the row space bases at the postures."""
    rng = np.random.default_rng(seed)
    there = rng.uniform(-1, 1, (count, arm.dof))
    task = Task(path, axes=axes).resolve_axes(arm)
    targets = targets_at(task, through(arm, there, path))
    start = there + rng.uniform(-size, size, there.shape)
    return task, start, targets, row_space_basis(task_errors(arm, [task], start, targets)[1])


@every_kind
def test_postures_near_the_path_are_led_onto_it(arm, axes, path):
    task, start, targets, directions = disturbed(arm, axes, path, 0.02)
    result = retract(arm, [task], start, targets, directions)
    assert result.on_path.mean() > 0.97  # the others are next to a singularity
    error = np.abs(task_errors(arm, [task], result.q, targets)[0]).max(axis=1)
    assert (error[result.on_path] <= ON_PATH_TOLERANCE).all()
    np.testing.assert_allclose(result.error[result.on_path], error[result.on_path], atol=ON_PATH_TOLERANCE)


@every_kind
def test_the_way_taken_lies_in_the_given_directions(arm, axes, path):
    task, start, targets, directions = disturbed(arm, axes, path, 0.05)
    result = retract(arm, [task], start, targets, directions)
    way = result.q - start
    along = np.einsum("ndr,nr->nd", directions, np.einsum("ndr,nd->nr", directions, way))
    np.testing.assert_allclose(way, along, atol=1e-11)


@every_kind
def test_a_sample_does_not_depend_on_its_batch(arm, axes, path):
    task, start, targets, directions = disturbed(arm, axes, path, 0.6, count=200)
    batch = retract(arm, [task], start, targets, directions)
    assert batch.on_path.mean() > 0.3
    for part in (slice(0, 1), slice(7, 8), slice(5, 50), slice(199, 200), slice(None, None, 3)):
        single = retract(arm, [task], start[part], targets[part], directions[part])
        np.testing.assert_array_equal(single.q, batch.q[part])
        np.testing.assert_array_equal(single.error, batch.error[part])
        np.testing.assert_array_equal(single.on_path, batch.on_path[part])


def test_a_posture_on_the_path_is_left_where_it_is():
    arm = panda()
    q = np.random.default_rng(1).uniform(-1, 1, (50, 7))
    task = Task(POSES).resolve_axes(arm)
    targets = targets_at(task, through(arm, q, POSES))
    result = retract_nearest(arm, [task], q, targets)
    np.testing.assert_array_equal(result.q, q)
    assert result.on_path.all()


def test_what_is_given_is_not_written_into():
    task, start, targets, directions = disturbed(marcos_nr(4), "xy", POINTS_2D, 0.1)
    originals = [array.copy() for array in (start, targets, directions)]
    for array in (start, targets, directions):
        array.setflags(write=False)
    retract(marcos_nr(4), [task], start, targets, directions)
    for array, copy in zip((start, targets, directions), originals, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_newtons_method_squares_the_error():
    arm = random_arm(4, 7)
    sizes = np.array([1e-2, 1e-3])
    left = []
    for size in sizes:
        task, start, targets, directions = disturbed(arm, "pose", POSES, size)
        error, slopes = task_errors(arm, [task], start, targets)
        step = (directions @ np.linalg.solve(slopes @ directions, error[..., None]))[..., 0]
        left.append(np.median(np.abs(task_errors(arm, [task], start + step, targets)[0]).max(axis=1)))
    assert np.log10(left[0] / left[1]) == pytest.approx(2, abs=0.3)


def test_a_target_out_of_reach_is_not_arrived_at():
    arm = tringali_3r()
    task = Task(line([0.3, 0.0], [0.4, 0.0], duration=1.0, samples=5)).resolve_axes(arm)
    start = np.random.default_rng(2).uniform(-2, 2, (200, 3))
    for beyond in (1e-9, 1e-3, 1.0):
        targets = np.tile([0.4895 + beyond, 0.0], (200, 1))
        result = retract_nearest(arm, [task], start, targets)
        assert not result.on_path.any()
        assert np.isfinite(result.q).all()
        assert (result.error > ON_PATH_TOLERANCE).all()


def test_a_fold_of_the_manifold_is_not_crossed():
    arm = marcos_nr(3)
    task = Task(line([2.0, 0.0], [2.5, 0.0], duration=1.0, samples=5)).resolve_axes(arm)
    bend = 0.6
    q = np.array([[0.0, bend, bend]])
    place = forward_kinematics(arm, q)[1][:, :2]
    directions = row_space_basis(task_errors(arm, [task], q, place)[1])
    result = retract(arm, [task], q * [[1, -1, -1]], place, directions)
    mirrored = np.linalg.det(task_errors(arm, [task], result.q, place)[1][0] @ directions[0]) < 0
    assert result.error[0] > ON_PATH_TOLERANCE or mirrored
    assert not result.on_path[0]


def test_a_singular_start_is_told_not_raised():
    arm = marcos_nr(4)
    task = Task(FLAT_POSES).resolve_axes(arm)
    q = np.zeros((3, 4))
    targets = targets_at(task, through(arm, np.full((3, 4), 0.1), FLAT_POSES))
    result = retract_nearest(arm, [task], q, targets)
    assert np.isfinite(result.q).all()
    arrived = task_errors(arm, [task], result.q, targets)[0][result.on_path]
    assert np.abs(arrived).max(initial=0.0) <= ON_PATH_TOLERANCE


def test_several_tasks_are_met_at_once():
    arm = Arm.planar(lengths=[0.5] * 6)
    rng = np.random.default_rng(3)
    there = rng.uniform(-1, 1, (200, 6))
    tasks = [Task(POINTS_2D, frame="joint4").resolve_axes(arm), Task(POINTS_2D).resolve_axes(arm)]
    targets = np.concatenate([forward_kinematics(arm, there, frame)[1][:, :2] for frame in ("joint4", "tool")], axis=1)
    start = there + rng.uniform(-0.05, 0.05, there.shape)
    result = retract_nearest(arm, tasks, start, targets)
    assert result.on_path.mean() > 0.95
    for frame, columns in (("joint4", slice(0, 2)), ("tool", slice(2, 4))):
        off = forward_kinematics(arm, result.q[result.on_path], frame)[1][:, :2] - targets[result.on_path, columns]
        assert np.abs(off).max() < 1e-9


def test_no_samples_are_no_trouble():
    task = Task(POINTS_2D).resolve_axes(marcos_nr(4))
    result = retract(marcos_nr(4), [task], np.zeros((0, 4)), np.zeros((0, 2)), np.zeros((0, 4, 2)))
    assert result.q.shape == (0, 4)
    assert result.on_path.shape == (0,)


@every_kind
def test_row_space_basis_is_an_orthonormal_basis_of_the_rows(arm, axes, path):
    q = np.random.default_rng(4).uniform(-1, 1, (30, arm.dof))
    task = Task(path, axes=axes).resolve_axes(arm)
    _, jacobian = task_errors(arm, [task], q, targets_at(task, through(arm, q, path)))
    basis = row_space_basis(jacobian)
    np.testing.assert_allclose(np.swapaxes(basis, -1, -2) @ basis - np.eye(task.rows), 0, atol=1e-12)
    np.testing.assert_allclose(jacobian @ basis @ np.swapaxes(basis, -1, -2), jacobian, atol=1e-12)
    triangle = jacobian @ basis
    np.testing.assert_allclose(np.triu(triangle, 1), 0, atol=1e-12)
    assert (np.diagonal(triangle, axis1=1, axis2=2) > 0).all()


def test_a_retraction_is_the_same_with_the_base_elsewhere():
    arm = SPATIAL
    task, start, targets, _ = disturbed(arm, "xyz", line([0, 0, 0], [1, 0, 0], duration=1.0, samples=5), 0.05)
    turn = Pose.from_rpy((0.3, -0.2, 0.5), (0.4, 0.5, -0.6))
    moved = arm.mounted(base=turn)
    shifted = targets @ turn.rotation.T + turn.position
    results = [retract_nearest(a, [task], start, expected) for a, expected in ((arm, targets), (moved, shifted))]
    np.testing.assert_allclose(results[0].q, results[1].q, atol=1e-8)


@every_kind
def test_shapes_of_batches_do_not_matter(arm, axes, path):
    task, start, targets, directions = disturbed(arm, axes, path, 0.1, count=6)
    flat = retract(arm, [task], start, targets, directions)
    shaped = retract(*(arm, [task]), *(a.reshape(2, 3, *a.shape[1:]) for a in (start, targets, directions)))
    np.testing.assert_array_equal(shaped.q.reshape(6, -1), flat.q)
    np.testing.assert_array_equal(shaped.on_path.ravel(), flat.on_path)
    one = retract(arm, [task], start[0], targets[0], directions[0])
    np.testing.assert_array_equal(one.q, flat.q[0])
    same = [task_errors(arm, [task], start, other) for other in (targets[0], np.tile(targets[0], (6, 1)))]
    for once, tiled in zip(*same, strict=True):
        np.testing.assert_array_equal(once, tiled)


def test_arms_of_one_geometry_share_an_evaluator_and_no_others_do():
    arm, task = marcos_nr(3), Task(line([0.5, 0.2], [0.9, 0.4], duration=1.0))
    tasks = (task.resolve_axes(arm),)
    first = error_evaluator(arm, tasks)
    assert error_evaluator(replace(arm, name="another", velocity_limits=np.full(3, 2.0)), tasks) is first
    longer = arm.with_tool(Pose([0.1, 0.0, 0.0]))
    assert error_evaluator(longer, tasks) is not first
    elsewhere = (Task(line([0.2, 0.4], [0.9, 0.4], duration=2.0), axes="xy").resolve_axes(arm),)
    assert error_evaluator(arm, elsewhere) is first
