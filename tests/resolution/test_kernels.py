"""Damping of the compiled resolvers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.resolution.kernels import squared_damping


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
