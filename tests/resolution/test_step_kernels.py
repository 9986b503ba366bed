"""Weighted steps of the compiled resolvers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paretoik.resolution.step_kernels import solve_weighted_task


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
