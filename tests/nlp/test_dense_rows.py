"""Restored equalities: they are satisfied afterwards, linear ones by the shortest step."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.compilation.array_tuples import keep, refer
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.banded import kernel as kernel_steps
from paretoik.nlp.dense import dense_kernel as dense_restoration
from paretoik.nlp.dense.dense_kernel import dense_kernel
from paretoik.nlp.dense.traced_rows import trace_rows


@compiled
def restore(kernel, x):
    problem = refer(kernel)
    work = kernel_steps.allocate_workspace(problem, x)
    violation = dense_restoration.restore_equalities(problem, refer(work), x)
    keep(work)
    return violation


def restored(unknowns, equalities, x):
    """Return the remaining violation and the point, from x."""
    kernel = dense_kernel(trace_rows(unknowns, 0, lambda z, _: (equalities(z), [])).at(), np.eye(unknowns))
    x = np.array(x, dtype=float)
    return restore(kernel, x), x


@settings(max_examples=10)
@given(st.integers(0, 1000))
def test_linear_equalities_are_met_by_the_shortest_step(seed):
    rng = np.random.default_rng(seed)
    A, b, start = rng.normal(size=(2, 5)), rng.normal(size=2), rng.normal(size=5)
    violation, x = restored(5, lambda z: [sum(A[i, j] * z[j] for j in range(5)) - b[i] for i in range(2)], start)
    assert violation == 0.0
    np.testing.assert_allclose(x, start + np.linalg.pinv(A) @ (b - A @ start), atol=1e-9)


@pytest.mark.parametrize("start", [[3.0, 4.0], [1e-3, 0.0], [-20.0, 0.1]])
def test_a_circle_is_met_from_far_away_and_from_near_its_center(start):
    violation, x = restored(2, lambda z: [z[0] * z[0] + z[1] * z[1] - 1.0], start)
    assert violation == 0.0
    np.testing.assert_allclose(x, np.divide(start, np.linalg.norm(start)), atol=1e-9)  # gradients are radial


def test_contradicting_equalities_end_at_the_least_violation():
    violation, x = restored(1, lambda z: [z[0] * z[0] + 0.25], [1.0])
    assert violation == pytest.approx(0.25, abs=1e-6)
    assert abs(x[0]) < 1e-3
