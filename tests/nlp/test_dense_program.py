"""Sequential quadratic programming on small smooth programs: known minima, and a comparison with SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from paretoik.nlp.dense.dense_program import DenseProgram
from paretoik.nlp.dense.traced_rows import trace_rows
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import CONVERGED, InteriorPointOptions

OPTIONS = InteriorPointOptions(radius=0.1, iterations=200, tolerance=1e-9)


def minimise_by_sqp(program, cost, start):
    dense = DenseProgram(rows=program, costs=cost[None])
    return minimise(dense, start[None], np.ones((1, 1)), options=OPTIONS, solver="sqp")


def sphere(z, parameters):
    return [z[0] * z[0] + z[1] * z[1] + z[2] * z[2] - parameters[0]], [z[2] - 0.1]


def test_sphere_above_a_plane_has_its_known_lowest_point():
    program = trace_rows(3, 1, sphere).at([1.0])
    solution = minimise_by_sqp(program, np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.6, 0.8]))
    assert solution.status == [CONVERGED]
    assert solution.x[0] == pytest.approx([-np.sqrt(0.99), 0.0, 0.1], abs=1e-7)


def test_derivatives_are_those_of_the_rows():
    def rows(z, parameters):
        return [np.sin(z[0]) * z[1] - parameters[0]], [np.exp(z[1]) / z[0], z[0] ** 3 - z[1]]

    program, z, weights = trace_rows(2, 1, rows).at([0.0]), np.array([0.7, -0.4]), np.array([1.3, -0.2, 0.8])
    step = 1e-6 * np.eye(2)
    slopes = (
        np.array([np.concatenate(program.rows(z + d)) - np.concatenate(program.rows(z - d)) for d in step]).T / 2e-6
    )
    assert program.jacobian(z) == pytest.approx(slopes, rel=1e-8)
    bends = np.array([weights @ (program.jacobian(z + d) - program.jacobian(z - d)) for d in step]) / 2e-6
    assert program.hessian(z, weights) == pytest.approx(bends, rel=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_solution_is_no_worse_than_slsqps_from_the_same_start(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, 4, 4))

    def rows(z, parameters):
        circle = sum(x * x for x in z) - 2.0
        bent = [sum(a[i, j] * z[j] for j in range(4)) + 0.3 * np.sin(z[i]) + 1.0 for i in range(4)]
        return [circle], bent

    program, cost = trace_rows(4, 0, rows).at(), b[0]
    start = rng.normal(size=4)
    start *= np.sqrt(2) / np.linalg.norm(start)
    ours = minimise_by_sqp(program, cost, start)
    theirs = minimize(
        lambda z: cost @ z,
        start,
        jac=lambda z: cost,
        method="SLSQP",
        constraints=[
            {"type": "eq", "fun": lambda z: program.rows(z)[0], "jac": lambda z: program.jacobian(z)[:1]},
            {"type": "ineq", "fun": lambda z: program.rows(z)[1], "jac": lambda z: program.jacobian(z)[1:]},
        ],
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert ours.violation[0] <= 1e-8
    assert ours.status == [CONVERGED]
    if theirs.success and np.linalg.norm(ours.x[0] - theirs.x) < 0.5:  # the same basin
        assert cost @ ours.x[0] <= cost @ theirs.x + 1e-7
