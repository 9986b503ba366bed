"""Obstacles as lines, in the plane or in space, and free places for labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float, Int

from paretoik.collision.obstacles import Box, Capsule, Circle, HalfSpace, Obstacle, Sphere

# Places of labels: next to a mark or in a frame, and the marks that they cover; in any unit of length.


Point = Float[np.ndarray, " 2"]
Places = Float[np.ndarray, "places 2"]
Lines = Float[np.ndarray, "lines 2 2"]
NO_LINES = np.zeros((0, 2, 2))


def places_beside(mark: Point, half: Point, distances: tuple[float, ...]) -> Places:
    """Return middles of a label on all sides of its `mark`, nearest first; ``half``: half its size."""
    sides = np.array([(1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, -1), (1, 1), (-1, 1)], dtype=float)
    return np.concatenate([mark + sides * (half + distance) for distance in distances])


def places_between(low: Point, high: Point, count: int) -> Places:
    """Return a grid of ``count`` by ``count`` places between corners; one place along an empty range."""
    across, along = (np.linspace(a, b, count) if a < b else np.array([a]) for a, b in zip(low, high, strict=True))
    return np.stack(np.meshgrid(across, along), axis=-1).reshape(-1, 2)


def count_covered(
    middles: Places, half: Point, others: Float[np.ndarray, "marks 2"], *, gap: float = 0.0
) -> Int[np.ndarray, " places"]:
    """Return how many marks a label covers at each place.

    half: half the label's size
    gap: margin around the label
    """
    across, along = (
        np.abs(others[:, axis] - middles[:, axis, None]) < half[axis] + gap for axis in (0, 1)
    )  # axis by axis: reducing pairs takes NumPy several times as long
    return np.asarray((across & along).sum(axis=1))


def freest_place(
    middles: Places,
    half: Point,
    mark: Point,
    others: Float[np.ndarray, "marks 2"],
    gap: float,
    lines: Lines = NO_LINES,
    reach: float = 0.0,
    leader: float = 0.0,
) -> tuple[Point, bool]:
    """Return the best place of a label, and whether it is free.

    A label's leader is the line to its `mark`, drawn if it is longer than ``leader``. The best place has the lowest sum
    of covered marks and of ``lines`` that the leader crosses. Among equal places, the leader passes the fewest other
    marks within ``reach``, then the place is nearest to the mark. A place is free if nothing is covered, crossed or
    passed.
    """
    ends = np.clip(mark, middles - half, middles + half)
    distances = np.linalg.norm(ends - mark, axis=1)
    # two lines cross if the ends of each are on both sides of the other
    tails, tips = lines[:, 0], lines[:, 1]
    sides = _side(mark, ends[:, None], tails) * _side(mark, ends[:, None], tips)
    ways = _side(tails, tips, mark) * _side(tails, tips, ends[:, None])
    lost = ((sides < 0.0) & (ways < 0.0)).sum(axis=1) + count_covered(middles, half, others, gap=gap)
    # marks near the leader; one next to its own mark only counts if the leader points towards it
    along, away = ends - mark, others - mark
    squared = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    shares = np.clip(away @ along.T / squared, 0.0, 1.0).T
    nearest = np.linalg.norm(away - shares[..., None] * along[:, None], axis=-1)
    touched = (nearest < np.minimum(reach, np.linalg.norm(away, axis=1))).sum(axis=1)
    touched = np.where(distances > leader, touched, 0)
    best = np.lexsort((distances, touched, lost))[0]
    return np.asarray(middles[best]), not (lost[best] or touched[best])


def _side(tail: np.ndarray, tip: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return on which side of a line a point is, as a sign."""
    along, away = tip - tail, point - tail
    return np.asarray(along[..., 0] * away[..., 1] - along[..., 1] * away[..., 0])


# Obstacles as lines.


Polyline = Float[np.ndarray, "_ axes"]
Box3 = tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]  # lowest and highest corner [m]


@dataclass(frozen=True, kw_only=True)
class SlabOptions:
    """Sizes of half-spaces in drawings, as shares of a scene's size.

    margin: margin of the scene around the arm
    near: largest distance of a plane that the scene contains
    depth: depth of the slab that is drawn
    lines: number of hatching lines in space
    """

    margin: float = 0.1
    near: float = 0.75
    depth: float = 0.04
    lines: int = 12


SLAB = SlabOptions()
ANGLES = np.linspace(0.0, 2.0 * np.pi, 49) % (2.0 * np.pi)  # closed exactly
RING = np.stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros_like(ANGLES)], axis=1)
EDGES = [(i, j) for i in range(8) for j in range(i) if (i ^ j).bit_count() == 1]  # pairs of a box's corners


def obstacle_lines(
    obstacles: Sequence[Obstacle], height: tuple[float, float] | None, seen: Float[np.ndarray, "points axes"]
) -> list[Polyline]:
    """Return obstacles as outlines in the plane, or as wires in space if ``height`` [m] is given.

    Half-spaces are clipped to the box around the points ``seen`` [m], their feet on near planes, and a margin.
    """
    low, high = scene_box(obstacles, seen)
    if height is None:
        return [line for each in obstacles if (line := outline(each, (low, high))) is not None]
    return [line for each in obstacles for line in wires(each, height, (low, high))]


def scene_box(obstacles: Sequence[Obstacle], seen: Float[np.ndarray, "points axes"]) -> Box3:
    """Return the corners (3,) of a box around the points ``seen`` [m] and ``feet`` of these; half-spaces end there."""
    points = np.pad(seen, ((0, 0), (0, 3 - seen.shape[1])))
    points = np.concatenate([points, *(feet(each, points) for each in obstacles if isinstance(each, HalfSpace))])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = SLAB.margin * max(float((high - low).max()), 1e-6)
    return low - margin, high + margin


def feet(half_space: HalfSpace, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "feet 3"]:
    """Return the nearest points of a plane to those points that are near it, so that views show it there."""
    point, normal = plane_of(half_space)
    distances = (points - point) @ normal
    near = np.abs(distances) <= SLAB.near * float(np.ptp(points, axis=0).max())
    return np.asarray((points - distances[:, None] * normal)[near])


def plane_of(half_space: HalfSpace) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Return a point and the normal of a half-space in space."""
    missing = 3 - len(half_space.point)
    return np.pad(half_space.point, (0, missing)), np.pad(half_space.normal, (0, missing))


def plane_frame(normal: Float[np.ndarray, " 3"]) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Return two unit vectors along a plane, the first horizontal; (first, second, normal) is right-handed."""
    first = np.cross((0.0, 1.0, 0.0) if abs(normal[2]) > 1.0 - 1e-9 else (0.0, 0.0, 1.0), normal)
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


def plane_polygon(half_space: HalfSpace, box: Box3) -> Float[np.ndarray, "corners 3"]:
    """Return the corners of the convex part of a plane inside a box, in order; none if they do not meet."""
    (point, normal), (low, high) = plane_of(half_space), box
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    center = middle - ((middle - point) @ normal) * normal
    first, second = plane_frame(normal)
    polygon = center + size * np.array([a * first + b * second for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    for axis, side in product(np.eye(3), (-1.0, 1.0)):
        polygon = _clip(polygon, side * axis, float((high if side > 0 else -low) @ axis) + 1e-9 * size)
    return polygon


def _clip(polygon: Polyline, normal: np.ndarray, offset: float) -> Polyline:
    """Return the part of a convex polygon (corners, axes) with normal · x ≤ offset (Sutherland & Hodgman 1974)."""
    beyond, kept = polygon @ normal - offset, list[np.ndarray]()
    for k, corner in enumerate(polygon):
        if beyond[k - 1] * beyond[k] < 0:
            kept.append(polygon[k - 1] + (corner - polygon[k - 1]) * beyond[k - 1] / (beyond[k - 1] - beyond[k]))
        if beyond[k] <= 0:
            kept.append(corner)
    return np.array(kept).reshape(-1, polygon.shape[1])


def outline(obstacle: Obstacle, box: Box3) -> Polyline | None:
    """Return the closed outline (points, 2) [m] of an obstacle in the plane z = 0; None if they do not meet.

    A half-space is a thin slab behind its edge, clipped to ``box``.
    """
    match obstacle:
        case HalfSpace():
            (point, normal), (low, high) = plane_of(obstacle), (corner[:2] for corner in box)
            slope = float(np.hypot(*normal[:2]))  # of the half-space's depth along the plane z = 0
            if slope < 1e-9:
                return None
            across, offset = normal[:2] / slope, float(normal @ point) / slope
            polygon = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
            polygon = _clip(polygon, across, offset)
            polygon = _clip(polygon, -across, SLAB.depth * float(np.linalg.norm(high - low)) - offset)
            return _hull(polygon)
        case Circle():
            return np.asarray(obstacle.center + obstacle.radius * RING[:, :2])
        case Sphere():
            ring = _slice_of_ball(obstacle.center, obstacle.radius)
            return ring if len(ring) else None
        case Capsule():
            centers = np.linspace(obstacle.start, obstacle.end, 33)
            return _hull(np.concatenate([_slice_of_ball(center, obstacle.radius) for center in centers]))
        case Box():  # points where edges meet the plane, and the ends of edges in it
            corners, crossings = _box_corners(obstacle, (0.0, 0.0)), list[np.ndarray]()
            for low, high in (corners[list(edge)] for edge in EDGES):
                if low[2] * high[2] <= 0 and low[2] != high[2]:
                    crossings.append((low + (high - low) * low[2] / (low[2] - high[2]))[:2])
                elif low[2] == high[2] == 0:
                    crossings += [low[:2], high[:2]]
            return _hull(np.array(crossings).reshape(-1, 2))


def wires(obstacle: Obstacle, height: tuple[float, float], box: Box3) -> list[Polyline]:
    """Return an obstacle in space as lines, each (points, 3) [m].

    Endless cylinders and beams are drawn between the two values of ``height`` [m], half-spaces inside ``box``.
    """
    match obstacle:
        case HalfSpace():  # its border in the box, and hatching
            polygon = plane_polygon(obstacle, box)
            if len(polygon) < 3:
                return []
            closed, frame = np.concatenate([polygon, polygon[:1]]), np.array(plane_frame(plane_of(obstacle)[1]))
            flat = (closed - polygon[0]) @ frame.T
            gap = float(np.ptp(flat, axis=0).max()) / SLAB.lines
            return [closed, *(polygon[0] + line @ frame for line in hatch(flat, gap=gap))]
        case Circle():
            center = np.array([*obstacle.center, 0.0])
            rings = [center + np.array([0.0, 0.0, z]) + obstacle.radius * RING for z in height]
            return [*rings, *(np.stack([rings[0][i], rings[1][i]]) for i in range(0, 48, 12))]
        case Sphere():
            turned = (RING, RING[:, [0, 2, 1]], RING[:, [2, 0, 1]])
            return [obstacle.center + obstacle.radius * ring for ring in turned]
        case Capsule():  # a ring around each end, the lines between them, and two arcs over each end
            axis, radius = obstacle.end - obstacle.start, obstacle.radius
            length = float(np.linalg.norm(axis))
            axis = axis / length if length > 0 else np.array([0.0, 0.0, 1.0])
            across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
            across /= np.linalg.norm(across)
            frame = np.stack([across, np.cross(axis, across), axis])
            rings = [end + radius * RING @ frame for end in (obstacle.start, obstacle.end)]
            lines = [np.stack([rings[0][i], rings[1][i]]) for i in range(0, 48, 12)]
            half, ends = (RING[:25, [0, 2, 1]], RING[:25, [2, 0, 1]]), ((obstacle.start, -1.0), (obstacle.end, 1.0))
            arcs = [end + radius * (arc * [1.0, 1.0, side]) @ frame for end, side in ends for arc in half]
            return [*rings, *lines, *arcs]
        case Box():
            corners = _box_corners(obstacle, height)
            return [corners[list(edge)] for edge in EDGES]


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


def _box_corners(box: Box, height: tuple[float, float]) -> Float[np.ndarray, "8 3"]:
    """Return the corners of a box; a beam, which has two half sizes, spans the range of heights."""
    sizes = box.half_sizes if len(box.half_sizes) == 3 else [*box.half_sizes, 0.5 * (height[1] - height[0])]
    return np.asarray(box.pose.apply(np.array(list(product((-1.0, 1.0), repeat=3))) * sizes))


def _slice_of_ball(center: np.ndarray, radius: float) -> Polyline:
    inside = radius**2 - center[2] ** 2
    return np.empty((0, 2)) if inside <= 0 else center[:2] + np.sqrt(inside) * RING[:, :2]


def _hull(points: Float[np.ndarray, "_ 2"]) -> Polyline | None:
    """Return the counter-clockwise closed convex hull of points; None if they do not span an area."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        order = ConvexHull(points).vertices
    except (QhullError, ValueError):
        return None
    return points[[*order, order[0]]]
