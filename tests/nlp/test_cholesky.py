"""Banded matrices with a border compared with NumPy's dense solution and LAPACK's inertia."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.nlp.banded.cholesky import allocate_matrix, factorise, solve, solve_columns

dimensions = st.tuples(st.integers(1, 12), st.integers(1, 4), st.integers(0, 3), st.integers(0, 10_000))


def system(dimensions, *, border):
    """Return A as a band and dense, B and C of a random system; ``border`` scales the diagonal S."""
    size, band, borders, seed = dimensions
    rng = np.random.default_rng(seed)
    lower = np.tril(rng.normal(size=(size, size)))
    lower[np.subtract.outer(np.arange(size), np.arange(size)) >= band] = 0.0
    np.fill_diagonal(lower, rng.uniform(0.5, 2.0, size))
    A = lower @ lower.T
    packed = np.array([[A[i, i - d] if i >= d else 0.0 for d in range(band)] for i in range(size)])
    B = rng.normal(size=(borders, size))
    C = B @ np.linalg.solve(A, B.T) + border * np.diag(rng.uniform(0.5, 2.0, borders))
    return packed, A, B, C


def factorised(packed, B, C, negative):
    """Return whether the inertia is right, and the factorised matrix."""
    matrix = allocate_matrix(*packed.shape, len(C))._replace(A=packed, B=B, C=C)
    return factorise(matrix, negative), matrix


@settings(max_examples=25)
@given(dimensions)
def test_the_solution_is_that_of_the_dense_matrix(dimensions):
    packed, A, B, C = system(dimensions, border=-1.0)
    right_inertia, matrix = factorised(packed, B, C, len(C))
    assert right_inertia
    whole = np.block([[A, B.T], [B, C]])
    right = np.random.default_rng(1).normal(size=len(whole))
    x = right.copy()
    solve(matrix, x)
    assert np.abs(whole @ x - right).max() <= 1e-11 * (1 + np.abs(whole).max() * np.abs(x).max())


@settings(max_examples=25)
@given(dimensions)
def test_the_inertia_is_counted(dimensions):
    for border in (-1.0, 1.0):
        packed, A, B, C = system(dimensions, border=border)
        negative = int((np.linalg.eigvalsh(np.block([[A, B.T], [B, C]])) < 0).sum())
        assert negative == (len(C) if border < 0 else 0)
        assert factorised(packed, B, C, negative)[0]
        assert not factorised(packed, B, C, negative + 1)[0]


@settings(max_examples=25)
@given(dimensions)
def test_a_band_that_is_not_positive_definite_is_refused(dimensions):
    packed, A, B, C = system(dimensions, border=-1.0)
    packed[:, 0] -= 1.001 * np.linalg.eigvalsh(A)[0] + 1e-9
    assert not factorised(packed, B, C, len(C))[0]


@settings(max_examples=25)
@given(dimensions, st.integers(1, 9))
def test_columns_are_solved_to_the_bits_of_each_alone(dimensions, count):
    packed, _, B, C = system(dimensions, border=-1.0)
    _, matrix = factorised(packed, B, C, len(C))
    right = np.random.default_rng(2).normal(size=(len(packed) + len(C), count + 2))
    columns = right.copy()
    solve_columns(matrix, columns, count)
    for number in range(count):
        x = right[:, number].copy()
        solve(matrix, x)
        np.testing.assert_array_equal(columns[:, number], x)
    np.testing.assert_array_equal(columns[:, count:], right[:, count:])
