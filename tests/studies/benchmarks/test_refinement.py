"""The programs of all solvers are one program, and rows mark losses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import check_grad

import paretoik as pk
from paretoik.trajectory.plan_starts import sample_starts
from problems import kim_2021, tringali_2020
from studies.benchmarks.peers import solvers
from studies.benchmarks.peers.programs import joint_program
from studies.benchmarks.refinement.__main__ import STATED, motions, solve_all
from studies.benchmarks.refinement.nlp import Nlp, dense_nlp, ipopt_solver, motion_nlp

SAMPLES = 11


@pytest.fixture(scope="module", params=[pk.torque_norm, pk.mechanical_energy], ids=lambda one: one.name)
def task(request):
    return replace(tringali_2020.simulation_4().task.resample(SAMPLES), objectives=(request.param,))


@pytest.fixture(scope="module")
def start(task):
    return sample_starts(task, 1, np.random.default_rng(0))[0]


@pytest.fixture(scope="module")
def program(task):
    return joint_program(task)


@pytest.fixture(scope="module")
def nlp(program):
    return motion_nlp(program, 0.1)


def test_a_packed_motion_has_the_objective_that_our_function_gives(task, start, program, nlp):
    x = program.pack(start, np.ones(1))
    q = program.unpack(x)
    np.testing.assert_array_equal(q, start)
    objective = task.objectives[0](task.motion(q))
    extra = len(x) - q.size
    slack = np.abs(task.motion(q).power[1:]).ravel()
    exact = np.concatenate([q.ravel(), slack]) if extra else x
    assert nlp.value(exact) == pytest.approx(objective / 0.1, rel=1e-12)
    assert nlp.value(x) >= nlp.value(exact)


def test_derivatives_are_those_of_the_functions(start, program, nlp):
    x, step = program.pack(start, np.ones(1)), 1e-6
    direction = np.random.default_rng(1).normal(size=len(x))
    multipliers = np.random.default_rng(2).normal(size=len(nlp.lower))

    def slope(function):
        return (function(x + step * direction) - function(x - step * direction)) / (2 * step)

    assert nlp.gradient(x) @ direction == pytest.approx(slope(nlp.value), rel=1e-5)
    np.testing.assert_allclose(nlp.jacobian(x) @ direction, slope(nlp.rows), rtol=1e-4, atol=1e-4)
    lagrangian = slope(lambda z: nlp.gradient(z) + multipliers @ nlp.jacobian(z))
    scale = np.abs(lagrangian).max()
    np.testing.assert_allclose(nlp.hessian(x, multipliers) @ direction, lagrangian, atol=1e-5 * scale)


def test_a_dense_program_for_scipy_is_ours():
    problem = pk.PointToPoint(
        pk.arms.kim_3r(), pk.capability.kim_joint_motors(), kim_2021.START, kim_2021.TARGET, samples=9
    )
    program, weights = problem.program(), np.ones(2)
    z = problem.points(problem.sample_starts(1, np.random.default_rng(0)))[0]
    nlp = dense_nlp(program, weights)
    objectives, equalities, inequalities = program.evaluate(z)
    assert nlp.value(z) == pytest.approx(weights @ objectives)
    np.testing.assert_array_equal(nlp.rows(z), np.append(equalities, inequalities))
    assert check_grad(nlp.value, nlp.gradient, z) < 1e-5


def test_all_solvers_keep_the_limits_and_end_where_no_other_is_much_better(monkeypatch, tmp_path):
    monkeypatch.setattr(solvers, "COMPILER", None)  # compiled programs have tests of their own
    contest = motions(tringali_2020.simulation_4, pk.torque_norm, SAMPLES, 2, 0, 20.0, tmp_path)
    assert contest.default == "interior point"
    ends = {
        name: solve_all(solve, contest.starts) for name, solve in contest.contestants.items() if name != "SciPy SLSQP"
    }
    assert {STATED, "SQP by Clarabel", "SciPy trust-constr", "IPOPT", "FATROP"} < set(ends)
    assert all(end.count for end in ends.values())
    best = min(end.best for end in ends.values())
    assert ends["interior point"].best <= best * (1 + 1e-6)


def test_ipopt_takes_a_program_by_its_functions():
    """The program is linear in the unit disc with x at least 1/2: the optimum is (1/2, √3/2)."""
    nlp = Nlp(
        value=lambda x: x[0] - x[1] / 10,
        gradient=lambda x: np.array([1.0, -0.1]),
        rows=lambda x: np.array([x @ x]),
        jacobian=lambda x: sparse.csr_array(2 * x[None]),
        hessian=lambda x, multipliers: sparse.csr_array(2 * multipliers[0] * np.eye(2)),
        lower=np.array([-np.inf]),
        upper=np.array([1.0]),
        bounds=np.array([[0.5, -np.inf], [np.inf, np.inf]]),
    )
    x = np.array([0.6, 0.1])
    assert ipopt_solver(nlp, x)(x) == pytest.approx([0.5, np.sqrt(0.75)], abs=1e-6)
