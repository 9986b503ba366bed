import numpy as np
import pytest

from paretoik.closed_loop.obstacles import gaps, round_scene, scene
from paretoik.robot.pose import Pose
from paretoik.task.distances import clearance
from paretoik.task.obstacles import Box, Capsule, Circle, Sphere

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


def distances(obstacles, nodes, of=scene):
    found = np.empty(len(nodes))
    gaps(of(obstacles), np.ascontiguousarray(nodes.reshape(len(nodes), -1).T), len(nodes), found)
    return found


@pytest.mark.parametrize("obstacles", [*([each] for each in OBSTACLES), OBSTACLES], ids=lambda some: repr(some)[:18])
@pytest.mark.parametrize("flat", [False, True])
def test_distances_are_those_of_obstacles_where_they_are_positive(obstacles, flat):
    nodes = np.random.default_rng(0).normal(size=(300, 4, 3)) * [1.0, 1.0, 0.0 if flat else 1.0]
    nodes[:20, 2] = nodes[:20, 1]  # links of no length
    wanted, found = clearance(obstacles, nodes), distances(obstacles, nodes)
    clear = wanted > 1e-9
    assert clear.any()
    np.testing.assert_allclose(found[clear], wanted[clear], rtol=1e-12, atol=1e-12)
    assert (found[~clear] <= 1e-9).all()
    assert (distances(obstacles, nodes, round_scene) <= wanted + 1e-9).all()
