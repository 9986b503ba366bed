from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.task.obstacles import signed_distance
from paretoik.verification.measured_motion import segment_distances

TURNED = pk.Pose.from_rpy([0.1, -0.2, 0.3], [0.4, 0.5, 0.6])
OBSTACLES = {
    "circle": pk.obstacles.Circle([0.1, 0.2], 0.3),
    "sphere": pk.obstacles.Sphere([0.1, 0.2, -0.3], 0.4),
    "capsule": pk.obstacles.Capsule([0.0, 0.1, 0.2], [0.4, -0.3, 0.1], 0.2),
    "point capsule": pk.obstacles.Capsule([0.0, 0.1, 0.2], [0.0, 0.1, 0.2], 0.2),
    "box": pk.obstacles.Box(TURNED, [0.2, 0.3, 0.4]),
    "beam": pk.obstacles.Box(TURNED, [0.2, 0.3]),
}


@pytest.mark.parametrize("name", OBSTACLES)
def test_a_search_along_links_finds_the_distances_of_the_closed_forms(name):
    starts, ends = np.random.default_rng(3).normal(size=(2, 300, 3))
    found = segment_distances(OBSTACLES[name], starts, ends)
    np.testing.assert_allclose(found, signed_distance(OBSTACLES[name], starts, ends), atol=1e-7)
