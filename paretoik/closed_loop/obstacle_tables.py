"""Obstacles as rows of numbers, for compiled code."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from paretoik.task.obstacles import Box, Capsule, Circle, Obstacle, Sphere

POINT, SEGMENT, BOX = range(3)
KIND, RADIUS, FIRST, SECOND, AXES, COLUMNS = 0, 1, 2, 5, 8, 17
INFINITE_SIZE = 1e30  # m: half the size of what has no end


def tabulate(obstacles: Sequence[Obstacle]) -> Float[np.ndarray, "obstacles columns"]:
    """Return a row an obstacle: kind, radius, two points or a center and half sizes, three axes.

    The last axis of a circle, which is a cylinder in space, is 0.
    """
    rows = np.zeros((len(obstacles), COLUMNS))
    for row, each in zip(rows, obstacles, strict=True):
        row[AXES:] = np.eye(3).ravel()
        if isinstance(each, Box):
            half_sizes = np.append(each.half_sizes, [INFINITE_SIZE] * (3 - len(each.half_sizes)))
            row[KIND], row[FIRST : FIRST + 3], row[SECOND : SECOND + 3] = BOX, each.pose.position, half_sizes
            row[AXES:] = each.pose.rotation.T.ravel()
        elif isinstance(each, Capsule):
            row[KIND], row[RADIUS] = SEGMENT, each.radius
            row[FIRST : FIRST + 3], row[SECOND : SECOND + 3] = each.start, each.end
        else:
            row[KIND], row[RADIUS], row[FIRST : FIRST + len(each.center)] = POINT, each.radius, each.center
            row[AXES + 8] = 0.0 if isinstance(each, Circle) else 1.0
    return rows


def tabulate_balls(obstacles: Sequence[Obstacle]) -> Float[np.ndarray, "obstacles columns"]:
    """Return the rows of a ball or circle around each obstacle; the obstacle itself where there is none."""
    return tabulate([bounding_ball(obstacle) for obstacle in obstacles])


def bounding_ball(obstacle: Obstacle) -> Obstacle:
    """Return a ball around an obstacle, or a circle; the obstacle itself where there is none."""
    if isinstance(obstacle, Capsule):
        half_length = float(np.linalg.norm(obstacle.end - obstacle.start)) / 2
        return Sphere((obstacle.start + obstacle.end) / 2, obstacle.radius + half_length)
    if not isinstance(obstacle, Box):
        return obstacle
    place, radius = obstacle.pose, float(np.linalg.norm(obstacle.half_sizes))
    if len(obstacle.half_sizes) == 3:
        return Sphere(place.position, radius)
    is_upright = abs(place.rotation[2, 2]) == 1.0
    return Circle(place.position[:2], radius) if is_upright else obstacle
