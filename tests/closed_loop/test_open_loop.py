"""The compiled search for a posture, compared with the same search in pymoo."""

import numpy as np
import pytest
from pymoo.optimize import minimize
from scipy.stats import mannwhitneyu

from paretoik.closed_loop.open_loop import OpenLoopOptions, search_start, trace_posture
from paretoik.collision.obstacles import Box
from paretoik.errors import Infeasible
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.robot.arms import marcos_nr
from problems import marcos_2012
from tests.closed_loop.planar_geometry import joints_of, meets
from tests.closed_loop.postures import posture

SMALL = OpenLoopOptions(population=200, generations=60)


def task_of(links):
    return marcos_2012.loop(links, 0.7, start=posture(links), steps=3, blocked=True).task


def test_a_start_is_found_near_the_path_and_clear_of_obstacles():
    task = task_of(4)
    q = search_start(task, seed=3, options=SMALL)
    assert abs(joints_of(q)[-1] - complex(*task.targets[0])) < 0.05
    assert not meets(q, task.obstacles)
    np.testing.assert_array_equal(search_start(task, seed=3, options=SMALL), q)
    assert not np.array_equal(search_start(task, seed=4, options=SMALL), q)


def test_values_of_postures_are_those_of_the_pymoo_problem():
    links = 4
    problem = marcos_2012.first_posture(links)
    q = np.random.default_rng(0).uniform(-2 * np.pi, 2 * np.pi, size=(200, links))
    violation, error = trace_posture(task_of(links))(q.T)
    F, G = problem.evaluate(q, return_values_of=["F", "G"])
    np.testing.assert_allclose(error, F[:, 0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        violation, np.maximum(G[:, 0], 0.0) * problem.task.clearance_range, rtol=1e-9, atol=1e-12
    )
    assert 0.0 < (violation > 0).mean() < 1.0


@pytest.mark.slow
def test_errors_are_distributed_as_those_of_the_search_in_pymoo():
    task, problem, seeds = task_of(3), marcos_2012.first_posture(3), range(16)
    population, generations = 60, 30
    options = OpenLoopOptions(population=population, generations=generations)

    def error(q):
        return abs(joints_of(q)[-1] - complex(*task.targets[0]))

    ours = np.log([error(search_start(task, seed=seed, options=options)) for seed in seeds])
    algorithm = problem.algorithm(population)
    theirs = np.log([minimize(problem, algorithm, ("n_gen", generations), seed=seed).F[0] for seed in seeds])
    margin = np.log(3.0)  # equal within a factor of three by two one-sided tests, not with a tenth of the generations
    assert mannwhitneyu(ours - margin, theirs, alternative="less").pvalue < 0.05
    assert mannwhitneyu(ours + margin, theirs, alternative="greater").pvalue < 0.05
    few = OpenLoopOptions(population=population, generations=3)
    short = np.log([error(search_start(task, seed=seed, options=few)) for seed in seeds])
    assert mannwhitneyu(short - margin, theirs, alternative="less").pvalue > 0.05


def test_a_search_without_a_clear_posture_says_so():
    sides = [((0.5, 0.0), (0.1, 0.6)), ((-0.5, 0.0), (0.1, 0.6)), ((0.0, 0.5), (0.6, 0.1)), ((0.0, -0.5), (0.6, 0.1))]
    walls = [Box(center, sizes) for center, sizes in sides]  # all around the base, nearer than a link's length
    loop = ClosedLoop(marcos_nr(3), marcos_2012.round_trip(0.7, 4), obstacles=walls)
    with pytest.raises(Infeasible, match="start must be a posture clear of the obstacles, got none of 12000"):
        search_start(loop.task, options=SMALL)
