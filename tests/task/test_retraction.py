"""Retraction: Newton's method back to the path, sample by sample, and its failures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik import Task, line
from paretoik.robot.arms import marcos_nr, tringali_3r
from paretoik.robot.kinematics import forward_kinematics
from paretoik.task.retraction import (
    ON_PATH_TOLERANCE,
    retract,
    retract_nearest,
    row_space_basis,
    solve_small_systems,
    task_errors,
)
from tests.formulations.problems import panda
from tests.task.test_task import FLAT_POSES, KINDS, POINTS_2D, POSES, targets_at, through

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


def test_a_posture_on_the_path_is_left_where_it_is():
    arm = panda()
    q = np.random.default_rng(1).uniform(-1, 1, (50, 7))
    task = Task(POSES).resolve_axes(arm)
    targets = targets_at(task, through(arm, q, POSES))
    result = retract_nearest(arm, [task], q, targets)
    np.testing.assert_array_equal(result.q, q)
    assert result.on_path.all()


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


def test_a_sample_does_not_depend_on_the_block_it_falls_in():
    task, start, targets, directions = disturbed(marcos_nr(4), "xy", POINTS_2D, 0.8, count=300)
    batch = retract(marcos_nr(4), [task], start, targets, directions)
    for i in (0, 127, 128, 299):
        part = slice(i, i + 1)
        single = retract(marcos_nr(4), [task], start[part], targets[part], directions[part])
        np.testing.assert_array_equal(single.q, batch.q[part])
        np.testing.assert_array_equal(single.on_path, batch.on_path[part])


@given(st.integers(1, 6), st.integers(0, 10_000))
def test_elimination_solves_what_linear_algebra_solves(size, seed):
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(5, size, size)) + 4 * np.eye(size)
    right = rng.normal(size=(5, size))
    originals = matrix.copy(), right.copy()
    result, determinant = solve_small_systems(matrix, right)
    expected = np.linalg.solve(matrix, right[..., None])[..., 0]
    np.testing.assert_allclose(result, expected, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(determinant, np.linalg.det(matrix), rtol=1e-9)
    for given_, copy in zip((matrix, right), originals, strict=True):
        np.testing.assert_array_equal(given_, copy)
