import numpy as np
import pytest

import paretoik as pk
from paretoik.closed_loop.objectives import Step, step_objective
from paretoik.closed_loop.programs import bounding_balls, trace_distances
from paretoik.errors import InvalidInput
from paretoik.robot.kinematics import link_nodes
from paretoik.robot.pose import Pose
from paretoik.task.distances import clearance
from paretoik.task.obstacles import Box, Capsule, Circle, Sphere
from problems import marcos_2012
from tests.closed_loop.postures import posture

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
]


def planar_task():
    return marcos_2012.loop(3, 0.7, start=posture(3), steps=3).task


def spatial_task():
    arm = pk.arms.wan_7r()
    tool = pk.Motion(arm=arm, time=np.arange(3.0), q=np.full((3, 7), 0.3)).tool[0]
    path = pk.line(tool, tool + np.array([0.0, 0.002, 0.001]), duration=0.5, samples=3, timing="uniform")
    return pk.ClosedLoop(arm, path, start=np.full(7, 0.3)).task


@pytest.mark.parametrize("obstacles", [*([each] for each in OBSTACLES), OBSTACLES], ids=lambda some: repr(some)[:18])
@pytest.mark.parametrize("make", [planar_task, spatial_task])
def test_traced_distances_are_those_of_obstacles_where_these_are_positive(obstacles, make):
    task = make()
    q = np.random.default_rng(0).uniform(-2.5, 2.5, size=(300, task.arm.dof))
    distances = clearance(obstacles, link_nodes(task.arm, q))
    balls = [bounding_balls(obstacle) for obstacle in obstacles]
    (traced,) = trace_distances(task, [obstacles])(q.T)
    around, inside = trace_distances(task, [[ball[k] for ball in balls] for k in (0, 1)])(q.T)
    clear = distances > 1e-9
    assert clear.any()
    np.testing.assert_allclose(traced[clear], distances[clear], rtol=1e-12, atol=1e-12)
    assert (traced[~clear] <= 1e-9).all()
    assert (around <= np.maximum(distances, 0.0) + 1e-9).all()
    assert (inside[clear] >= distances[clear] - 1e-9).all()


def test_without_obstacles_the_distance_is_infinite():
    np.testing.assert_array_equal(trace_distances(planar_task(), [[]])(np.zeros((3, 5))), np.inf)


def test_an_objective_that_looks_at_other_samples_is_named():
    @step_objective(unit="rad")
    def mean(step: Step):
        return step.motion.q[..., 0].mean(axis=-1)

    loop = pk.ClosedLoop(pk.arms.marcos_nr(3), marcos_2012.round_trip(0.7, 4), objectives=[mean], start=posture(3))
    with pytest.raises(InvalidInput, match="objective mean"):
        loop.step_search()
