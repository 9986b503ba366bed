from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.collision.obstacles import signed_distance
from paretoik.task.motion import Motion
from paretoik.verification.measured_motion import quadrature, rates, rebuild, segment_distances

MOTIONS = [
    (3, False, True),
    (4, False, False),
    (5, False, True),
    (12, False, False),
    (5, True, False),
    (12, True, False),
]


@pytest.mark.parametrize("differences", ["spline", "backward", "central"])
@pytest.mark.parametrize(("samples", "cyclic", "rest"), MOTIONS)
def test_the_curve_rebuilt_from_its_definition_is_that_of_the_motion(samples, cyclic, rest, differences):
    rng = np.random.default_rng(samples)
    time = np.append(0.0, np.cumsum(rng.uniform(0.5, 1.5, samples - 1)))
    q = rng.normal(size=(samples, 3))
    q[-1] = q[0] if cyclic else q[-1]
    options = {"differences": differences, "cyclic": cyclic}
    motion = Motion(arm=pk.arms.tringali_3r(), time=time, q=q, ends_at_rest=rest, **options)
    curve, instants = rebuild(time, q, ends_at_rest=rest, **options), motion.instants
    t = np.linspace(0.0, time[-1], 50)
    np.testing.assert_allclose(curve(t), motion.at(t, project=False), atol=1e-10)
    for ours, theirs in zip(rates(curve, time, q, **options), (instants.dq, instants.ddq, instants.jerk), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)
    np.testing.assert_allclose(quadrature(time, differences), instants.weights, atol=1e-12)


TURNED = pk.Pose.from_rpy([0.1, -0.2, 0.3], [0.4, 0.5, 0.6])
OBSTACLES = {
    "circle": pk.obstacles.Circle([0.1, 0.2], 0.3),
    "sphere": pk.obstacles.Sphere([0.1, 0.2, -0.3], 0.4),
    "capsule": pk.obstacles.Capsule([0.0, 0.1, 0.2], [0.4, -0.3, 0.1], 0.2),
    "box": pk.obstacles.Box(TURNED, [0.2, 0.3, 0.4]),
    "beam": pk.obstacles.Box(TURNED, [0.2, 0.3]),
    "half-space": pk.obstacles.HalfSpace([0.1, -0.2, 0.3], [1.0, 2.0, -2.0]),
    "vertical half-space": pk.obstacles.HalfSpace([0.1, -0.2], [3.0, -4.0]),
}


@pytest.mark.parametrize("name", OBSTACLES)
def test_a_search_along_links_finds_the_distances_of_the_closed_forms(name):
    starts, ends = np.random.default_rng(3).normal(size=(2, 100, 3))
    found = segment_distances(OBSTACLES[name], starts, ends)
    np.testing.assert_allclose(found, signed_distance(OBSTACLES[name], starts, ends), atol=1e-7)
