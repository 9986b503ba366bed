"""Component algebra: NumPy's results, with the numbers 0 and 1 folded away."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.robot import components
from paretoik.robot.components import to_matrix, to_vector

RNG = np.random.default_rng(0)
A, B = RNG.normal(size=(2, 3, 5))  # two vectors of components over five samples
M, N = RNG.normal(size=(2, 3, 3))


def values(vector):
    return np.array([np.broadcast_to(entry, 5) for entry in vector])


@pytest.mark.parametrize("name", ["add", "subtract", "cross", "dot"])
def test_vectors_are_combined_as_numpy_does(name):
    expected = {"add": A + B, "subtract": A - B, "cross": np.cross(A.T, B.T).T, "dot": (A * B).sum(axis=0)}[name]
    np.testing.assert_allclose(getattr(components, name)(tuple(A), tuple(B)), expected, atol=1e-15)


def test_matrices_are_applied_transposed_and_multiplied_as_numpy_does():
    np.testing.assert_allclose(values(components.apply(to_matrix(M), tuple(A))), M @ A, atol=1e-15)
    np.testing.assert_allclose(values(components.apply_transposed(to_matrix(M), tuple(A))), M.T @ A, atol=1e-15)
    np.testing.assert_allclose(components.multiply(to_matrix(M), to_matrix(N)), M @ N, atol=1e-15)
    assert components.transpose(to_matrix(M)) == to_matrix(M.T)


def test_a_rotation_about_z_and_back_is_none():
    cosine, sine = np.cos(0.3), np.sin(0.3)
    turned = components.rotate_about_z(tuple(A), cosine, sine)
    np.testing.assert_allclose(values(turned)[0], cosine * A[0] - sine * A[1], atol=1e-15)
    np.testing.assert_allclose(values(components.rotate_back_about_z(turned, cosine, sine)), A, atol=1e-15)


def test_products_and_sums_with_zero_and_one_are_folded_away():
    x = A[0]
    assert components.times(0.0, x) == 0.0
    assert components.times(x, 1.0) is x
    assert components.plus(0.0, x) is x
    assert components.minus(x, 0.0) is x
    assert np.array_equal(components.times(-1.0, x), -x)
    assert np.array_equal(components.minus(0.0, x), -x)
    vector = tuple(A)
    assert components.dot(to_vector(np.array([0.0, 1.0, 0.0])), vector) is vector[1]
