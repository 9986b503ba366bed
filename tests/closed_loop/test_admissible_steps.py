import numpy as np

from paretoik.closed_loop.admissible_steps import clearance_at_start, find_inadmissible
from tests.closed_loop.postures import near_obstacle


def test_engine_and_problem_agree_on_which_steps_are_admissible():
    count = 400
    loop = near_obstacle(population=count)
    step, search = loop.step_state(1), loop.step_evolution()
    problem, (start, constraints), w = loop.control_step(1), search.start_and_constraints(step), search.workspace
    genes = np.random.default_rng(0).uniform(-1, 1, size=(count, problem.n_var))
    admissible = (problem.evaluate(genes, return_values_of=["G"]) <= 0).all(axis=1)
    assert 0.1 < admissible.mean() < 0.9
    w.inputs[: problem.task.arm.dof], w.pending[:] = problem.positions(genes).T, np.arange(count)
    clearance = clearance_at_start(start, constraints, w)
    rejected = find_inadmissible(count, start, constraints, clearance, search.options, w)
    assert sorted(w.pending[:rejected]) == np.flatnonzero(~admissible).tolist()


def test_short_steps_keep_the_standoff_too():
    loop = near_obstacle(population=200)
    step, search = loop.step_state(1), loop.step_evolution()
    (start, constraints), w = search.start_and_constraints(step), search.workspace
    clearance = clearance_at_start(start, constraints, w)
    assert clearance > constraints.standoff > 0
    closer = constraints._replace(standoff=0.999 * clearance)
    moved = np.random.default_rng(0).uniform(-1, 1, size=(200, 3)) * clearance / constraints.reach.sum() / 2
    q = step.previous + moved
    w.inputs[:3], w.pending[:] = q.T, np.arange(200)
    rejected = find_inadmissible(200, start, closer, clearance, search.options, w)
    expected = np.flatnonzero(step.excess_clearances(q) <= closer.standoff).tolist()
    assert 0 < len(expected) < 200
    assert sorted(w.pending[:rejected].tolist()) == expected
