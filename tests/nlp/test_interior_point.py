"""Interior points beside IPOPT and linear programs, on programs with known minima, and from places that are far off."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
from scipy.optimize import linprog

from paretoik.errors import EvaluationFailed
from paretoik.nlp.dense_sqp import Caps
from paretoik.nlp.interior_point import OPTIONS, minimise_dense
from paretoik.nlp.traced import smooth

LAST = np.array([0.0, 0.0, 0.0, 0.0, 1.0])


def bowl(seed):
    """A convex program: the last unknown lies above exponentials and squares, in two balls and on a plane."""
    rng = np.random.default_rng(seed)
    a, p, plane = rng.normal(size=(3, 4)), 0.4 * rng.normal(size=(2, 4)), rng.normal(size=4)
    most = rng.uniform(0.5, 2.0, 2)

    def rows(z, known, exp=np.exp):
        x, above = [z[i] for i in range(4)], z[4]
        value = sum(exp(sum(one[i] * x[i] for i in range(4))) for one in a) + sum(
            (1 + i) * x[i] * x[i] for i in range(4)
        )
        balls = [most[k] - sum((x[i] - p[k, i]) ** 2 for i in range(4)) for k in range(2)]
        return [sum(plane[i] * x[i] for i in range(4)) - 0.3], [above - value, *balls]

    return rows


def ipopt(rows, cost, start, caps=None):
    z = casadi.SX.sym("z", len(cost))
    equal, room = rows(z, [], casadi.exp)
    room = [
        *room,
        *([] if caps is None else casadi.vertsplit(casadi.DM(caps.most) - casadi.mtimes(casadi.DM(caps.rows), z))),
    ]
    solver = casadi.nlpsol(
        "solver",
        "ipopt",
        {"x": z, "f": casadi.dot(casadi.DM(cost), z), "g": casadi.vertcat(*equal, *room)},
        {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-11}},
    )
    lower = np.zeros(len(equal) + len(room))
    found = solver(x0=start, lbg=lower, ubg=np.where(np.arange(len(lower)) < len(equal), 0.0, np.inf))
    assert solver.stats()["success"]
    return found["x"].full().ravel()


def hock_schittkowski_71(z, known):
    one, two, three, four, above = (z[i] for i in range(5))
    within = [one - 1, 5 - one, two - 1, 5 - two, three - 1, 5 - three, four - 1, 5 - four]
    value = one * four * (one + two + three) + three
    return [one**2 + two**2 + three**2 + four**2 - 40], [above - value, one * two * three * four - 25, *within]


def check_conditions(program, cost, found, caps=None, within=1e-7):
    """Multipliers are not negative, count only at limits, and balance the cost along the equalities."""
    equal, room = program.rows(found.z)
    slopes = program.jacobian(found.z)
    ahead, across = slopes[: len(equal)], slopes[len(equal) :]
    if caps is not None:
        room, across = np.append(room, caps.most - caps.rows @ found.z), np.concatenate([across, -caps.rows])
    assert np.abs(equal).max(initial=0.0) <= 1e-9
    assert room.min(initial=0.0) >= -1e-9
    assert found.limits.shape == room.shape
    assert found.limits.min(initial=0.0) >= 0.0
    assert np.abs(found.limits * room).max(initial=0.0) <= 1e-9 * max(1.0, np.linalg.norm(cost))
    left = cost - across.T @ found.limits
    if len(equal):
        left = left - ahead.T @ np.linalg.lstsq(ahead.T, left, rcond=None)[0]
    assert np.abs(left).max() <= within * max(1.0, found.limits.max(initial=0.0))


@pytest.mark.parametrize("seed", range(6))
def test_from_anywhere_it_finds_the_one_minimum_of_a_convex_program_that_ipopt_finds(seed):
    rows, rng = bowl(seed), np.random.default_rng(seed + 100)
    program, theirs = smooth(5, 0, rows), ipopt(rows, LAST, np.zeros(5))
    for size in (0.1, 1.0, 5.0, 10.0):
        found = minimise_dense(program, LAST, size * rng.normal(size=5))
        assert found.converged
        assert found.z == pytest.approx(theirs, abs=1e-6)
        check_conditions(program, LAST, found)


@pytest.mark.parametrize("seed", range(4))
def test_caps_are_rows_like_all_others(seed):
    rows, rng = bowl(seed), np.random.default_rng(seed)
    program, free = smooth(5, 0, rows), ipopt(rows, LAST, np.zeros(5))
    way = np.append(rng.normal(size=4), 0.0)
    caps = Caps(rows=np.array([way, -LAST]), most=np.array([way @ free - 0.05, 100.0]))
    theirs = ipopt(rows, LAST, free, caps)
    found = minimise_dense(program, LAST, rng.normal(size=5), caps=caps)
    assert found.converged
    assert found.z == pytest.approx(theirs, abs=1e-6)
    check_conditions(program, LAST, found, caps)
    worth = [
        minimise_dense(program, LAST, free, caps=Caps(rows=caps.rows, most=caps.most + np.array([step, 0.0]))).z[4]
        for step in (-1e-4, 1e-4)
    ]
    assert found.limits[3] == pytest.approx((worth[0] - worth[1]) / 2e-4, rel=1e-4)
    assert found.limits[4] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("size", [1.0, 1e-6, 1e6])
def test_multipliers_and_place_follow_the_cost_however_large_it_is(size):
    program = smooth(5, 0, bowl(1))
    one, other = (minimise_dense(program, each * LAST, np.full(5, 0.5)) for each in (1.0, size))
    assert other.z == pytest.approx(one.z, abs=1e-12)
    assert other.limits == pytest.approx(size * one.limits, rel=1e-9)


def test_the_best_known_minimum_of_a_textbook_program_from_many_starts():
    """Program 71 of Hock & Schittkowski 1981: 17.0140173 at (1, 4.743, 3.8211, 1.3794)."""
    program, rng = smooth(5, 0, hock_schittkowski_71), np.random.default_rng(0)
    starts = [np.array([1.0, 5.0, 5.0, 1.0, 16.0]), *rng.uniform(1.0, 5.0, (8, 5)), np.full(5, 8.0)]
    for start in starts:
        found = minimise_dense(program, LAST, start)
        assert found.converged
        assert found.z[4] == pytest.approx(17.0140173, abs=1e-7)
        assert found.z[:4] == pytest.approx([1.0, 4.7429994, 3.8211503, 1.3794082], abs=1e-6)
        check_conditions(program, LAST, found)


def test_along_a_bent_valley_to_its_end_on_a_circle():
    """Rosenbrock's function in the unit disc: 0.0456748 at (0.7864, 0.6177)."""

    def rows(z, known):
        value = 100.0 * (z[1] - z[0] * z[0]) ** 2 + (1.0 - z[0]) ** 2
        return [], [z[2] - value, 1.0 - z[0] ** 2 - z[1] ** 2]

    program, cost = smooth(3, 0, rows), np.array([0.0, 0.0, 1.0])
    for start in ([0.0, 0.0, 0.0], [-1.2, 1.0, 0.0], [3.0, -3.0, 5.0], [-0.9, -0.9, 0.0]):
        found = minimise_dense(program, cost, np.array(start))
        assert found.converged
        assert found.z == pytest.approx([0.7864151, 0.6176983, 0.0456748], abs=1e-6)
        check_conditions(program, cost, found)


def test_from_beside_the_top_of_a_sphere_it_goes_to_the_bottom():
    program = smooth(3, 0, lambda z, known: ([z[0] * z[0] + z[1] * z[1] + z[2] * z[2] - 1.0], []))
    cost = np.array([0.0, 0.0, 1.0])
    for start in ([0.05, 0.02, 0.998], [1e-3, 0.0, 1.0], [0.3, 0.3, 2.0]):
        found = minimise_dense(program, cost, np.array(start))
        assert found.converged
        assert found.z == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
        assert found.limits.shape == (0,)


@pytest.mark.parametrize("start", [[0.5, 0.01], [0.5, -0.01], [2.0, 0.2], [0.0, 1e-4]])
def test_it_leaves_a_saddle_on_either_side(start):
    def rows(z, known):
        return [], [z[2] - (z[0] ** 2 - z[1] ** 2 + z[1] ** 4), 4.0 - z[2]]

    program, cost = smooth(3, 0, rows), np.array([0.0, 0.0, 1.0])
    found = minimise_dense(program, cost, np.array([*start, 1.0]))
    assert found.converged
    assert found.z[2] == pytest.approx(-0.25, abs=1e-9)
    assert [found.z[0], abs(found.z[1])] == pytest.approx([0.0, np.sqrt(0.5)], abs=1e-4)


BEALE = {  # where the simplex method cycled
    "c": [-0.75, 20.0, -0.5, 6.0],
    "A": [[0.25, -8.0, -1.0, 9.0], [0.5, -12.0, -0.5, 3.0], [0.0, 0.0, 1.0, 0.0]],
    "b": [0.0, 0.0, 1.0],
}
EDGE = {"c": [-1.0, -1.0], "A": [[1.0, 1.0], [1.0, 1.0], [2.0, 2.0], [1.0, 0.0]], "b": [1.0, 1.0, 2.0, 1.0]}
TIP = {"c": [-1.0, -2.0], "A": [[1.0, 1.0], [1.0, 2.0], [0.0, 1.0], [-1.0, 1.0]], "b": [1.0, 2.0, 1.0, 1.0]}


@pytest.mark.parametrize("given", [BEALE, EDGE, TIP], ids=["cycling", "an edge", "too many rows in a corner"])
def test_linear_programs_without_a_clear_corner_come_to_their_least_value(given):
    c, table, most = (np.array(given[name]) for name in "cAb")

    def rows(z, known):
        below = [most[i] - sum(table[i, j] * z[j] for j in range(len(c))) for i in range(len(most))]
        return [], [*below, *z]

    program, known = smooth(len(c), 0, rows), linprog(c, table, most)
    for start in (np.zeros(len(c)), np.full(len(c), 3.0), np.linspace(-2.0, 1.0, len(c))):
        found = minimise_dense(program, c, start)
        assert found.converged
        assert c @ found.z == pytest.approx(known.fun, abs=1e-8)
        check_conditions(program, c, found)


@pytest.mark.parametrize(
    ("rows", "violation"),
    [
        (lambda z, known: ([], [z[0] - 1.0, -1.0 - z[0]]), 1.0),
        (lambda z, known: ([z[0] * z[0] + 1.0], []), 1.0),
        (lambda z, known: ([z[0] + z[1] - 1.0], [z[0] + z[1] - 3.0, z[0] + 5.0, z[1] + 5.0]), 1.0),
    ],
    ids=["two sides", "no root", "a line and a half plane"],
)
def test_what_cannot_be_met_is_said(rows, violation):
    program = smooth(2, 0, rows)
    found = minimise_dense(program, np.array([1.0, 0.0]), np.array([0.7, 0.2]))
    assert not found.converged
    assert found.violation >= violation - 1e-6
    assert found.violation == max(0.0, *np.abs(program.rows(found.z)[0]), *-program.rows(found.z)[1])


def test_too_few_iterations_are_said():
    program = smooth(5, 0, bowl(0))
    few, enough = (
        minimise_dense(program, LAST, np.full(5, 3.0), options=OPTIONS._replace(iterations=most)) for most in (3, 300)
    )
    assert not few.converged
    assert few.iterations == 3
    assert enough.converged
    again = minimise_dense(program, LAST, np.full(5, 3.0), options=OPTIONS._replace(iterations=enough.iterations))
    assert np.array_equal(again.z, enough.z)


@pytest.mark.parametrize("row", [lambda z: np.sqrt(z), lambda z: np.log(z), lambda z: 1.0 / (z + 1.0)])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_start_where_rows_are_not_finite_is_refused(row):
    program = smooth(1, 0, lambda z, known: ([], [row(z[0]), 4.0 - z[0]]))
    with pytest.raises(EvaluationFailed, match="finite rows and slopes"):
        minimise_dense(program, np.array([1.0]), np.array([-1.0]))


@pytest.mark.parametrize("start", [0.01, 3.0, 50.0])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_steps_to_where_rows_are_not_finite_are_shortened(start):
    """Above z − log z lies no less than 1; Newton's step from z > 2 goes past 0."""
    program = smooth(2, 0, lambda z, known: ([], [z[1] - (z[0] - np.log(z[0]))]))
    found = minimise_dense(program, np.array([0.0, 1.0]), np.array([start, 0.0]))
    assert found.converged
    assert found.z == pytest.approx([1.0, 1.0], abs=1e-5)
