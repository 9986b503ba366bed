"""Obstacles as lines: outlines in the plane of a planar arm, wires in space."""

from __future__ import annotations

from itertools import product

import numpy as np
from jaxtyping import Float

from paretoik.task.obstacles import Box, Capsule, Circle, Obstacle, Sphere

Polyline = Float[np.ndarray, "_ axes"]
ANGLES = np.linspace(0.0, 2.0 * np.pi, 49) % (2.0 * np.pi)  # closed exactly
RING = np.stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros_like(ANGLES)], axis=1)

EDGES = [(i, j) for i in range(8) for j in range(i) if (i ^ j).bit_count() == 1]  # of a box, by its corners' signs


def outline(obstacle: Obstacle) -> Polyline | None:
    """Return the closed outline (points, 2) [m] of an obstacle in the plane z = 0; None where it does not reach it."""
    match obstacle:
        case Circle():
            return np.asarray(obstacle.center + obstacle.radius * RING[:, :2])
        case Sphere():
            inside = obstacle.radius**2 - obstacle.center[2] ** 2
            return None if inside <= 0 else np.asarray(obstacle.center[:2] + np.sqrt(inside) * RING[:, :2])
        case Capsule():
            return _hull(np.concatenate([_slice_of_ball(end, obstacle.radius) for end in _centers(obstacle)]))
        case Box():
            return _hull(_slice_of_box(obstacle))


def wires(obstacle: Obstacle, height: tuple[float, float]) -> list[Polyline]:
    """Return an obstacle in space as lines, each (points, 3) [m].

    What has no ends is drawn as long as the two numbers of ``height`` [m] are apart.
    """
    match obstacle:
        case Circle():
            center = np.array([*obstacle.center, 0.0])
            rings = [center + np.array([0.0, 0.0, z]) + obstacle.radius * RING for z in height]
            return [*rings, *(np.stack([rings[0][i], rings[1][i]]) for i in range(0, 48, 12))]
        case Sphere():
            turned = (RING, RING[:, [0, 2, 1]], RING[:, [2, 0, 1]])
            return [obstacle.center + obstacle.radius * ring for ring in turned]
        case Capsule():
            return _capsule_wires(obstacle)
        case Box():
            corners = _box_corners(obstacle, height)
            return [corners[list(edge)] for edge in EDGES]


def _capsule_wires(capsule: Capsule) -> list[Polyline]:
    """Return a ring about each end, the lines between them, and two arcs over each end."""
    axis = capsule.end - capsule.start
    length = float(np.linalg.norm(axis))
    axis = axis / length if length > 0 else np.array([0.0, 0.0, 1.0])
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(axis, across), axis])
    rings = [end + capsule.radius * RING @ frame for end in (capsule.start, capsule.end)]
    lines = [np.stack([rings[0][i], rings[1][i]]) for i in range(0, 48, 12)]
    half = RING[:25, [0, 2, 1]], RING[:25, [2, 0, 1]]
    ends = ((capsule.start, -1.0), (capsule.end, 1.0))
    arcs = [end + capsule.radius * (arc * [1.0, 1.0, side]) @ frame for end, side in ends for arc in half]
    return [*rings, *lines, *arcs]


def _box_corners(box: Box, height: tuple[float, float]) -> Float[np.ndarray, "8 3"]:
    """Return the corners of a box; a beam, which has two half sizes, is as long as the heights are apart."""
    sizes = box.half_sizes if len(box.half_sizes) == 3 else [*box.half_sizes, 0.5 * (height[1] - height[0])]
    return np.asarray(box.pose.apply(np.array(list(product((-1.0, 1.0), repeat=3))) * sizes))


def _slice_of_box(box: Box) -> Polyline:
    """Return where the edges of a box meet the plane z = 0, (points, 2); of a rectangle in it, its corners."""
    corners = _box_corners(box, (0.0, 0.0))
    crossings: list[np.ndarray] = []
    for low, high in (corners[list(edge)] for edge in EDGES):
        if low[2] * high[2] <= 0 and low[2] != high[2]:
            crossings.append((low + (high - low) * low[2] / (low[2] - high[2]))[:2])
        elif low[2] == high[2] == 0:
            crossings += [low[:2], high[:2]]
    return np.array(crossings).reshape(-1, 2)


def _centers(capsule: Capsule) -> Float[np.ndarray, "centers 3"]:
    return np.linspace(capsule.start, capsule.end, 33)


def _slice_of_ball(center: np.ndarray, radius: float) -> Polyline:
    inside = radius**2 - center[2] ** 2
    return np.empty((0, 2)) if inside <= 0 else center[:2] + np.sqrt(inside) * RING[:, :2]


def _hull(points: Float[np.ndarray, "_ 2"]) -> Polyline | None:
    """Return the closed convex hull of points, counter-clockwise; None of fewer than three that are no line."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        order = ConvexHull(points).vertices
    except (QhullError, ValueError):
        return None
    return points[[*order, order[0]]]
