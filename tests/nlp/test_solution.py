"""Parametric quadratic programs solved from a guess of their multipliers."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.nlp.parametric_qp.homotopy import QpOptions, solve_from


def solved(H, g, A, c, y, *, band=None, border=0, dense=0):
    """Return the solution; H has a band and a border of these sizes, and the last rows are dense."""
    n, limits = len(g), len(A) - dense
    size = n - border
    lower = np.zeros((size, size if band is None else band))
    for i in range(size):
        for d in range(min(i + 1, lower.shape[1])):
            lower[i, d] = H[i, i - d]
    entries = np.ascontiguousarray(A[:limits])
    columns = np.tile(np.arange(n), (limits, 1)).reshape(limits, n)
    step, multipliers, share, changes = solve_from(
        lower, H[size:, :size].copy(), H[size:, size:].copy(), g, columns, entries, A[limits:].copy(), c, y, QpOptions()
    )
    return SimpleNamespace(step=step, multipliers=multipliers, share=share, changes=changes)


def drawn(seed, *, repeated=False):
    """Return a convex program with a feasible point at which some constraints are active."""
    rng = np.random.default_rng(seed)
    columns, rows = int(rng.integers(2, 12)), int(rng.integers(1, 25))
    root, A = rng.normal(size=(columns, columns)), rng.normal(size=(rows, columns))
    slack = np.abs(rng.normal(size=rows)) * (rng.random(rows) > 0.3)
    c = slack - A @ rng.normal(size=columns)
    if repeated and rows > 2:
        A[-1], c[-1] = 2 * A[0], 2 * c[0]
    return root @ root.T + 0.1 * np.eye(columns), rng.normal(size=columns), A, c


def guess(seed, A):
    """Return positive multipliers of some independent rows."""
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


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.booleans(), st.integers(0, 3), st.integers(0, 3))
def test_from_any_guess_the_optimum_is_found(seed, repeated, border, dense):
    H, g, A, c = drawn(seed, repeated=repeated)
    border, dense = min(border, len(g) - 1), min(dense, len(A))
    assert_optimal(solved(H, g, A, c, guess(seed, A), border=border, dense=dense), H, g, A, c)


def chain(seed):
    """Return a program of neighbours: H has a band of two, every constraint has one entry or two adjacent ones."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(6, 30))
    H = np.diag(2.5 + rng.random(n)) - np.eye(n, k=1) - np.eye(n, k=-1)
    A = np.concatenate([np.eye(n), -np.eye(n), np.eye(n)[1:] - np.eye(n)[:-1]])
    return H, 5 * rng.normal(size=n), A, 0.3 + rng.random(len(A))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_a_band_answers_as_a_dense_matrix_does(seed):
    H, g, A, c = chain(seed)
    banded, dense = solved(H, g, A, c, np.zeros(len(A)), band=2), solved(H, g, A, c, np.zeros(len(A)), dense=len(A))
    assert_optimal(banded, H, g, A, c)
    assert banded.step == pytest.approx(dense.step, abs=1e-9)
    assert banded.changes == dense.changes


def test_from_its_own_multipliers_an_optimum_takes_no_change():
    for seed in range(20):
        H, g, A, c = drawn(seed)
        first = solved(H, g, A, c, np.zeros(len(A)))
        again = solved(H, g, A, c, first.multipliers)
        assert again.step == pytest.approx(first.step, abs=1e-8)
        assert again.changes == 0


def test_more_changes_than_one_factorisation_takes_lead_to_the_optimum():
    H, g, A, c = chain(3)
    c[:] = 0.05
    solution = solved(H, g, A, c, np.zeros(len(A)), band=2)
    assert solution.changes > QpOptions().updates
    assert_optimal(solution, H, g, A, c)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_units_of_objective_and_constraints_change_nothing(seed, unit, other):
    H, g, A, c = drawn(seed)
    units = other ** np.linspace(-1, 1, len(A))
    plain = solved(H, g, A, c, np.zeros(len(A)))
    scaled = solved(unit * H, unit * g, units[:, None] * A, units * c, np.zeros(len(A)))
    assert scaled.step == pytest.approx(plain.step, abs=1e-7)
    assert scaled.multipliers * units / unit == pytest.approx(plain.multipliers, abs=1e-6)


@pytest.mark.parametrize("dense", [0, 2])
def test_constraints_that_cannot_all_hold_end_the_homotopy(dense):
    A, c = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([-1.0, 0.5])  # x ≥ 1 and x ≤ 0.5
    assert solved(np.eye(2), np.zeros(2), A, c, np.zeros(2), dense=dense).share < 1.0


@pytest.mark.parametrize("dense", [0, 1])
def test_negative_curvature_along_active_constraints_ends_the_homotopy(dense):
    H, g = np.diag([1.0, -1.0]), np.array([0.0, 1.0])
    across, along = np.array([[0.0, 1.0]]), np.array([[1.0, 0.0]])
    fixed = solved(H, g, across, np.zeros(1), np.array([1.0]), dense=dense)
    assert_optimal(fixed, H, g, across, np.zeros(1))
    assert solved(H, -g, across, np.zeros(1), np.array([1.0]), dense=dense).share < 1.0
    assert solved(H, g, along, np.zeros(1), np.array([1.0]), dense=dense).share == 0.0


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_a_linear_program_is_followed_to_its_vertex(seed):
    H, g, A, c = chain(seed)
    guess = np.concatenate([g.clip(0), (-g).clip(0), np.zeros(len(g) - 1)])
    assert_optimal(solved(0 * H, g, A, c, guess), 0 * H, g, A, c)


def degenerate(seed):
    """Return a program that is not convex; several constraints are active at the first point."""
    rng = np.random.default_rng(seed)
    columns, rows = int(rng.integers(2, 7)), int(rng.integers(1, 16))
    root = rng.normal(size=(columns, columns))
    H = root + root.T if seed % 2 else root[:, :1] @ root[:, :1].T  # indefinite, or of rank one
    A = rng.integers(-2, 3, size=(rows, columns)).astype(float)
    A[~A.any(axis=1), 0] = 1.0
    return H, rng.normal(size=columns), A, np.abs(rng.normal(size=rows)) * (rng.random(rows) > 0.5)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_no_answer_is_a_saddle(seed):
    H, g, A, c = degenerate(seed)
    solution = solved(H, g, A, c, guess(seed, A))
    assert np.isfinite(solution.step).all()
    if solution.share == 1.0:
        active = A[solution.multipliers > 0.0]
        tangents = np.linalg.svd(active)[2][len(active) :].T if len(active) else np.eye(len(g))
        assert np.linalg.eigvalsh(tangents.T @ H @ tangents).min(initial=0.0) >= -1e-9 * np.abs(H).max()
