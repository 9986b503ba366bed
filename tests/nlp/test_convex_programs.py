"""Directional maxima: the linear program compared with facets in closed form; interval and ellipsoid programs."""

from __future__ import annotations

import cvxpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.capability.joint_capability import fastest_joint_speeds, highest_speeds
from paretoik.errors import SolverFailed
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
@settings(max_examples=60)
def test_the_nearest_facet_is_the_optimum_of_the_linear_program(task, seed, dof, parallel):
    columns, low, high, direction = drawn(seed, task, dof, parallel)
    closed = highest_speeds(columns, low, high, direction[None])[0]
    assert closed == pytest.approx(furthest(columns, low, high, direction)[0], rel=1e-12)


@pytest.mark.parametrize("task", [2, 3])
def test_clarabel_by_cvxpy_agrees_within_its_tolerance(task):
    columns, low, high, direction = drawn(5, task, 6)
    x, v = cvxpy.Variable(len(low)), cvxpy.Variable(nonneg=True)
    problem = cvxpy.Problem(cvxpy.Maximize(v), [columns @ x == v * direction, x >= low, x <= high])
    value = problem.solve(solver="CLARABEL")
    assert furthest(columns, low, high, direction)[0] == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize("task", [2, 3])
@given(seed=seeds, dof=st.integers(3, 8))
@settings(max_examples=60)
def test_joint_speeds_of_a_facet_move_the_tool_there_and_keep_their_ranges(task, seed, dof):
    columns, low, high, direction = drawn(seed, task, dof)
    speed, speeds = (each[0] for each in fastest_joint_speeds(columns[None], low[None], high[None], direction[None]))
    assert speed == highest_speeds(columns, low, high, direction[None])[0]
    vertex = direction * speed
    assert np.abs(columns @ speeds - vertex).max() <= 1e-11 * np.abs(columns).sum() * 2
    assert (speeds >= low).all()
    assert (speeds <= high).all()


def test_columns_that_do_not_span_reach_nothing_else():
    columns = np.array([[1.0, 2.0], [0.0, 0.0]])
    one = np.ones(2)
    assert highest_speeds(columns, -one, one, np.eye(2)).tolist() == [3.0, 0.0]
    assert furthest(columns, -one, one, np.array([0.0, 1.0]))[0] == 0.0


def test_unbounded_directional_maximum_is_refused():
    with pytest.raises(SolverFailed, match="furthest"):
        furthest(np.eye(2), np.full(2, -1.0), np.full(2, 1.0), np.zeros(2))


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


def even_speed(points):
    """Return pieces of a path on which the tool's limit is 1 m/s everywhere."""
    identity = np.tile(np.eye(points.shape[1]), (len(points) - 1, 1, 1))
    return Pieces(values=np.diff(points, axis=0), before=-identity, after=identity)


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


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("task", [2, 3])
@pytest.mark.parametrize("common", [True, False])
def test_clarabel_and_cvxpy_agree(seed, task, common):
    pieces, box = random_pieces(seed, task=task), random_box(seed, task=task)
    ours = IntervalSolver(6, task, common=common).solve(pieces, *box)
    theirs = intervals_by_cvxpy(pieces, *box, common=common)
    assert ours.intervals == pytest.approx(theirs, abs=1e-4)
    assert ours.intervals.sum() == pytest.approx(theirs.sum(), rel=1e-8)


@pytest.mark.parametrize("common", [True, False])
def test_a_solver_that_has_solved_others_answers_as_a_new_one(common):
    solver = IntervalSolver(6, 2, common=common)
    for seed in range(5):
        pieces, box = random_pieces(seed), random_box(seed)
        used, new = solver.solve(pieces, *box), IntervalSolver(6, 2, common=common).solve(pieces, *box)
        assert used.intervals.sum() == pytest.approx(new.intervals.sum(), rel=1e-8)


@pytest.mark.parametrize("units", [1e-6, 1.0, 1e6])
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


def test_at_even_speed_a_bent_path_becomes_straight_with_equal_pieces():
    bent = np.array([[0.0, 0.0], [0.1, 0.4], [0.5, 0.3], [0.6, -0.2], [1.0, 0.5]])
    wide = np.full((3, 2), 2.0)
    solution = IntervalSolver(4, 2).solve(even_speed(bent), -wide, wide)
    assert bent[1:-1] + solution.moves == pytest.approx(np.linspace(bent[0], bent[-1], 5)[1:-1], abs=1e-5)
    assert solution.intervals == pytest.approx(np.full(4, np.hypot(1.0, 0.5) / 4), rel=1e-9)


def test_a_box_without_inside_is_an_error_by_name():
    wide = np.full((3, 2), 1.0)
    with pytest.raises(SolverFailed, match="intervals: Clarabel must end with Solved"):
        IntervalSolver(4, 2).solve(even_speed(np.linspace([0.0, 0.0], [1.0, 0.5], 5)), wide, -wide)


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


@pytest.mark.parametrize("size", [2, 3])
def test_the_basis_is_orthonormal_and_spans_the_symmetric_matrices(size):
    basis = symmetric_basis(size)
    assert np.einsum("pij,qij->pq", basis, basis) == pytest.approx(np.eye(size * (size + 1) // 2))
    matrix = np.arange(size * size, dtype=float).reshape(size, size)
    matrix += matrix.T
    assert np.tensordot(np.einsum("pij,ij->p", basis, matrix), basis, 1) == pytest.approx(matrix)


def test_ellipses_come_back_from_their_radii(samples):
    design, directions, parts, radii, _ = samples
    fitted = fit_inverse_squares(design, directions, radii, design, floor=FLOOR)
    assert fitted == pytest.approx(parts, abs=1e-5)


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


def test_numbers_that_have_no_fit_say_so():
    with pytest.raises(SolverFailed, match="ellipsoid fit: Clarabel must end with optimal"):
        fit_inverse_squares(np.ones((1, 1)), circle(3), np.ones((1, 3)), -np.ones((1, 1)), floor=0.01, bound=1.0)
