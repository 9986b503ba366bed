"""MaxiMin and its peers: the problems, the runs, the goals and their rows."""

from __future__ import annotations

import numpy as np
import pytest
from pymoo.optimize import minimize

from studies.benchmarks import maximin as study

ONE_OF_EACH = ["ZDT5", "DTLZ1-5", "WFG9", "MW14", "CTP8", "DASCMOP9", "OSY", "steep tail"]


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_every_method_runs_on_every_kind_of_problem_with_as_many_evaluations(name):
    case, problem = study.cases()[name], study.problem_of(name)
    assert (problem.n_obj, problem.has_constraints()) == (case.n_obj, case.constrained)
    evaluated = []
    first = study.first_genes(problem, case, 3)
    for method in set(study.methods_of(case)) - {"AGE-MOEA"}:  # AGE-MOEA takes 10 s to compile
        algorithm = study.algorithm(method, case, problem, first)
        result = minimize(problem, algorithm, ("n_eval", 2 * len(first)), seed=3)
        evaluated.append(result.algorithm.evaluator.n_eval)
    assert evaluated == [2 * study.POPULATION[case.n_obj]] * len(evaluated)


@pytest.mark.skipif(not study.COCO, reason="coco-experiment is not installed")
def test_the_first_of_coco_s_problems_is_two_spheres():
    problem = study.problem_of("bbob-biobj f01")
    rng = np.random.default_rng(0)
    x, step = rng.uniform(-4.0, 4.0, size=(2, problem.n_var))
    F = problem.evaluate(np.array([x - step, x, x + step]))
    np.testing.assert_allclose(F[0] - 2 * F[1] + F[2], 2 * step @ step)


def test_a_run_is_the_same_again_and_leaves_only_useful_points_none_dominated():
    first, again = (study.run_once("steep tail", study.OURS, 1, 12) for _ in range(2))
    assert len(first.F) > 1
    assert np.array_equal(first.F, again.F)
    assert np.less_equal(first.F, study.cases()["steep tail"].highest).all()
    assert np.array_equal(np.all(first.F[:, None] <= first.F[None], axis=-1), np.eye(len(first.F), dtype=bool))
