"""Small symmetric matrices, compiled, beside LAPACK."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.resolution.matrices import cholesky, smallest_eigenvalue


@settings(max_examples=300)
@given(seed=st.integers(0, 10_000), rows=st.integers(1, 8), rank=st.integers(1, 8))
def test_the_least_eigenvalue_is_lapacks(seed, rows, rank):
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(rows, min(rank, rows))) * 10.0 ** rng.uniform(-3, 3)
    matrix = half @ half.T
    found = smallest_eigenvalue(matrix, np.empty((rows + 4, rows)))
    assert found == pytest.approx(np.linalg.eigvalsh(matrix)[0], abs=1e-13 * np.abs(matrix).max())
    diagonal = np.diag(rng.normal(size=rows))
    assert smallest_eigenvalue(diagonal, np.empty((rows + 4, rows))) == diagonal.diagonal().min()


def test_a_matrix_that_is_not_positive_definite_is_not_decomposed():
    work = np.empty((2, 2))
    assert cholesky(np.array([[2.0, 1.0], [1.0, 1.0]]), work)
    assert not cholesky(np.ones((2, 2)), work)
    assert not cholesky(np.full((2, 2), np.nan), work)
