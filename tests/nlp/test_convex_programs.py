"""Directional maxima: the linear program compared with facets in closed form; interval and ellipsoid programs."""

from __future__ import annotations

import cvxpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.capability.joint_capability import fastest_joint_speeds, highest_speeds
from paretoik.nlp.convex_programs import IntervalSolver, Pieces, fit_inverse_squares, furthest, symmetric_basis

seeds = st.integers(0, 10**6)


def drawn(seed, task, dof, parallel=False):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(task, dof))
    if parallel:
        columns = columns[:, :1] * rng.normal(size=dof)
    direction = columns[:, 0] if parallel else rng.normal(size=task)
    return columns, -rng.uniform(0, 2, dof), rng.uniform(0, 2, dof), direction / np.linalg.norm(direction)


@pytest.mark.parametrize("task", [2, 3])
@given(seed=seeds, dof=st.integers(3, 8), parallel=st.booleans())
@settings(max_examples=20)
def test_the_nearest_facet_is_the_optimum_of_the_linear_program(task, seed, dof, parallel):
    columns, low, high, direction = drawn(seed, task, dof, parallel)
    closed = highest_speeds(columns, low, high, direction[None])[0]
    assert closed == pytest.approx(furthest(columns, low, high, direction)[0], rel=1e-12)


@pytest.mark.parametrize("task", [2, 3])
@given(seed=seeds, dof=st.integers(3, 8))
@settings(max_examples=20)
def test_joint_speeds_of_a_facet_move_the_tool_there_and_keep_their_ranges(task, seed, dof):
    columns, low, high, direction = drawn(seed, task, dof)
    speed, speeds = (each[0] for each in fastest_joint_speeds(columns[None], low[None], high[None], direction[None]))
    assert speed == highest_speeds(columns, low, high, direction[None])[0]
    vertex = direction * speed
    assert np.abs(columns @ speeds - vertex).max() <= 1e-11 * np.abs(columns).sum() * 2
    assert (speeds >= low).all()
    assert (speeds <= high).all()


def random_pieces(seed, *, count=6, task=2):
    rng = np.random.default_rng(seed)
    return Pieces(
        values=rng.normal(size=(count, task)),
        before=rng.normal(size=(count, task, task)) - np.eye(task),
        after=rng.normal(size=(count, task, task)) + np.eye(task),
    )


def random_box(seed, *, count=6, task=2):
    lower, upper = np.random.default_rng(seed).uniform(0.05, 0.5, size=(2, count - 1, task))
    return -lower, upper


def intervals_by_cvxpy(pieces, lower, upper, *, common):
    count, task = pieces.values.shape
    d, intervals = cvxpy.Variable((count + 1, task)), cvxpy.Variable(count)
    constraints = [d[0] == 0, d[count] == 0, d[1:-1] >= lower, d[1:-1] <= upper]
    constraints += [intervals == intervals[0]] if common else []
    for i in range(count):
        time = pieces.values[i] + pieces.before[i] @ d[i] + pieces.after[i] @ d[i + 1]
        constraints.append(cvxpy.norm(time) <= intervals[i])
    problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum(intervals)), constraints)
    problem.solve(solver="CLARABEL", tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10)
    return intervals.value


@pytest.mark.parametrize(("seed", "task", "common"), [(0, 2, True), (1, 3, False)])
def test_clarabel_and_cvxpy_agree(seed, task, common):
    pieces, box = random_pieces(seed, task=task), random_box(seed, task=task)
    ours = IntervalSolver(6, task, common=common).solve(pieces, *box)
    theirs = intervals_by_cvxpy(pieces, *box, common=common)
    assert ours.intervals == pytest.approx(theirs, abs=1e-4)
    assert ours.intervals.sum() == pytest.approx(theirs.sum(), rel=1e-8)


@pytest.mark.parametrize("units", [1e-6, 1e6])
def test_moves_keep_the_box_and_the_limits_in_any_units(units):
    pieces, (lower, upper) = random_pieces(1), random_box(1)
    scaled = Pieces(values=units * pieces.values, before=units * pieces.before, after=units * pieces.after)
    solution = IntervalSolver(6, 2).solve(scaled, lower, upper)
    assert np.all(solution.moves >= lower - 1e-8)
    assert np.all(solution.moves <= upper + 1e-8)
    ends = np.pad(solution.moves, ((1, 1), (0, 0)))
    times = np.einsum("lij,lj->li", pieces.before, ends[:-1]) + np.einsum("lij,lj->li", pieces.after, ends[1:])
    assert np.all(np.linalg.norm(pieces.values + times, axis=1) <= solution.intervals / units + 1e-8)
    assert np.ptp(solution.intervals) == 0.0


# The convex fit of ellipsoids: exact if possible, below its samples if required, never worse than another fit.


FLOOR = 1e-3


def circle(size):
    angles = np.pi * np.arange(size) / size
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def radii_of(design, parts, directions):
    products = np.einsum("ki,pij,kj->kp", directions, symmetric_basis(directions.shape[1]), directions)
    return (design @ parts @ products.T) ** -0.5


def error(design, parts, directions, radii):
    ratio = radii_of(design, parts, directions) / radii
    return np.sum((ratio - 1 / ratio) ** 2)


@pytest.fixture
def samples():
    """Return two ellipses that share their unknowns, and samples with errors of 10 % in either direction."""
    rng = np.random.default_rng(0)
    design, directions = np.array([[1.0, -0.5], [1.0, 0.5], [1.0, 0.0]]), circle(9)
    parts = np.array([[1.0, 0.2, 0.6], [0.3, 0.1, -0.2]])
    radii = radii_of(design, parts, directions)
    return design, directions, parts, radii, radii * np.exp(rng.uniform(-0.1, 0.1, size=radii.shape))


def test_a_bound_is_met_by_every_radius(samples):
    design, directions, _, _, radii = samples
    bounded = fit_inverse_squares(design, directions, radii, design, floor=FLOOR, bound=1.1)
    ratio = (radii / radii_of(design, bounded, directions)) ** 2
    assert ratio.min() == pytest.approx(1.1, abs=1e-8)


@pytest.mark.parametrize("bound", [None, 1.0])
def test_nothing_else_has_smaller_errors(samples, bound):
    design, directions, _, _, radii = samples
    fitted, rng = (
        fit_inverse_squares(design, directions, radii, design, floor=FLOOR, bound=bound),
        np.random.default_rng(1),
    )
    lowest_error = error(design, fitted, directions, radii)
    for size in np.geomspace(1e-4, 0.1, 40):
        other = fitted + size * rng.normal(size=fitted.shape)
        if bound is not None:  # scaled until all radii are below the samples
            other = other * np.max((radii_of(design, other, directions) / radii) ** 2)
        assert error(design, other, directions, radii) > lowest_error


def test_matrices_stay_above_the_floor():
    directions = circle(3)
    radii = np.array([[10.0, 10.0, 1.0]])  # no ellipse with such radii has real axes
    (parts,) = fit_inverse_squares(np.ones((1, 1)), directions, radii, np.ones((1, 1)), floor=0.01)
    assert np.linalg.eigvalsh(np.tensordot(parts, symmetric_basis(2), 1))[0] == pytest.approx(0.01, rel=1e-4)
