"""Quadratic programs solved from a guess of their multipliers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import sparse

from paretoik.nlp.parametric_qp import solve_from


def drawn(seed, *, repeated=False):
    """A convex program with a point inside its constraints, some of which meet there."""
    rng = np.random.default_rng(seed)
    columns, rows = int(rng.integers(2, 12)), int(rng.integers(1, 25))
    root, A = rng.normal(size=(columns, columns)), rng.normal(size=(rows, columns))
    slack = np.abs(rng.normal(size=rows)) * (rng.random(rows) > 0.3)
    c = slack - A @ rng.normal(size=columns)
    if repeated and rows > 2:
        A[-1], c[-1] = 2 * A[0], 2 * c[0]
    return root @ root.T + 0.1 * np.eye(columns), rng.normal(size=columns), A, c


def guess(seed, A):
    """Multipliers of some independent rows."""
    rng = np.random.default_rng([seed, 1])
    rows = rng.permutation(len(A))[: int(rng.integers(0, min(A.shape) + 1))]
    multipliers = np.zeros(len(A))
    if np.linalg.matrix_rank(A[rows]) == len(rows):
        multipliers[rows] = rng.random(len(rows))
    return multipliers


def assert_optimal(solution, H, g, A, c):
    d, y = solution.step, solution.multipliers
    size = 1 + np.abs(y).max(initial=0.0)
    assert solution.share == 1.0
    assert np.abs(H @ d + g - A.T @ y).max() <= 1e-8 * size
    assert (c + A @ d).min() >= -1e-8
    assert y.min() >= 0.0
    assert np.abs(y * (c + A @ d)).max() <= 1e-8 * size


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_from_any_guess_the_optimum_is_found(seed, repeated):
    H, g, A, c = drawn(seed, repeated=repeated)
    assert_optimal(solve_from(H, g, sparse.csr_array(A), c, guess(seed, A)), H, g, A, c)


def test_from_its_own_multipliers_an_optimum_takes_no_change():
    for seed in range(20):
        H, g, A, c = drawn(seed)
        first = solve_from(H, g, sparse.csr_array(A), c, np.zeros(len(A)))
        again = solve_from(H, g, sparse.csr_array(A), c, first.multipliers)
        assert again.step == pytest.approx(first.step, abs=1e-8)
        assert again.changes == 0


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_units_of_objective_and_constraints_change_nothing(seed, unit, other):
    H, g, A, c = drawn(seed)
    units = other ** np.linspace(-1, 1, len(A))
    plain = solve_from(H, g, sparse.csr_array(A), c, np.zeros(len(A)))
    scaled = solve_from(unit * H, unit * g, sparse.csr_array(units[:, None] * A), units * c, np.zeros(len(A)))
    assert scaled.step == pytest.approx(plain.step, abs=1e-7)
    assert scaled.multipliers * units / unit == pytest.approx(plain.multipliers, abs=1e-6)


def test_constraints_that_cannot_all_hold_end_the_way():
    A, c = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([-1.0, 0.5])  # x ≥ 1 and x ≤ 0.5
    solution = solve_from(np.eye(2), np.zeros(2), sparse.csr_array(A), c, np.zeros(2))
    assert solution.share < 1.0


def test_negative_curvature_along_active_constraints_ends_the_way():
    H, g = np.diag([1.0, -1.0]), np.array([0.0, 1.0])
    held = solve_from(H, g, sparse.csr_array([[0.0, 1.0]]), np.zeros(1), np.array([1.0]))
    assert_optimal(held, H, g, np.array([[0.0, 1.0]]), np.zeros(1))
    released = solve_from(H, -g, sparse.csr_array([[0.0, 1.0]]), np.zeros(1), np.array([1.0]))
    assert released.share < 1.0
    assert solve_from(H, g, sparse.csr_array([[1.0, 0.0]]), np.zeros(1), np.array([1.0])).share == 0.0


def degenerate(seed):
    """A program without positive curvature everywhere, of whose constraints several meet at the first point."""
    rng = np.random.default_rng(seed)
    columns, rows = int(rng.integers(2, 7)), int(rng.integers(1, 16))
    root = rng.normal(size=(columns, columns))
    H = root + root.T if seed % 2 else root[:, :1] @ root[:, :1].T  # indefinite, or of rank one
    A = rng.integers(-2, 3, size=(rows, columns)).astype(float)
    A[~A.any(axis=1), 0] = 1.0
    return H, rng.normal(size=columns), A, np.abs(rng.normal(size=rows)) * (rng.random(rows) > 0.5)


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 10**6))
@example(80)  # once an exception
@example(2)  # once a wrong answer
@example(25)  # once a saddle
def test_without_curvature_the_way_ends_or_leads_to_a_minimum(seed):
    H, g, A, c = degenerate(seed)
    solution = solve_from(H, g, sparse.csr_array(A), c, guess(seed, A))
    if solution.share == 1.0:
        assert_optimal(solution, H, g, A, c)
        active = A[solution.multipliers > 0.0]
        tangents = np.linalg.svd(active)[2][len(active) :].T if len(active) else np.eye(len(g))
        assert np.linalg.eigvalsh(tangents.T @ H @ tangents).min(initial=0.0) >= -1e-9 * np.abs(H).max()


def test_two_directions_of_negative_curvature_are_no_minimum():
    nothing = sparse.csr_array((0, 2))
    assert solve_from(-np.eye(2), np.array([1.0, 0.5]), nothing, np.zeros(0), np.zeros(0)).share == 0.0
