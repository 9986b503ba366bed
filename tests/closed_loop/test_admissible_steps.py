"""The compiled tests of steps compared with the problem, and compiled distances with those of obstacles."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.closed_loop.admissible_steps import clearance_at_start, evaluate_distances, find_inadmissible
from paretoik.closed_loop.control_step import OPTIONS, excess_clearance
from paretoik.closed_loop.programs import bounding_ball, tabulate, trace_nodes
from paretoik.collision.obstacles import Box, Capsule, Circle, HalfSpace, Sphere, clearance
from paretoik.robot.kinematics import link_nodes
from paretoik.robot.pose import Pose
from problems import marcos_2012
from tests.closed_loop.postures import near_obstacle, posture


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
    rejected = find_inadmissible(count, start, constraints, clearance, OPTIONS, w)
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
    rejected = find_inadmissible(200, start, closer, clearance, OPTIONS, w)
    expected = np.flatnonzero(excess_clearance(step.task, q) <= closer.standoff).tolist()
    assert 0 < len(expected) < 200
    assert sorted(w.pending[:rejected].tolist()) == expected


TURNED = Pose([0.5, 0.2, 0.1], np.array([0.8, 0.36, 0.48, 0.0]))
OBSTACLES = [
    Circle([1.4, 0.5], 0.2),
    Sphere([1.0, 1.0, 0.3], 0.2),
    Capsule([0.0, 1.0, 0.0], [1.0, 1.0, 1.0], 0.1),
    Capsule([0.3, 0.3, 0.3], [0.3, 0.3, 0.3], 0.1),
    Box([0.5, 1.5], [0.25, 0.2]),
    Box([0.5, 0.2, 0.1], [0.3, 0.2, 0.1]),
    Box(TURNED, [0.3, 0.2, 0.1]),
    Box(TURNED, [0.3, 0.2]),
    Box(Pose.planar(0.5, 0.2, 0.7), [0.3, 0.2]),
    HalfSpace([0.0, -0.3], [0.28, 0.96]),
    HalfSpace([0.1, 0.2, -0.7], [-0.6, 0.0, 0.8]),
]


def planar_task():
    return marcos_2012.loop(3, 0.7, start=posture(3), steps=3).task


def spatial_task():
    arm = pk.arms.wan_7r()
    tool = pk.Motion(arm=arm, time=np.arange(3.0), q=np.full((3, 7), 0.3)).tool[0]
    path = pk.line(tool, tool + np.array([0.0, 0.002, 0.001]), duration=0.5, samples=3, timing="uniform")
    return pk.ClosedLoop(arm, path, start=np.full(7, 0.3)).task


def compiled_distances(task, q, obstacles):
    distances, nodes = np.zeros(len(q)), trace_nodes(task)(q.T)
    evaluate_distances(tabulate(list(obstacles)), np.zeros(task.arm.dof + 1), nodes, len(q), distances)
    return distances


def check_distances(task, q, obstacles):
    """Check that compiled distances are those of obstacles where these are positive; return all of these."""
    distances, compiled = clearance(obstacles, link_nodes(task.arm, q)), compiled_distances(task, q, obstacles)
    clear = distances > 1e-9
    np.testing.assert_allclose(compiled[clear], distances[clear], rtol=1e-12, atol=1e-12)
    assert (compiled[~clear] <= 1e-9).all()
    return distances


@pytest.mark.parametrize("make", [planar_task, spatial_task])
def test_compiled_distances_are_those_of_obstacles_where_these_are_positive(make):
    task = make()
    q = np.random.default_rng(0).uniform(-2.5, 2.5, size=(300, task.arm.dof))
    for obstacles in (*([each] for each in OBSTACLES), OBSTACLES):
        distances = check_distances(task, q, obstacles)
        bounds = compiled_distances(task, q, map(bounding_ball, obstacles))
        assert distances.max() > 1e-9
        assert (bounds <= np.maximum(distances, 0.0) + 1e-9).all()


def test_without_obstacles_the_distance_is_infinite():
    np.testing.assert_array_equal(compiled_distances(planar_task(), np.zeros((5, 3)), []), np.inf)


@pytest.mark.parametrize("seed", range(3))
def test_compiled_distances_to_random_obstacles_are_those_of_their_definition(seed):
    rng, task = np.random.default_rng(seed), spatial_task()
    position, quaternion, size = rng.normal(size=3), rng.normal(size=4), rng.uniform(0.01, 0.4, size=3)
    turned = Pose(position, quaternion / np.linalg.norm(quaternion))
    obstacles = [
        Circle(position[:2], size[0]),
        Sphere(rng.normal(size=3), size[1]),
        Capsule(rng.normal(size=3), rng.normal(size=3), size[2]),
        Box(turned, size),
        Box(turned, size[:2]),
        HalfSpace(position, turned.rotation[:, 0]),
        HalfSpace(position[:2], turned.rotation[:2, 0]),
    ]
    q = rng.uniform(-2.5, 2.5, size=(200, 7))
    for each in obstacles:
        check_distances(task, q, [each])


@pytest.mark.parametrize("obstacle", [OBSTACLES[4], OBSTACLES[8]], ids=repr)
def test_an_arm_in_a_box_stays_in_it_while_it_moves_by_less_than_its_depth(obstacle):
    task, rng = planar_task(), np.random.default_rng(0)
    q = rng.uniform(-2.5, 2.5, size=(2000, 3))
    depth = -compiled_distances(task, q, [obstacle])
    within = depth > 0.02
    assert within.any()
    moved = rng.uniform(-1, 1, size=(within.sum(), 3))
    moved *= 0.99 * depth[within, None] / (np.abs(moved) @ [3.0, 2.0, 1.0])[:, None]  # no point moves by the depth
    assert (clearance([obstacle], link_nodes(task.arm, q[within] + moved)) <= 1e-12).all()
