"""Newton's matrix gets the least addition to its diagonal that gives the right inertia."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.nlp.banded.cholesky import allocate_matrix
from paretoik.nlp.banded.interior_point import _factorise_definite


def factorised(A, B, C, border, delta=0.0):
    """Return the last addition for a dense A, and the matrices with it."""
    band = np.array([[A[i, i - d] if i >= d else 0.0 for d in range(len(A))] for i in range(len(A))])
    matrix = allocate_matrix(*band.shape, len(C))._replace(A=band, B=B, C=C.copy())
    largest = float(np.abs(A).max())
    added = _factorise_definite(matrix, border, largest, 1e-9, delta)
    return added, np.diag(band[:, 0] - np.diag(A)) + A, matrix.C


@settings(max_examples=30)
@given(st.integers(2, 6), st.integers(0, 1000))
def test_a_matrix_with_negative_eigenvalues_gets_as_much_as_makes_it_definite(size, seed):
    rng = np.random.default_rng(seed)
    Q = np.linalg.qr(rng.normal(size=(size, size)))[0]
    eigenvalues = rng.uniform(-1.0, 1.0, size)
    eigenvalues[0] = -0.5
    A = Q @ np.diag(eigenvalues) @ Q.T
    added, shifted, _ = factorised((A + A.T) / 2, np.zeros((0, size)), np.zeros((0, 0)), 0)
    assert np.linalg.eigvalsh(shifted).min() > 0
    np.testing.assert_allclose(shifted, A + added * np.eye(size), atol=1e-12)
    assert added <= 8 * -eigenvalues.min() + 1e-12  # multiples grow by eight


def test_rows_of_bounds_need_a_negative_pivot_each_and_unknowns_of_the_border_a_positive_one():
    A, B = np.diag([1.0, 2.0]), np.array([[0.5, 0.0], [1.0, 1.0]])
    C = np.array([[-0.2, 0.3], [0.3, -4.0]])  # an unknown that curves downwards, then a bound
    added, shifted, border = factorised(A, B, C, 1)
    whole = np.block([[shifted, B.T], [B, border]])
    assert np.isfinite(added)
    assert added > 0
    assert (np.linalg.eigvalsh(whole) < 0).sum() == 1
    assert border[1, 1] == -4.0
