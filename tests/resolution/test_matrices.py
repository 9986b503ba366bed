"""Small symmetric matrices, compiled, beside LAPACK."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paretoik.nlp.linear_algebra import cholesky, weighted_square


@given(seed=st.integers(0, 10_000), rows=st.integers(1, 8), dof=st.integers(1, 8))
def test_the_weighted_square_is_numpys(seed, rows, dof):
    rng = np.random.default_rng(seed)
    jacobian, weights, square = rng.normal(size=(rows, dof)), rng.uniform(size=dof), np.empty((rows, rows))
    weighted_square(jacobian, weights, square)
    np.testing.assert_allclose(square, jacobian * weights @ jacobian.T, atol=1e-13)


def test_a_matrix_that_is_not_positive_definite_is_not_decomposed():
    work = np.empty((2, 2))
    assert cholesky(np.array([[2.0, 1.0], [1.0, 1.0]]), work)
    assert not cholesky(np.ones((2, 2)), work)
    assert not cholesky(np.full((2, 2), np.nan), work)
