"""Householder reflections compared with NumPy's dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.nlp import linear_algebra as householder

shapes = st.integers(1, 7).flatmap(lambda n: st.tuples(st.integers(1, n), st.just(n)))
seeds = st.integers(0, 10_000)


def factorised(shape, seed):
    """Return random rows, their reflectors and triangle, and Q as a matrix."""
    rows = np.random.default_rng(seed).normal(size=shape)
    reflectors, triangle = rows.copy(), np.zeros((len(rows), len(rows)))
    assert householder.triangularise(reflectors, triangle)
    orthogonal = np.eye(rows.shape[1])
    for column in orthogonal:  # row k becomes Qᵀ eₖ, so the matrix is Q
        householder.rotate(reflectors, column)
    return rows, reflectors, triangle, orthogonal


@settings(max_examples=25)
@given(shape=shapes, seed=seeds)
def test_rows_are_the_triangle_turned_and_the_rest_of_q_is_their_null_space(shape, seed):
    rows, _, triangle, orthogonal = factorised(shape, seed)
    m, n = shape
    np.testing.assert_allclose(orthogonal.T @ orthogonal, np.eye(n), atol=1e-12)
    np.testing.assert_allclose(orthogonal[:, :m] @ triangle, rows.T, atol=1e-11)
    assert np.array_equal(triangle, np.triu(triangle))
    np.testing.assert_allclose(rows @ orthogonal[:, m:], 0.0, atol=1e-11)


@settings(max_examples=25)
@given(shape=shapes, seed=seeds)
def test_rotating_back_undoes_rotating(shape, seed):
    _, reflectors, _, orthogonal = factorised(shape, seed)
    x = np.random.default_rng(seed + 1).normal(size=shape[1])
    rotated = x.copy()
    householder.rotate(reflectors, rotated)
    np.testing.assert_allclose(rotated, orthogonal.T @ x, atol=1e-11)
    householder.rotate_back(reflectors, rotated)
    np.testing.assert_allclose(rotated, x, atol=1e-11)


@settings(max_examples=25)
@given(shape=shapes, seed=seeds)
def test_back_substitution_solves_the_triangle(shape, seed):
    _, _, triangle, _ = factorised(shape, seed)
    right = np.random.default_rng(seed + 3).normal(size=shape[0])
    x = right.copy()
    householder.back_substitute(triangle, x)
    residual = triangle @ x - right
    assert np.abs(residual).max() <= 1e-12 * (1 + np.abs(triangle).max() * np.abs(x).max())


@pytest.mark.parametrize("rows", [[[0.0, 0.0]], [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]], [[1.0, 0.0], [1.0, 1e-13]]])
def test_dependent_rows_are_noticed(rows):
    matrix = np.array(rows)
    assert not householder.triangularise(matrix, np.zeros((len(rows), len(rows))))


@settings(max_examples=25)
@given(size=st.integers(1, 5), seed=seeds, share=st.floats(0.0, 0.3))
def test_a_matrix_near_its_triangle_is_eliminated_and_one_past_a_fold_is_not(size, seed, share):
    rng = np.random.default_rng(seed)
    triangle = np.triu(rng.uniform(-0.5, 0.5, (size, size)), 1) + np.diag(rng.choice([-1, 1], size) * 3.0)
    matrix, right = triangle.T + share * rng.uniform(-0.5, 0.5, (size, size)), rng.normal(size=size)
    x = right.copy()
    assert householder.eliminate(matrix.copy(), x, triangle)
    np.testing.assert_allclose(matrix @ x, right, atol=1e-11)
    folded = matrix.copy()
    folded[0] *= -1.0  # the first pivot has the other sign
    assert not householder.eliminate(folded, right.copy(), triangle)
