"""Poses: a group that acts on points, and a logarithm that is accurate at both of its ends."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from paretoik.errors import InvalidInput
from paretoik.robot.pose import (
    Pose,
    matrix_to_quaternion,
    pose_batch,
    quaternion_to_matrix,
    rotation_vector,
    vector_to_quaternion,
)

coordinates = st.floats(-10, 10)
points = st.tuples(coordinates, coordinates, coordinates)
angles = st.floats(-np.pi, np.pi)
rotation_vectors = st.tuples(angles, angles, angles)


def random_quaternions(count):
    quaternions = np.random.default_rng(7).normal(size=(count, 4))
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def same(left, right):
    np.testing.assert_allclose(left.matrix, right.matrix, atol=1e-12)


@given(points, rotation_vectors)
def test_a_pose_after_its_inverse_is_the_identity(place, spin):
    pose = Pose.from_rpy(place, spin)
    same(pose @ pose.inverse(), Pose([0.0, 0.0, 0.0]))
    same(pose.inverse() @ pose, Pose([0.0, 0.0, 0.0]))


@given(points, rotation_vectors, points, rotation_vectors)
def test_composition_is_the_product_of_matrices(place, spin, other_place, other_spin):
    a, b = Pose.from_rpy(place, spin), Pose.from_rpy(other_place, other_spin)
    np.testing.assert_allclose((a @ b).matrix, a.matrix @ b.matrix, atol=1e-12)


@given(points, rotation_vectors)
def test_a_pose_comes_back_from_its_matrix(place, spin):
    pose = Pose.from_rpy(place, spin)
    same(Pose.from_matrix(pose.matrix), pose)
    same(Pose.from_matrix(pose.rotation, pose.position), pose)


@given(rotation_vectors)
def test_rpy_turns_about_fixed_axes_in_the_order_x_y_z(spin):
    expected = Rotation.from_euler("xyz", spin).as_matrix()
    np.testing.assert_allclose(Pose.from_rpy([0.0, 0.0, 0.0], spin).rotation, expected, atol=1e-14)


def test_quaternions_and_matrices_agree_with_scipy_in_any_batch_shape():
    quaternions = random_quaternions(600).reshape(20, 30, 4)
    expected = Rotation.from_quat(np.roll(quaternions.reshape(-1, 4), -1, axis=1))
    matrices = quaternion_to_matrix(quaternions)
    np.testing.assert_allclose(matrices.reshape(-1, 3, 3), expected.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(rotation_vector(matrices).reshape(-1, 3), expected.as_rotvec(), atol=1e-13)
    assert matrix_to_quaternion(matrices[0, 0]).shape == (4,)
    assert rotation_vector(matrices[0, 0]).shape == (3,)
    assert rotation_vector(matrices[:, :0]).shape == (20, 0, 3)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-8, 1.0, np.pi - 1e-8])
def test_the_logarithm_undoes_the_exponential_near_zero_and_near_a_half_turn(angle):
    axes = random_quaternions(200)[:, 1:]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    vectors = angle * axes
    result = rotation_vector(quaternion_to_matrix(vector_to_quaternion(vectors)))
    np.testing.assert_allclose(result, vectors, rtol=1e-9, atol=4e-15 * angle)


@pytest.mark.parametrize("axis", [[0, 1, 0], [0.6, 0, -0.8], [1 / 3, 2 / 3, -2 / 3]])
def test_a_half_turn_has_length_pi_about_its_axis_whichever_way(axis):
    matrix = 2 * np.outer(axis, axis) - np.eye(3)
    result = rotation_vector(matrix)
    assert np.linalg.norm(result) == pytest.approx(np.pi, abs=1e-15)
    np.testing.assert_allclose(abs(result @ axis), np.pi, atol=1e-14)


@given(rotation_vectors)
def test_the_exponential_gives_unit_quaternions_of_the_same_turn(vector):
    turn = vector_to_quaternion(np.array(vector))
    assert np.linalg.norm(turn) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(quaternion_to_matrix(turn), Rotation.from_rotvec(vector).as_matrix(), atol=1e-14)


def test_a_pose_cannot_be_changed_nor_shares_memory_with_what_it_was_made_from():
    position = np.zeros(3)
    pose = Pose(position)
    position[0] = 5.0
    assert pose.position[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        pose.position[0] = 1.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Pose([0, 0, 0], (1.1, 0, 0, 0)),
            "quaternion: must have length 1 within 1e-06, got [1.1, 0.0, 0.0, 0.0]",
        ),
        (lambda: Pose([0, np.nan, 0]), "position: must be finite, got nan at index 1"),
        (lambda: Pose.from_matrix(np.diag([1.0, 1.0, -1.0])), "matrix: must be a rotation, got determinant -1"),
        (lambda: Pose.from_matrix(np.eye(4), [0, 0, 0]), "(4, 4) if no position is given"),
    ],
)
def test_what_is_no_pose_is_refused_with_name_wish_and_fact(make, message):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        make()


@given(st.integers(0, 10**6))
def test_a_batch_of_poses_composes_inverts_and_acts_as_each_of_them_does(seed):
    rng = np.random.default_rng(seed)
    places, spins, points = rng.normal(size=(3, 4, 3))
    singles = [Pose.from_rpy(place, spin) for place, spin in zip(places, spins, strict=True)]
    batch = pose_batch(places, np.stack([pose.quaternion for pose in singles]))
    tool = Pose.from_rpy([0.1, 0.2, 0.3], [0.4, 0.5, 0.6])
    shared = batch.apply(tool.position)
    for i, one in enumerate(singles):
        same(batch[i], one)
        same((batch @ tool)[i], one @ tool)
        same((tool @ batch)[i], tool @ one)
        same((batch @ batch)[i], one @ one)
        same(batch.inverse()[i], one.inverse())
        np.testing.assert_allclose(batch.apply(points)[i], one.apply(points[i]), atol=1e-12)
        np.testing.assert_allclose(shared[i], one.apply(tool.position), atol=1e-12)
    with pytest.raises(InvalidInput, match=r"points must have shape \(3,\) or \(4, 3\), one per pose, got \(3, 3\)"):
        batch.apply(points[:3])
