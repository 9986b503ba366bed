"""Newton's method over the samples ahead, on programs with known minima."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.autodiff.differentiation import gradient, hessian
from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.tape import Expression, Tape, as_entry
from paretoik.resolution.horizon_newton import minimise

DOF = 3


def solved(objective, equations, start):
    """Minimise a function of positions (samples, dof), given as expressions; one equation per sample."""
    tape, (horizon, dof) = Tape(), start.shape
    q = [[tape.input() for _ in range(dof)] for _ in range(horizon)]
    multipliers, _ = [tape.input() for _ in range(horizon)], [tape.input() for _ in range(dof)]
    variables = [one.index for each in q for one in each]
    total, rows = as_entry(tape, objective(q)), [as_entry(tape, equations(each)) for each in q]
    jacobian = [
        slope for row, each in zip(rows, q, strict=True) for slope in gradient(tape, row, [x.index for x in each])
    ]
    lagrangian = Expression(tape, total)
    for factor, row in zip(multipliers, rows, strict=True):
        lagrangian = lagrangian + factor * Expression(tape, row)
    second = hessian(tape, as_entry(tape, lagrangian), variables)
    row, column = np.array(list(second)).reshape(-1, 2).T
    derivatives = compile_evaluator(tape, [total, *gradient(tape, total, variables), *rows, *jacobian])
    entries = compile_evaluator(tape, list(second.values()))
    inputs = np.concatenate([start.ravel(), np.zeros(horizon + dof)])[:, None]
    value, converged, iterations = minimise(derivatives.arrays, entries.arrays, row, column, inputs, horizon, dof, 1)
    return inputs[: start.size].reshape(start.shape), value, converged, iterations


def test_a_quadratic_on_planes_is_solved_by_one_step_as_its_linear_system_says():
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(2 * DOF, 2 * DOF))
    P, center, normal = factor @ factor.T + np.eye(2 * DOF), rng.normal(size=2 * DOF), rng.normal(size=DOF)

    def objective(q):
        away = [x - c for x, c in zip([x for each in q for x in each], center, strict=True)]
        return sum(0.5 * P[i, j] * away[i] * away[j] for i in range(2 * DOF) for j in range(2 * DOF))

    def plane(q):
        return sum(n * x for n, x in zip(normal, q, strict=True)) - 0.2

    A = np.kron(np.eye(2), normal)
    system = np.block([[P, A.T], [A, np.zeros((2, 2))]])
    expected = np.linalg.solve(system, np.concatenate([P @ center, [0.2, 0.2]]))[: 2 * DOF]
    start = expected.reshape(2, DOF) + 0.05 * rng.normal(size=(2, DOF))
    q, value, converged, iterations = solved(objective, plane, start)
    assert converged
    assert iterations <= 2
    np.testing.assert_allclose(q.ravel(), expected, atol=1e-9)
    assert value == pytest.approx(0.5 * (expected - center) @ P @ (expected - center), rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_the_nearest_point_of_a_sphere_is_found_where_the_hessian_is_indefinite_too(seed):
    target = np.random.default_rng(seed).normal(size=DOF)
    start = np.random.default_rng(seed + 10).normal(size=(1, DOF))
    start /= np.linalg.norm(start)

    def objective(q):
        return -sum(float(t) * x for t, x in zip(target, q[0], strict=True))  # curved only by the sphere

    q, value, converged, _ = solved(objective, lambda q: sum(x * x for x in q) - 1.0, start)
    assert converged
    np.testing.assert_allclose(q[0], target / np.linalg.norm(target), atol=1e-7)
    assert value == pytest.approx(-np.linalg.norm(target), rel=1e-12)
