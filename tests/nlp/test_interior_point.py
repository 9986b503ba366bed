"""Interior points: comparison with IPOPT and linear programs, known minima, and starts far away."""

from __future__ import annotations

from types import SimpleNamespace

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from paretoik.nlp.banded.interior_point import _filter_accepts, minimise
from paretoik.nlp.dense.dense_program import DenseProgram
from paretoik.nlp.dense.traced_rows import trace_rows
from paretoik.nlp.program import CONVERGED, InteriorPointOptions
from paretoik.stop_flag import STOP

OPTIONS = InteriorPointOptions(barrier=1e-2, iterations=300)
LAST = np.array([0.0, 0.0, 0.0, 0.0, 1.0])


def bounds_of(rows, upper):
    """Return bounds rows · z ≤ upper."""
    return SimpleNamespace(rows=np.array(rows), upper=np.array(upper))


def minimise_dense(program, cost, start, bounds=None, options=OPTIONS):
    """Return the local minimum of cost · z by the compiled method, which also returns multipliers."""
    bounds = bounds or bounds_of(np.zeros((0, len(start))), [])
    dense = DenseProgram(rows=program, costs=np.concatenate([cost[None], bounds.rows]))
    identity = np.eye(len(dense.costs))
    x, status, _, _, multipliers, _, violation = minimise(
        dense.kernel, start, identity[0], identity[1:], bounds.upper, options, STOP
    )
    return SimpleNamespace(
        x=x, status=status, converged=status == CONVERGED, multipliers=multipliers, violation=violation
    )


def bowl(seed):
    """Return a convex program: the last unknown is above exponentials and squares, in two balls and on a plane."""
    rng = np.random.default_rng(seed)
    a, p, plane = rng.normal(size=(3, 4)), 0.4 * rng.normal(size=(2, 4)), rng.normal(size=4)
    squared_radii = rng.uniform(0.5, 2.0, 2)

    def rows(z, reference, exp=np.exp):
        x, above = [z[i] for i in range(4)], z[4]
        value = sum(exp(sum(one[i] * x[i] for i in range(4))) for one in a) + sum(
            (1 + i) * x[i] * x[i] for i in range(4)
        )
        balls = [squared_radii[k] - sum((x[i] - p[k, i]) ** 2 for i in range(4)) for k in range(2)]
        return [sum(plane[i] * x[i] for i in range(4)) - 0.3], [above - value, *balls]

    return rows


def ipopt(rows, cost, start, bounds=None):
    z = casadi.SX.sym("z", len(cost))
    equal, room = rows(z, [], casadi.exp)
    if bounds is not None:
        room = [*room, *casadi.vertsplit(casadi.DM(bounds.upper) - casadi.mtimes(casadi.DM(bounds.rows), z))]
    solver = casadi.nlpsol(
        "solver",
        "ipopt",
        {"x": z, "f": casadi.dot(casadi.DM(cost), z), "g": casadi.vertcat(*equal, *room)},
        {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-11}},
    )
    lower = np.zeros(len(equal) + len(room))
    solution = solver(x0=start, lbg=lower, ubg=np.where(np.arange(len(lower)) < len(equal), 0.0, np.inf))
    assert solver.stats()["success"]
    return solution["x"].full().ravel()


def hock_schittkowski_71(z, reference):
    one, two, three, four, above = (z[i] for i in range(5))
    within = [one - 1, 5 - one, two - 1, 5 - two, three - 1, 5 - three, four - 1, 5 - four]
    value = one * four * (one + two + three) + three
    return [one**2 + two**2 + three**2 + four**2 - 40], [above - value, one * two * three * four - 25, *within]


def check_conditions(program, cost, solution, bounds=None, within=1e-7):
    """Check that multipliers are not negative, count only at limits, and balance the cost along the equalities."""
    equal, room = program.rows(solution.x)
    slopes = program.jacobian(solution.x)
    ahead, across = slopes[: len(equal)], slopes[len(equal) :]
    if bounds is not None:
        room, across = np.append(room, bounds.upper - bounds.rows @ solution.x), np.concatenate([across, -bounds.rows])
    assert np.abs(equal).max(initial=0.0) <= 1e-9
    assert room.min(initial=0.0) >= -1e-9
    assert solution.multipliers.shape == room.shape
    assert solution.multipliers.min(initial=0.0) >= 0.0
    assert np.abs(solution.multipliers * room).max(initial=0.0) <= 1e-9 * max(1.0, np.linalg.norm(cost))
    left = cost - across.T @ solution.multipliers
    if len(equal):
        left = left - ahead.T @ np.linalg.lstsq(ahead.T, left, rcond=None)[0]
    assert np.abs(left).max() <= within * max(1.0, solution.multipliers.max(initial=0.0))


@pytest.mark.parametrize("seed", range(3))
def test_convex_program_has_ipopts_minimum_from_any_start(seed):
    rows, rng = bowl(seed), np.random.default_rng(seed + 100)
    program, theirs = trace_rows(5, 0, rows).at(), ipopt(rows, LAST, np.zeros(5))
    for size in (0.1, 1.0, 5.0, 20.0):
        solution = minimise_dense(program, LAST, size * rng.normal(size=5))
        assert solution.converged
        assert solution.x == pytest.approx(theirs, abs=1e-6)
        check_conditions(program, LAST, solution)


@pytest.mark.parametrize("seed", range(2))
def test_bounds_are_rows_like_all_others(seed):
    rows, rng = bowl(seed), np.random.default_rng(seed)
    program, free = trace_rows(5, 0, rows).at(), ipopt(rows, LAST, np.zeros(5))
    way = np.append(rng.normal(size=4), 0.0)
    bounds = bounds_of([way, -LAST], [way @ free - 0.05, 100.0])
    theirs = ipopt(rows, LAST, free, bounds)
    solution = minimise_dense(program, LAST, rng.normal(size=5), bounds=bounds)
    assert solution.converged
    assert solution.x == pytest.approx(theirs, abs=1e-6)
    check_conditions(program, LAST, solution, bounds)
    moved = [bounds_of(bounds.rows, bounds.upper + np.array([step, 0.0])) for step in (-1e-4, 1e-4)]
    worth = [minimise_dense(program, LAST, free, each).x[4] for each in moved]
    assert solution.multipliers[3] == pytest.approx((worth[0] - worth[1]) / 2e-4, rel=1e-4)
    assert solution.multipliers[4] == pytest.approx(0.0, abs=1e-9)


def test_textbook_program_reaches_its_best_known_minimum_from_many_starts():
    """Program 71 of Hock & Schittkowski 1981: 17.0140173 at (1, 4.743, 3.8211, 1.3794)."""
    program, rng = trace_rows(5, 0, hock_schittkowski_71).at(), np.random.default_rng(0)
    starts = [np.array([1.0, 5.0, 5.0, 1.0, 16.0]), *rng.uniform(1.0, 5.0, (8, 5)), np.full(5, 8.0)]
    for start in starts:
        solution = minimise_dense(program, LAST, start)
        assert solution.converged
        assert solution.x[4] == pytest.approx(17.0140173, abs=1e-7)
        assert solution.x[:4] == pytest.approx([1.0, 4.7429994, 3.8211503, 1.3794082], abs=1e-6)
        check_conditions(program, LAST, solution)


def test_rosenbrocks_valley_is_followed_to_its_minimum_on_a_circle():
    """Rosenbrock's function in the unit disc: 0.0456748 at (0.7864, 0.6177)."""

    def rows(z, reference):
        value = 100.0 * (z[1] - z[0] * z[0]) ** 2 + (1.0 - z[0]) ** 2
        return [], [z[2] - value, 1.0 - z[0] ** 2 - z[1] ** 2]

    program, cost = trace_rows(3, 0, rows).at(), np.array([0.0, 0.0, 1.0])
    for start in ([0.0, 0.0, 0.0], [-1.2, 1.0, 0.0], [3.0, -3.0, 5.0], [-0.9, -0.9, 0.0]):
        solution = minimise_dense(program, cost, np.array(start))
        assert solution.converged
        assert solution.x == pytest.approx([0.7864151, 0.6176983, 0.0456748], abs=1e-6)
        check_conditions(program, cost, solution)


@pytest.mark.parametrize("start", [[0.5, 0.01], [2.0, -0.2]])
def test_search_leaves_a_saddle_on_either_side(start):
    def rows(z, reference):
        return [], [z[2] - (z[0] ** 2 - z[1] ** 2 + z[1] ** 4), 4.0 - z[2]]

    program, cost = trace_rows(3, 0, rows).at(), np.array([0.0, 0.0, 1.0])
    solution = minimise_dense(program, cost, np.array([*start, 1.0]))
    assert solution.converged
    assert solution.x[2] == pytest.approx(-0.25, abs=1e-9)
    assert [solution.x[0], abs(solution.x[1])] == pytest.approx([0.0, np.sqrt(0.5)], abs=1e-4)


BEALE = {  # where the simplex method cycled
    "c": [-0.75, 20.0, -0.5, 6.0],
    "A": [[0.25, -8.0, -1.0, 9.0], [0.5, -12.0, -0.5, 3.0], [0.0, 0.0, 1.0, 0.0]],
    "b": [0.0, 0.0, 1.0],
}
EDGE = {"c": [-1.0, -1.0], "A": [[1.0, 1.0], [1.0, 1.0], [2.0, 2.0], [1.0, 0.0]], "b": [1.0, 1.0, 2.0, 1.0]}
TIP = {"c": [-1.0, -2.0], "A": [[1.0, 1.0], [1.0, 2.0], [0.0, 1.0], [-1.0, 1.0]], "b": [1.0, 2.0, 1.0, 1.0]}


@pytest.mark.parametrize("given", [BEALE, EDGE, TIP], ids=["cycling", "an edge", "too many rows in a corner"])
def test_linear_programs_without_a_clear_corner_come_to_their_least_value(given):
    c, table, right = (np.array(given[name]) for name in "cAb")

    def rows(z, reference):
        below = [right[i] - sum(table[i, j] * z[j] for j in range(len(c))) for i in range(len(right))]
        return [], [*below, *z]

    program, reference = trace_rows(len(c), 0, rows).at(), linprog(c, table, right)
    for start in (np.zeros(len(c)), np.full(len(c), 3.0), np.linspace(-2.0, 1.0, len(c))):
        solution = minimise_dense(program, c, start)
        assert solution.converged
        assert c @ solution.x == pytest.approx(reference.fun, abs=1e-8)
        check_conditions(program, c, solution)


@pytest.mark.parametrize(
    ("rows", "violation"),
    [
        (lambda z, reference: ([], [z[0] - 1.0, -1.0 - z[0]]), 1.0),
        (lambda z, reference: ([z[0] + z[1] - 1.0], [z[0] + z[1] - 3.0, z[0] + 5.0, z[1] + 5.0]), 1.0),
    ],
    ids=["two sides", "a line and a half plane"],
)
def test_contradicting_bounds_are_reported(rows, violation):
    program = trace_rows(2, 0, rows).at()
    solution = minimise_dense(program, np.array([1.0, 0.0]), np.array([0.7, 0.2]))
    assert not solution.converged
    assert solution.violation >= violation - 1e-6
    assert solution.violation == max(0.0, *np.abs(program.rows(solution.x)[0]), *-program.rows(solution.x)[1])


@pytest.mark.parametrize("start", [0.01, 50.0])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_steps_to_where_rows_are_not_finite_are_shortened(start):
    """The epigraph of z − log z has the minimum 1; Newton's step from z > 2 goes past 0."""
    program = trace_rows(2, 0, lambda z, reference: ([], [z[1] - (z[0] - np.log(z[0]))])).at()
    solution = minimise_dense(program, np.array([0.0, 1.0]), np.array([start, 0.0]))
    assert solution.converged
    assert solution.x == pytest.approx([1.0, 1.0], abs=1e-5)


# The filter of the line search: Armijo's condition if nothing is violated, else a gain in residual or merit.


SEARCH_OPTIONS = InteriorPointOptions()


def accepts(theta, before, trial_theta, after, slope, length=1.0, infeasible=1e-4, entries=()):
    table = np.zeros((10, 2))
    table[: len(entries)] = np.reshape(entries, (-1, 2))
    accepted, count = _filter_accepts(
        theta, before, trial_theta, after, slope, length, infeasible, table, len(entries), SEARCH_OPTIONS
    )
    return accepted, table[:count].tolist()


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-5, -1e-3), st.floats(1e-3, 1))
def test_without_residuals_a_step_is_taken_by_armijos_condition(before, after, slope, length):
    allowed = after <= before + SEARCH_OPTIONS.armijo * length * slope + SEARCH_OPTIONS.merit_rounding * abs(before)
    assert accepts(0.0, before, 0.0, after, slope, length) == (allowed, [])


def test_a_step_that_an_entry_of_the_filter_dominates_is_refused():
    assert accepts(1.0, 0.0, 0.5, -1.0, 1.0, entries=[[0.2, -2.0]]) == (False, [[0.2, -2.0]])
    assert accepts(1.0, 0.0, 0.1, -1.0, 1.0, entries=[[0.2, -2.0]])[0]
    assert accepts(1.0, 0.0, 0.5, -3.0, 1.0, entries=[[0.2, -2.0]])[0]


def test_only_a_step_that_promises_far_more_than_its_residuals_has_to_decrease_the_merit():
    """Wächter & Biegler 2006, Eq. 19: length (-slope)^2.3 ≥ residuals^1.1, here 3.2e-6."""
    steps = {"theta": 1e-5, "before": 0.0, "trial_theta": 5e-6, "after": 1.0}
    assert accepts(**steps, slope=-1e-3) == (True, [[1e-5, 0.0]])  # 1.3e-7
    assert accepts(**steps, slope=-1e-1) == (False, [])  # 5e-3
