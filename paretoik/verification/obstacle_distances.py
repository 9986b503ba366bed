"""Distances of links from obstacles: signed distances of points, and a search along each link.

The signed distance of points to a convex body is convex, so that golden-section search along a link finds its least.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from paretoik.verification.arm_model import rotation_of
from paretoik.verification.options import OPTIONS

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def point_distances(obstacle: Any, points: np.ndarray) -> np.ndarray:
    """Return signed distances [m] of points (..., 3) from an obstacle's surface, negative inside."""
    kind = type(obstacle).__name__
    if kind == "Circle":
        return np.hypot(*np.moveaxis(points[..., :2] - obstacle.center, -1, 0)) - obstacle.radius
    if kind == "Sphere":
        return np.linalg.norm(points - obstacle.center, axis=-1) - obstacle.radius
    if kind == "Capsule":
        axis = obstacle.end - obstacle.start
        size = float(axis @ axis)
        share = np.clip((points - obstacle.start) @ axis / size, 0.0, 1.0) if size else np.zeros(points.shape[:-1])
        return np.linalg.norm(points - obstacle.start - share[..., None] * axis, axis=-1) - obstacle.radius
    if kind == "Box":
        local = (points - obstacle.pose.position) @ rotation_of(obstacle.pose.quaternion)
        excess = np.abs(local[..., : len(obstacle.half_sizes)]) - obstacle.half_sizes
        outside = np.linalg.norm(np.maximum(excess, 0.0), axis=-1)
        return outside + np.minimum(excess.max(axis=-1), 0.0)
    raise TypeError(f"an obstacle of a kind that the verifier does not know: {kind}")


def segment_distances(obstacle: Any, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the least signed distances [m] along segments (..., 3)."""
    low, high = np.zeros(starts.shape[:-1]), np.ones(starts.shape[:-1])

    def at(share: np.ndarray) -> np.ndarray:
        return point_distances(obstacle, starts + share[..., None] * (ends - starts))

    first, second = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    one, two = at(first), at(second)
    best = np.minimum(at(low), at(high))
    for _ in range(OPTIONS.sections):
        left = one < two
        low, high = np.where(left, low, first), np.where(left, second, high)
        first, second = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        one, two = at(first), at(second)
        best = np.minimum(best, np.minimum(one, two))
    return best


def pair_distances(obstacles: Sequence[Any], nodes: np.ndarray) -> np.ndarray:
    """Return the least distances (time, links, obstacles) [m] of the center lines of links; nodes (time, nodes, 3)."""
    return np.stack([segment_distances(each, nodes[:, :-1], nodes[:, 1:]) for each in obstacles], axis=-1)


def nearest_pair(obstacles: Sequence[Any], nodes: np.ndarray) -> str:
    """Return in words which link of a posture (nodes, 3) is nearest to which obstacle."""
    distances = pair_distances(obstacles, nodes[None])[0]
    link, number = np.unravel_index(int(distances.argmin()), distances.shape)
    obstacle = obstacles[int(number)]
    name = getattr(obstacle, "name", "") or f"obstacle {number + 1}, a {type(obstacle).__name__.lower()}"
    return f"{f'link {link}' if link else 'the base'} and {name}"


def clearances(obstacles: Sequence[Any], nodes: np.ndarray, radius: float) -> np.ndarray:
    """Return the least distances (time,) [m] of links, capsules of a radius, from obstacles; nodes (time, nodes, 3)."""
    return np.asarray(pair_distances(obstacles, nodes).min(axis=(1, 2)) - radius)


def smallest_radius(obstacles: Sequence[Any]) -> float:
    """Return the smallest radius or half size [m] of obstacles."""
    return min(float(np.min(getattr(each, "half_sizes", getattr(each, "radius", np.inf)))) for each in obstacles)
