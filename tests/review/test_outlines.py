"""Obstacles as outlines and wires."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.collision.obstacles import signed_distance
from paretoik.review.outlines import obstacle_lines, outline, wires

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
HALF_SPACES = [
    pk.obstacles.HalfSpace([0.1, -0.2], [0.6, 0.8]),
    pk.obstacles.HalfSpace([0.0, -0.3], [0.0, 1.0]),
    pk.obstacles.HalfSpace([0.1, -0.2, 0.1], [0.6, 0.64, 0.48]),
]
TABLE = pk.obstacles.HalfSpace([0.0, 0.0, -0.1], [0.0, 0.0, 1.0])
BOX = np.array([-1.0, -0.9, -0.8]), np.array([1.0, 1.1, 1.2])
SOLID = [
    *FLAT,
    *HALF_SPACES,
    TABLE,
    pk.obstacles.Box(TURNED, [0.2, 0.1]),
    pk.obstacles.Capsule([0.1, 0, 0], [0.2, 0.4, 0.9], 0.1),
]


def distances(obstacle, points: np.ndarray) -> np.ndarray:
    return np.asarray(signed_distance(obstacle, points, points))


@pytest.mark.parametrize("obstacle", FLAT, ids=str)
def test_an_outline_lies_on_the_obstacle_and_closes(obstacle):
    line = outline(obstacle, BOX)
    assert line is not None
    points = np.pad(line, [(0, 0), (0, 1)])
    np.testing.assert_allclose(distances(obstacle, points), 0.0, atol=2e-4)  # a capsule's arc is a polygon
    np.testing.assert_array_equal(line[0], line[-1])


@pytest.mark.parametrize("obstacle", FLAT, ids=str)
def test_an_outline_holds_every_point_of_the_plane_that_is_inside(obstacle):
    line = outline(obstacle, BOX)
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
    assert outline(obstacle, BOX) is None


@pytest.mark.parametrize("obstacle", SOLID, ids=str)
def test_wires_lie_on_the_obstacle(obstacle):
    lines = wires(obstacle, (-0.5, 0.5), BOX)
    assert len(lines) >= 3
    points = np.concatenate([line[:-1] + s * np.diff(line, axis=0) for line in lines for s in (0.0, 1.0)])
    np.testing.assert_allclose(distances(obstacle, points), 0.0, atol=1e-12)


@pytest.mark.parametrize("obstacle", HALF_SPACES, ids=str)
def test_the_outline_of_a_half_space_is_a_thin_slab_behind_its_edge_within_the_box(obstacle):
    line = outline(obstacle, BOX)
    assert line is not None
    np.testing.assert_array_equal(line[0], line[-1])
    assert (line >= BOX[0][:2] - 1e-9).all()
    assert (line <= BOX[1][:2] + 1e-9).all()
    depths = distances(obstacle, np.pad(line, [(0, 0), (0, 1)]))
    on_edge = np.abs(depths) < 1e-12
    assert depths.max() < 1e-12
    assert on_edge.sum() >= 2
    assert depths.min() > -0.2
    edge = line[on_edge]
    sides = np.concatenate([np.isclose(edge, BOX[0][:2]), np.isclose(edge, BOX[1][:2])], axis=1)
    assert sides.any(axis=1).all()  # the edge runs from side to side of the box


@pytest.mark.parametrize("obstacle", [*HALF_SPACES, TABLE], ids=str)
def test_wires_of_a_half_space_fill_its_plane_in_the_box(obstacle):
    border, *lines = wires(obstacle, (-0.5, 0.5), BOX)
    points = np.concatenate([border, *lines])
    assert (points >= BOX[0] - 1e-6).all()
    assert (points <= BOX[1] + 1e-6).all()
    assert len(lines) >= 8
    sides = np.concatenate([np.isclose(border, BOX[0], atol=1e-6), np.isclose(border, BOX[1], atol=1e-6)], axis=1)
    assert (sides.sum(axis=1) >= 2).all()  # every corner is on an edge of the box


def test_a_half_space_beyond_the_box_is_not_drawn():
    far = pk.obstacles.HalfSpace([0.0, -5.0, 0.0], [0.0, 1.0, 0.0])
    assert outline(far, BOX) is None
    assert wires(far, (-0.5, 0.5), BOX) == []
    assert outline(TABLE, BOX) is None  # the plane of a planar arm has no edge of it


def test_a_table_below_an_arm_is_part_of_the_scene_and_a_far_one_is_not():
    seen = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.5], [0.4, 0.0, 0.5]])
    assert obstacle_lines([TABLE], (0.0, 0.5), seen)
    assert obstacle_lines([pk.obstacles.HalfSpace([0.0, -0.1], [0.0, 1.0])], None, seen[:, [0, 2]])
    assert not obstacle_lines([pk.obstacles.HalfSpace([0.0, 0.0, -9.0], [0.0, 0.0, 1.0])], (0.0, 0.5), seen)
