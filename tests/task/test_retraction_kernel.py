"""The compiled kernels: Newton's method in lanes, and elimination of small systems."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paretoik.robot.arms import marcos_nr
from paretoik.task.retraction import retract, solve_small_systems
from tests.task.test_retraction import disturbed
from tests.task.test_task import POINTS_2D


def test_a_sample_does_not_depend_on_the_block_it_falls_in():
    task, start, targets, directions = disturbed(marcos_nr(4), "xy", POINTS_2D, 0.8, count=6200)
    batch = retract(marcos_nr(4), [task], start, targets, directions)
    for i in (0, 6143, 6144, 6199):
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
