import cvxpy
import numpy as np
import pytest

from paretoik.errors import SolverFailed
from paretoik.nlp.convex_programs import IntervalSolver, Pieces


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
    """Pieces of a path where the tool has 1 m/s everywhere."""
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
    with pytest.raises(SolverFailed, match="intervals: Clarabel wanted to end with Solved"):
        IntervalSolver(4, 2).solve(even_speed(np.linspace([0.0, 0.0], [1.0, 0.5], 5)), wide, -wide)
