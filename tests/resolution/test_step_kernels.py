"""Damping and weighted steps of the compiled resolvers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.resolution.step_kernels import (
    criterion_weight,
    solve_weighted_task,
    squared_damping,
)


@given(seed=st.integers(0, 10_000), rows=st.integers(1, 6), smallest=st.floats(0.0, 0.05))
def test_damping_is_that_of_the_least_singular_value(seed, rows, smallest):
    rng = np.random.default_rng(seed)
    left, _ = np.linalg.qr(rng.normal(size=(rows, rows)))
    sizes = np.append(rng.uniform(0.1, 2.0, rows - 1), smallest)
    matrix = (left * sizes**2) @ left.T
    work = np.empty((rows, rows)), np.empty((rows, rows))
    damping = max(0.0, 0.03**2 * (1 - (smallest / 0.02) ** 2))
    assert squared_damping(matrix, 0.02, 0.03, *work) == pytest.approx(damping, abs=1e-12)
    assert squared_damping(matrix, 0.0, 0.03, *work) == 0.0


@given(seed=st.integers(0, 10_000), n=st.integers(2, 7), beyond=st.integers(0, 7))
def test_weighted_steps_are_exact_for_joints_beyond_their_limits(seed, n, beyond):
    rng = np.random.default_rng(seed)
    rows = int(rng.integers(1, n))
    J, v, D = rng.normal(size=(rows, n)), rng.normal(size=rows), rng.uniform(0.1, 1.0, n)
    D[rng.permutation(n)[:beyond]] = 1e-12  # the least weight; see least_norm_weight
    velocities = np.empty(n)
    solve_weighted_task(J, D, v, np.empty((rows, n)), np.zeros((rows, rows)), np.empty(n), velocities)
    exact = exact_weighted_step(J, D, v)
    np.testing.assert_allclose(velocities, exact, rtol=0, atol=1e-11 * np.abs(exact).max())


def exact_weighted_step(J, D, v):
    """Return D Jᵀ (J D Jᵀ)⁻¹ v by rational numbers."""
    J, D, v = (np.vectorize(Fraction, otypes=[object])(part) for part in (J, D, v))
    matrix = np.column_stack([(J * D) @ J.T, v])
    for i in range(len(v)):  # Gauss and Jordan; leading minors are positive
        matrix[i] = matrix[i] / matrix[i, i]
        for k in range(len(v)):
            if k != i:
                matrix[k] = matrix[k] - matrix[k, i] * matrix[i]
    return (D * (J.T @ matrix[:, -1])).astype(float)


# Weights of criteria


@given(value=st.floats(0.0, 10.0), band=st.floats(0.0, 0.45))
def test_coefficients_are_the_papers_cubic(value, band):
    low, high = band, 1 - band
    denominator = low**3 - 3 * low**2 * high + 3 * low * high**2 - high**3
    a, b = -2 / denominator, (3 * low + 3 * high) / denominator
    c, d = -6 * low * high / denominator, (3 * low * high**2 - high**3) / denominator
    for normalised, sign, exponent in ((np.exp(-value), 1.0, -value), (1 - np.exp(-value), -1.0, value)):
        inside = a * normalised**3 + b * normalised**2 + c * normalised + d
        weight = 1.0 if normalised <= low else 0.0 if normalised >= high else inside
        assert criterion_weight(exponent, sign, band) == pytest.approx(weight, abs=1e-9)
