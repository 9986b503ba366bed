"""Obstacles as outlines and wires."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.collision.obstacles import signed_distance
from paretoik.review.outlines import outline, wires

TURNED = pk.Pose.from_rpy([0.2, -0.1, 0.05], [0.3, -0.4, 0.9])
FLAT = [
    pk.obstacles.Circle([0.3, -0.2], 0.15),
    pk.obstacles.Sphere([0.3, -0.2, 0.1], 0.15),
    pk.obstacles.Capsule([0.0, 0.1, 0.0], [0.4, 0.3, 0.0], 0.1),
    pk.obstacles.Capsule([0.0, 0.1, 0.0], [0.0, 0.1, 0.0], 0.1),
    pk.obstacles.Box([0.5, 0.1], [0.2, 0.1]),
    pk.obstacles.Box(pk.Pose.planar(0.5, 0.1, 0.7), [0.2, 0.1]),
    pk.obstacles.Box(TURNED, [0.2, 0.1, 0.3]),
]
SOLID = [*FLAT, pk.obstacles.Box(TURNED, [0.2, 0.1]), pk.obstacles.Capsule([0.1, 0, 0], [0.2, 0.4, 0.9], 0.1)]


def distances(obstacle, points: np.ndarray) -> np.ndarray:
    return np.asarray(signed_distance(obstacle, points, points))


@pytest.mark.parametrize("obstacle", FLAT, ids=str)
def test_an_outline_lies_on_the_obstacle_and_closes(obstacle):
    line = outline(obstacle)
    assert line is not None
    points = np.pad(line, [(0, 0), (0, 1)])
    np.testing.assert_allclose(distances(obstacle, points), 0.0, atol=2e-4)  # a capsule's arc is a polygon
    np.testing.assert_array_equal(line[0], line[-1])


@pytest.mark.parametrize("obstacle", FLAT, ids=str)
def test_an_outline_holds_every_point_of_the_plane_that_is_inside(obstacle):
    line = outline(obstacle)
    assert line is not None
    rng = np.random.default_rng(0)
    points = np.pad(rng.uniform(-0.6, 1.0, (4000, 2)), [(0, 0), (0, 1)])
    inside = points[distances(obstacle, points) < -2e-3, :2]
    assert len(inside) > 20
    steps = np.roll(line[:-1], -1, axis=0) - line[:-1]
    sides = steps[:, 0] * (inside[:, None, 1] - line[:-1, 1]) - steps[:, 1] * (inside[:, None, 0] - line[:-1, 0])
    assert (sides > 0).all(axis=1).all()  # convex, counter-clockwise


@pytest.mark.parametrize(
    "obstacle",
    [
        pk.obstacles.Sphere([0, 0, 0.2], 0.1),
        pk.obstacles.Capsule([0, 0, 0.2], [1, 0, 0.2], 0.1),
        pk.obstacles.Box([0, 0, 0.2], [1, 1, 0.1]),
    ],
)
def test_what_does_not_reach_the_plane_has_no_outline(obstacle):
    assert outline(obstacle) is None


@pytest.mark.parametrize("obstacle", SOLID, ids=str)
def test_wires_lie_on_the_obstacle(obstacle):
    lines = wires(obstacle, (-0.5, 0.5))
    assert len(lines) >= 3
    points = np.concatenate([line[:-1] + s * np.diff(line, axis=0) for line in lines for s in (0.0, 1.0)])
    np.testing.assert_allclose(distances(obstacle, points), 0.0, atol=1e-12)
