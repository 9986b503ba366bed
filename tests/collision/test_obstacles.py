"""Obstacles: frozen shapes, refusals, and distances."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.collision.obstacles import Box, Capsule, Circle, HalfSpace, Sphere, clearance, signed_distance
from paretoik.errors import InvalidInput
from paretoik.robot.pose import Pose


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Circle([0, 0], -0.1), "circle radius: must be positive, got -0.1 m"),
        (lambda: Sphere([0, np.inf, 0], 0.1), "sphere center: must be finite, got inf at index 1"),
        (lambda: Box([0, 0], [0.1, 0.2, 0.3]), "box center: must have shape (3,), got shape (2,)"),
        (lambda: HalfSpace([0, 0, 0], [0, 1]), "half-space normal: must have shape (3,), got shape (2,)"),
        (lambda: HalfSpace([0.0], [1.0]), "half-space point: must be 2 or 3 numbers, got shape (1,)"),
        (lambda: HalfSpace([0, 0, 0], [0, 0, 0]), "half-space normal: must not be zero, got only zeros"),
        (lambda: HalfSpace([0, 0, 0], [0, np.nan, 0]), "half-space normal: must be finite, got nan at index 1"),
        (lambda: HalfSpace([0, 0, "a"], [0, 0, 1]), "half-space point: must contain real numbers, got text"),
    ],
)
def test_what_is_no_obstacle_is_refused_with_name_wish_and_fact(make, message):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        make()


# Distances of links to obstacles, compared with brute force and laws of signed distances


TILT = Pose.from_rpy([0.2, -0.3, 0.1], [0.5, -0.4, 1.2])
OBSTACLES = {
    "circle": Circle([0.3, -0.2], 0.4),
    "sphere": Sphere([0.3, -0.2, 0.1], 0.4),
    "capsule": Capsule([-0.3, 0.1, 0.2], [0.4, -0.2, 0.5], 0.15),
    "capsule of no length": Capsule([-0.3, 0.1, 0.2], [-0.3, 0.1, 0.2], 0.3),
    "box": Box([0.1, 0.2, -0.1], [0.3, 0.2, 0.5]),
    "turned box": Box(TILT, [0.5, 0.2, 0.1]),
    "rectangle": Box([0.1, -0.2], [0.5, 0.2]),
    "turned rectangle": Box(Pose.planar(0.1, -0.2, 0.7), [0.5, 0.2]),
    "half-space": HalfSpace([0.1, -0.2, 0.3], [1.0, -2.0, 2.0]),
    "table": HalfSpace([0.0, 0.0, -0.1], [0.0, 0.0, 1.0]),
    "vertical half-space": HalfSpace([0.1, -0.2], [-0.6, 0.8]),
}
every_obstacle = pytest.mark.parametrize("obstacle", OBSTACLES.values(), ids=OBSTACLES.keys())

coordinates = st.floats(-2, 2)
points = st.tuples(coordinates, coordinates, coordinates).map(np.array)
turns = st.floats(-3, 3)
sizes = st.floats(0.01, 1.0)
rotation_vectors = st.tuples(turns, turns, turns)


def distance_of_points(obstacle, p):
    """Signed distances of points (..., 3), written independently of the library."""
    if isinstance(obstacle, Circle):
        return np.linalg.norm(p[..., :2] - obstacle.center, axis=-1) - obstacle.radius
    if isinstance(obstacle, Sphere):
        return np.linalg.norm(p - obstacle.center, axis=-1) - obstacle.radius
    if isinstance(obstacle, HalfSpace):  # the plane's equation, from its foot nearest to the origin
        axes = len(obstacle.point)
        foot = (obstacle.point @ obstacle.normal) * obstacle.normal
        return np.einsum("...i,i->...", p[..., :axes] - foot, obstacle.normal)
    if isinstance(obstacle, Capsule):
        axis = obstacle.end - obstacle.start
        along = ((p - obstacle.start) @ axis / max(axis @ axis, 1e-300)).clip(0, 1)
        return np.linalg.norm(p - obstacle.start - along[..., None] * axis, axis=-1) - obstacle.radius
    beyond = np.abs(obstacle.pose.inverse().apply(p)[..., : len(obstacle.half_sizes)]) - obstacle.half_sizes
    return np.linalg.norm(beyond.clip(min=0), axis=-1) + beyond.max(axis=-1).clip(max=0)


def distance_by_search(obstacle, starts, ends):
    """Least distance along segments by ternary search, which is safe because every obstacle is convex."""
    low, high = np.zeros(len(starts)), np.ones(len(starts))
    for _ in range(100):
        left, right = low + (high - low) / 3, high - (high - low) / 3
        at_left, at_right = (distance_of_points(obstacle, starts + s[:, None] * (ends - starts)) for s in (left, right))
        low, high = np.where(at_left > at_right, left, low), np.where(at_left > at_right, high, right)
    distances = [
        distance_of_points(obstacle, starts + s[:, None] * (ends - starts)) for s in (0 * low, low, 0 * low + 1)
    ]
    return np.min(distances, axis=0)


def random_segments(count, seed=3):
    rng = np.random.default_rng(seed)
    starts = rng.uniform(-1, 1, (count, 3))
    return starts, starts + rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-4, 0.5, (count, 1))


@every_obstacle
def test_clearance_agrees_with_dense_sampling_at_many_postures(obstacle):
    rng = np.random.default_rng(1)
    bases, steps = rng.uniform(-0.8, 0.8, (4000, 1, 3)), rng.uniform(-0.5, 0.5, (4000, 3, 3))
    nodes = np.cumsum(np.concatenate([bases, steps], axis=1), axis=1)
    result = clearance([obstacle], nodes, radius=0.03)
    sampled = np.full(4000, np.inf)
    for share in np.linspace(0, 1, 33):
        at = nodes[:, :-1] + share * steps
        sampled = np.minimum(sampled, distance_of_points(obstacle, at).min(axis=1) - 0.03)
    longest = np.linalg.norm(steps, axis=2).max(axis=1)
    assert (result < sampled + 1e-12).all()
    assert (result > sampled - longest / 64 - 1e-12).all()  # a distance grows by at most the length of the way
    assert (result < 0).sum() > 160
    assert (result > 0).sum() > 160


@every_obstacle
def test_segments_along_the_axes_and_through_corners_are_exact(obstacle):
    grid = np.array([-0.6, -0.4, 0.0, 0.1, 0.4, 1.1])
    positions = np.stack(np.meshgrid(grid, grid, grid), axis=-1).reshape(-1, 3)
    for axis in np.eye(3):
        ends = positions + 0.7 * axis
        result = signed_distance(obstacle, positions, ends)
        np.testing.assert_allclose(result, distance_by_search(obstacle, positions, ends), rtol=0, atol=1e-13)


@pytest.mark.parametrize("tilt", [0.0, 1e-15, 1e-8])
def test_nearly_parallel_segments_lose_no_digits(tilt):
    capsule = Capsule([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.1)
    starts, ends = np.array([[0.2, -0.3 * tilt, 0.5]]), np.array([[0.9, 0.4 * tilt, 0.5]])
    assert signed_distance(capsule, starts, ends) == pytest.approx(0.4, abs=1e-15)


@every_obstacle
def test_a_segment_is_as_near_as_the_nearer_of_its_parts_whichever_way_it_runs(obstacle):
    starts, ends = random_segments(500)
    whole = signed_distance(obstacle, starts, ends)
    middles = 0.3 * starts + 0.7 * ends
    halves = signed_distance(obstacle, starts, middles), signed_distance(obstacle, middles, ends)
    np.testing.assert_allclose(np.minimum(*halves), whole, atol=1e-14)
    np.testing.assert_allclose(signed_distance(obstacle, ends, starts), whole, atol=1e-14)


@given(points, rotation_vectors, points, points, points, points, sizes, st.tuples(sizes, sizes, sizes))
def test_moving_obstacle_and_link_together_changes_nothing(
    position, rotation_vector, start, end, first, last, radius, halves
):
    move, pose = Pose.from_rpy(position, rotation_vector), Pose.from_rpy(first, last)
    pairs = [
        (Sphere(first, radius), Sphere(move.apply(first), radius)),
        (Capsule(first, last, radius), Capsule(move.apply(first), move.apply(last), radius)),
        (Box(pose, halves), Box(move @ pose, halves)),
        (Box(pose, halves[:2]), Box(move @ pose, halves[:2])),
        (HalfSpace(first, pose.rotation[:, 2]), HalfSpace(move.apply(first), (move @ pose).rotation[:, 2])),
    ]
    for here, there in pairs:
        moved = signed_distance(there, move.apply(start), move.apply(end))
        assert moved == pytest.approx(signed_distance(here, start, end), abs=1e-12)


@given(points, points, st.floats(-50, 50), st.floats(-50, 50))
def test_flat_obstacles_are_endless_along_z(start, end, up, down):
    for obstacle in (OBSTACLES[name] for name in ("circle", "turned rectangle", "vertical half-space")):
        lifted = signed_distance(obstacle, start + up * np.eye(3)[2], end + down * np.eye(3)[2])
        assert lifted == pytest.approx(signed_distance(obstacle, start, end), abs=1e-12)


@every_obstacle
def test_a_posture_that_is_not_a_number_has_no_clearance_and_spoils_no_other(obstacle):
    nodes = np.random.default_rng(2).normal(size=(5, 4, 3))
    expected = clearance([obstacle], nodes)
    nodes[2, 1, 0] = np.nan
    result = clearance([obstacle], nodes)
    assert np.isnan(result).tolist() == [False, False, True, False, False]
    assert (result[[0, 1, 3, 4]] == expected[[0, 1, 3, 4]]).all()


def test_clearance_is_the_least_over_links_and_obstacles_less_the_radius():
    nodes = np.random.default_rng(4).normal(size=(6, 11, 4, 3))
    result = clearance(list(OBSTACLES.values()), nodes, radius=0.1)
    each = [
        signed_distance(obstacle, nodes[..., k, :], nodes[..., k + 1, :]) - 0.1
        for obstacle in OBSTACLES.values()
        for k in range(3)
    ]
    assert result.shape == (6, 11)
    np.testing.assert_allclose(result, np.min(each, axis=0), atol=1e-15)


@given(points, points, st.floats(1e-290, 1e290), points)
def test_a_half_space_depends_on_the_direction_of_its_normal_only(start, end, size, point):
    plain, scaled = HalfSpace(point, [0.48, -0.6, 0.64]), HalfSpace(point, size * np.array([0.48, -0.6, 0.64]))
    assert np.linalg.norm(scaled.normal) == pytest.approx(1.0, abs=1e-15)
    assert signed_distance(scaled, start, end) == pytest.approx(signed_distance(plain, start, end), abs=1e-14)


@given(points, points, points)
def test_a_half_space_is_the_limit_of_large_boxes(start, end, point):
    table = HalfSpace(point, [0.0, 0.0, 1.0])
    box = Box(point - [0.0, 0.0, 1e3], [1e4, 1e4, 1e3])
    assert signed_distance(table, start, end) == pytest.approx(signed_distance(box, start, end), abs=1e-9)
