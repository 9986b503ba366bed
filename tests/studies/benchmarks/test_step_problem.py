"""The readable search of a control step, in pymoo: what the engine is compared with."""

import numpy as np
import pytest
from pymoo.optimize import minimize

from problems import marcos_2012
from studies.benchmarks.closed_loop.step_problem import StepProblem
from tests.closed_loop.postures import posture


@pytest.fixture(params=[3, 4])
def step(request):
    loop = marcos_2012.loop(request.param, 0.7, start=posture(request.param), steps=4, as_printed=True)
    return StepProblem(loop.control_step(1), loop.objectives)


def forward(q):
    angles = np.cumsum(q, axis=-1)
    return np.stack([np.cos(angles).sum(axis=-1), np.sin(angles).sum(axis=-1)], axis=-1)


def test_genes_extend_the_jacobian_to_a_square_system(step):
    genes = np.random.default_rng(0).uniform(-1, 1, size=(20, step.n_var))
    q, control_step = step.decode(genes), step.step
    error, jacobian = control_step.linearise()
    moved = q - control_step.previous
    np.testing.assert_allclose(moved @ jacobian.T, np.tile(error, (20, 1)), atol=1e-12)
    rows = genes.reshape(20, step.rows, step.row)
    np.testing.assert_allclose(np.einsum("prk,pk->pr", rows[..., :-1], moved), rows[..., -1], atol=1e-9)


def test_objectives_are_those_of_the_paper_by_hand(step):
    control_step, genes = step.step, np.random.default_rng(1).uniform(-1, 1, size=(30, step.n_var))
    q = step.decode(genes)
    moved = (q - control_step.previous) / 1e-3
    away = (q - control_step.home) / 1e-3
    target = np.array([0.7 + 0.5 * np.cos(7e-3), 0.5 * np.sin(7e-3)])
    F = step.evaluate(genes, return_values_of=["F"])
    np.testing.assert_allclose(F[:, 0], (moved**2).sum(1) + (away**2).sum(1), rtol=1e-9)
    np.testing.assert_allclose(F[:, 1], np.linalg.norm(forward(q) - target, axis=1), rtol=1e-9, atol=1e-15)


def test_a_singular_system_fails(step):
    genes = np.zeros((1, step.n_var))
    assert np.isnan(step.decode(genes)).all()
    assert np.isinf(step.evaluate(genes, return_values_of=["F"])).all()


def test_any_pymoo_algorithm_solves_a_step(step):
    result = minimize(step, step.algorithm(24), ("n_gen", 12), seed=1)
    drawn = step.evaluate(np.random.default_rng(0).uniform(-1, 1, size=(500, step.n_var)), return_values_of=["F"])
    assert result.F.shape[1] == 2
    assert np.all(result.F.min(axis=0) < 0.1 * np.median(drawn, axis=0))
    assert (result.G <= 0).all()
