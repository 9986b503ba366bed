"""How obstacles are drawn: as hatched outlines where the arm moves in a plane, as bodies in space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float

from paretoik.arrays import Vector3
from paretoik.review.obstacle_outlines import Polyline
from paretoik.review.palette import SCREEN
from paretoik.task.obstacles import Capsule, Circle, Obstacle, Sphere


def hatch(corners: Polyline, *, gap: float) -> list[Float[np.ndarray, "2 2"]]:
    """Return lines at 45 degrees, a ``gap`` apart, across the inside of a closed convex outline (corners, 2)."""
    across, along = np.array([1.0, 1.0]) / np.sqrt(2), np.array([1.0, -1.0]) / np.sqrt(2)
    start, end = corners[:-1], corners[1:]
    first, last = start @ across, end @ across
    lines = []
    for level in np.arange(first.min() + 0.5 * gap, first.max(), gap):
        crossed = (first <= level) != (last <= level)
        share = ((level - first[crossed]) / (last - first)[crossed])[:, None]
        met = start[crossed] + share * (end - start)[crossed]
        if len(met) == 2:
            lines.append(met[np.argsort(met @ along)])
    return lines


def bodies(obstacles: Sequence[Obstacle], low: Vector3, high: Vector3) -> list[tuple[str, Any]]:
    """Return obstacles in space as archetypes by number; those without end reach beyond ``low`` and ``high``."""
    colour, fill = SCREEN.obstacle_body, rr.components.FillMode.Solid
    length = 1.2 * float(np.linalg.norm(high - low))
    drawn: list[tuple[str, Any]] = []
    for number, obstacle in enumerate(obstacles, start=1):
        body: Any
        if isinstance(obstacle, Sphere):
            body = rr.Ellipsoids3D(
                centers=[obstacle.center], half_sizes=[[obstacle.radius] * 3], colors=colour, fill_mode=fill
            )
        elif isinstance(obstacle, Circle):
            middle = [*obstacle.center, (low + high)[2] / 2]
            height = float((high - low)[2])
            body = rr.Cylinders3D(
                centers=[middle], lengths=[height], radii=[obstacle.radius], colors=colour, fill_mode=fill
            )
        elif isinstance(obstacle, Capsule):
            axis = obstacle.end - obstacle.start
            body = rr.Capsules3D(
                translations=[obstacle.start],
                lengths=[float(np.linalg.norm(axis))],
                radii=[obstacle.radius],
                quaternions=[rr.Quaternion(xyzw=turn_of_z(axis))],
                colors=colour,
                fill_mode=fill,
            )
        else:
            sizes = obstacle.half_sizes if len(obstacle.half_sizes) == 3 else [*obstacle.half_sizes, length / 2]
            body = rr.Boxes3D(
                centers=[obstacle.pose.position],
                half_sizes=[sizes],
                quaternions=[rr.Quaternion(xyzw=np.roll(obstacle.pose.quaternion, -1))],
                colors=colour,
                fill_mode=fill,
            )
        drawn.append((f"{number}", body))
    return drawn


def extent(obstacle: Obstacle) -> Float[np.ndarray, "corners 3"]:
    """Return points [m] that an obstacle lies between, as far as it ends."""
    if isinstance(obstacle, Circle):
        return np.array([[*(obstacle.center + sign * obstacle.radius), 0.0] for sign in (-1, 1)])
    if isinstance(obstacle, Sphere):
        return np.array([obstacle.center + sign * obstacle.radius for sign in (-1, 1)])
    if isinstance(obstacle, Capsule):
        ends = np.array([obstacle.start, obstacle.end])
        return np.concatenate([ends - obstacle.radius, ends + obstacle.radius])
    sizes = np.pad(obstacle.half_sizes, (0, 3 - len(obstacle.half_sizes)))
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    return np.asarray(obstacle.pose.apply(signs * sizes))


def turn_of_z(axis: Vector3) -> np.ndarray:
    """Return the quaternion (x, y, z, w) of a rotation that takes z to the direction of ``axis``."""
    length = np.linalg.norm(axis)
    if length == 0:
        return np.array([0.0, 0.0, 0.0, 1.0])
    x, y, z = axis / length
    if z < -1 + 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])
    quaternion = np.array([-y, x, 0.0, 1.0 + z])
    return quaternion / np.linalg.norm(quaternion)
