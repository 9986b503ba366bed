"""Sequential quadratic programming on small smooth and kinked programs: optimality, and other solvers."""

from __future__ import annotations

from dataclasses import replace

import casadi
import numpy as np
import pytest

from paretoik.errors import EvaluationFailed
from paretoik.nlp.dense.dense_program import DenseProgram
from paretoik.nlp.dense.traced_rows import trace_rows
from paretoik.nlp.program import CONVERGED, ITERATION_LIMIT, VIOLATED, Goal, bounded
from paretoik.nlp.sqp import SqpOptions, minimise

OPTIONS = SqpOptions(radius=0.1, tolerance=1e-9)


def bowl(seed, *, kinked=False):
    """Return a program on a sphere below planes and waves; the last unknowns are above the objectives or pieces.

    Objectives are products with the unknowns; with kinks, the larger of two products, by its epigraph.
    """
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, 4, 4))

    def rows(z, parameters):
        sphere = sum(x * x for x in z[:4]) - 2.0
        waves = [sum(a[i, j] * z[j] for j in range(4)) + 0.3 * np.sin(z[i]) + 1.0 for i in range(4)]
        pieces = [sum(b[i, j] * z[j] for j in range(4)) + 0.2 * z[i] * z[i] for i in range(4)]
        above = [z[4] - pieces[0], z[5] - pieces[2]]
        return [sphere], [*waves, *above, *([z[4] - pieces[1], z[5] - pieces[3]] if kinked else [])]

    start = rng.normal(size=4)
    start *= np.sqrt(2) / np.linalg.norm(start)
    values = b @ start + 0.2 * start**2
    tops = [max(values[:2]), max(values[2:])] if kinked else [values[0], values[2]]
    program = DenseProgram(rows=trace_rows(6, 0, rows).at(), costs=np.eye(6)[4:])
    return program, np.concatenate([start, tops])


def first_of_two(upper=np.inf):
    return Goal(weights=np.array([1.0, 0.0]), rows=np.eye(2)[1:], upper=np.array([upper]))


@pytest.mark.parametrize("kinked", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_the_conditions_of_optimality_hold(seed, kinked):
    program, x = bowl(seed, kinked=kinked)
    free = minimise(program, x, first_of_two(), OPTIONS)
    goal = first_of_two(float(program.evaluate(free.x)[0][1]) - 0.05)
    end = minimise(program, x, goal, OPTIONS)
    if end.status == VIOLATED:
        pytest.skip("the bound cannot hold from here")
    assert end.status == CONVERGED
    at = program.linearise(end.x)
    constraints, _ = bounded(at, goal)
    multipliers = np.concatenate([end.multipliers, end.bound_multipliers])
    assert multipliers.min() >= 0.0
    assert constraints.values.min() >= -1e-8
    assert np.abs(at.equalities).max() <= 1e-9
    assert goal.weights @ at.gradients == pytest.approx(constraints.jacobian.T @ multipliers, abs=1e-5)
    assert multipliers @ np.abs(constraints.values) <= 1e-6


def test_at_the_limit_of_iterations_only_an_optimum_has_converged():
    program, x = bowl(1)
    optimum = minimise(program, x, first_of_two(), OPTIONS).x
    ends = [minimise(program, start, first_of_two(), replace(OPTIONS, iterations=0)) for start in (x, optimum)]
    assert [end.status for end in ends] == [ITERATION_LIMIT, CONVERGED]


@pytest.mark.parametrize("seed", range(2))
def test_ipopt_stays_at_the_optimum_of_a_largest_value(seed):
    """IPOPT gets the same program, the largest of three waves on a circle, and starts at our optimum."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, size=3)

    def rows(z, parameters):
        waves = [np.sin(2 * z[0] + phase[i]) + z[1] for i in range(3)]
        return [z[0] * z[0] + z[1] * z[1] - 1.0], [z[2] - wave for wave in waves]

    program = DenseProgram(rows=trace_rows(3, 0, rows).at(), costs=np.eye(3)[2:])
    goal = Goal(weights=np.ones(1), rows=np.zeros((0, 1)), upper=np.zeros(0))
    end = minimise(program, np.array([1.0, 0.0, 2.0]), goal, OPTIONS)
    assert end.status == CONVERGED
    z = casadi.SX.sym("z", 3)
    waves = [casadi.sin(2 * z[0] + float(phase[i])) + z[1] for i in range(3)]
    g = casadi.vertcat(z[0] ** 2 + z[1] ** 2 - 1, *(z[2] - wave for wave in waves))
    quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-10, "ipopt.mu_init": 1e-8}
    ipopt = casadi.nlpsol("ipopt", "ipopt", {"x": z, "f": z[2], "g": g}, quiet)
    theirs = ipopt(x0=end.x, lbg=[0, 0, 0, 0], ubg=[0, np.inf, np.inf, np.inf])
    assert end.objectives[0] == pytest.approx(float(theirs["f"]), abs=1e-7)


@pytest.mark.parametrize(("factor", "kinked"), [(1e-6, False), (1e5, True)])
def test_a_goal_times_a_number_leads_to_the_same_point(factor, kinked):
    program, x = bowl(1, kinked=kinked)
    plain = minimise(program, x, first_of_two(), OPTIONS)
    goal = first_of_two()
    scaled = minimise(program, x, replace(goal, weights=factor * goal.weights), OPTIONS)
    assert (plain.status, scaled.status) == (CONVERGED, CONVERGED)
    assert scaled.x[:5] == pytest.approx(plain.x[:5], abs=1e-6)  # the last unknown is not unique
    assert scaled.multipliers == pytest.approx(factor * plain.multipliers, abs=1e-4 * factor)


def test_the_least_violation_is_found_and_given_up_where_constraints_contradict_each_other():
    program = DenseProgram(
        rows=trace_rows(1, 0, lambda z, parameters: ([], [z[0] - 1.0, -1.0 - z[0]])).at(), costs=np.eye(1)
    )
    goal = Goal(weights=np.ones(1), rows=np.zeros((0, 1)), upper=np.zeros(0))
    end = minimise(program, np.array([0.3]), goal, OPTIONS)
    assert end.status == VIOLATED
    assert end.violation == pytest.approx(1.0, abs=1e-6)
    assert end.iterations < 30


def test_a_program_that_is_not_finite_is_an_error_by_name():
    rows = trace_rows(2, 0, lambda z, parameters: ([z[0] - z[1]], [np.log(z[0])])).at()
    goal = Goal(weights=np.ones(1), rows=np.zeros((0, 1)), upper=np.zeros(0))
    with np.errstate(invalid="ignore"), pytest.raises(EvaluationFailed, match="finite rows and derivatives"):
        minimise(DenseProgram(rows=rows, costs=np.eye(2)[:1]), np.array([-1.0, -1.0]), goal)
