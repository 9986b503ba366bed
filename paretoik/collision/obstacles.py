"""Obstacles: convex shapes in the plane and in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Vector3
from paretoik.errors import InvalidInput
from paretoik.inputs import ArrayLike, check_magnitude, check_text, finite_array, positive_number, shown
from paretoik.robot.pose import Pose, check_pose, freeze
from paretoik.tables import represented

__all__ = ["Box", "Capsule", "Circle", "HalfSpace", "Obstacle", "Sphere"]


def __dir__() -> list[str]:
    return __all__


def _name() -> Any:
    """Return the field of a name. Names change no motion, and the fingerprint of a problem leaves them out."""
    return field(default="", metadata={"fingerprint": "never"})


@represented
@dataclass(frozen=True, init=False, eq=False)
class Circle:
    """A disc in the xy-plane; in space an infinite cylinder along z.

    center: coordinates (2,) [m]
    radius: radius [m]
    name: name in messages; "obstacle 1" for the first of a problem without one, and so on
    """

    center: Float[np.ndarray, " 2"]
    radius: float
    name: str = _name()

    def __init__(self, center: ArrayLike, radius: float, *, name: str = "") -> None:
        size = positive_number("circle radius", radius, "m")
        freeze(self, center=_point("circle center", center, 2), radius=size, name=_text("circle name", name))


@represented
@dataclass(frozen=True, init=False, eq=False)
class Sphere:
    """A ball.

    center: coordinates (3,) [m]
    radius: radius [m]
    name: name in messages, as of ``Circle``
    """

    center: Vector3
    radius: float
    name: str = _name()

    def __init__(self, center: ArrayLike, radius: float, *, name: str = "") -> None:
        size = positive_number("sphere radius", radius, "m")
        freeze(self, center=_point("sphere center", center, 3), radius=size, name=_text("sphere name", name))


@represented
@dataclass(frozen=True, init=False, eq=False)
class Capsule:
    """The points within a radius of a segment.

    start, end: ends of the segment (3,) [m], which may be one point
    radius: radius [m]
    name: name in messages, as of ``Circle``
    """

    start: Vector3
    end: Vector3
    radius: float
    name: str = _name()

    def __init__(self, start: ArrayLike, end: ArrayLike, radius: float, *, name: str = "") -> None:
        ends = {"start": _point("capsule start", start, 3), "end": _point("capsule end", end, 3)}
        size = positive_number("capsule radius", radius, "m")
        freeze(self, **ends, radius=size, name=_text("capsule name", name))


@represented
@dataclass(frozen=True, init=False, eq=False)
class Box:
    """A box, or a rectangle in its own xy-plane.

    center: point, or pose if rotated; for a rectangle a 2-D point or a pose (``Pose.planar``)
    half_sizes: half lengths along its own axes [m], three of a box, two of a rectangle
    name: name in messages, as of ``Circle``

    In space a rectangle is an infinite beam along its own z. Raises InvalidInput for other shapes.
    """

    pose: Pose
    half_sizes: Float[np.ndarray, " axes"]
    name: str = _name()

    def __init__(self, center: Pose | ArrayLike, half_sizes: ArrayLike, *, name: str = "") -> None:
        sizes = finite_array("box half_sizes", half_sizes)
        if sizes.shape not in ((2,), (3,)):
            raise InvalidInput(f"box half_sizes: must be 2 or 3 numbers, got shape {sizes.shape}")
        if sizes.min() <= 0:
            raise InvalidInput(f"box half_sizes: must be positive, got {sizes.min():g} m at index {sizes.argmin()}")
        if not isinstance(center, Pose):
            point = _point("box center", center, len(sizes))
            center = Pose(np.pad(point, (0, 3 - len(point))))
        check_pose("box center", center)
        freeze(self, pose=center, half_sizes=sizes, name=_text("box name", name))


@represented
@dataclass(frozen=True, init=False, eq=False)
class HalfSpace:
    """All points behind a plane, such as a table or a wall.

    point: any point of the plane [m], (3,) or, for a vertical plane through a line in the xy-plane, (2,)
    normal: direction out of the half-space, with as many numbers as ``point``; normalised
    name: name in messages, as of ``Circle``

    The distance of a link is the smaller one of its two ends. Raises InvalidInput for other shapes and a zero normal.

    >>> table = HalfSpace([0.0, 0.0, -0.02], normal=[0.0, 0.0, 1.0], name="table")
    """

    point: Float[np.ndarray, " axes"]
    normal: Float[np.ndarray, " axes"]
    name: str = _name()

    def __init__(self, point: ArrayLike, normal: ArrayLike, *, name: str = "") -> None:
        place = finite_array("half-space point", point)
        if place.shape not in ((2,), (3,)):
            raise InvalidInput(f"half-space point: must be 2 or 3 numbers, got shape {place.shape}")
        check_magnitude("half-space point", place, "m")
        direction = finite_array("half-space normal", normal, shape=place.shape)
        largest = float(np.abs(direction).max())
        if largest == 0:
            raise InvalidInput("half-space normal: must not be zero, got only zeros")
        direction = direction / largest  # squares of very large or small numbers are not finite or zero
        direction = direction / np.linalg.norm(direction)
        freeze(self, point=place, normal=direction, name=_text("half-space name", name))


Obstacle: TypeAlias = Circle | Sphere | Capsule | Box | HalfSpace
SHAPES = {Circle: "circle", Sphere: "sphere", Capsule: "capsule", Box: "box", HalfSpace: "half-space"}


def obstacle_name(obstacles: Sequence[Obstacle], index: int) -> str:
    """Return an obstacle's name, or "obstacle 1" for the first one if it has none."""
    return obstacles[index].name or f"obstacle {index + 1}"


def describe_obstacle(obstacles: Sequence[Obstacle], index: int) -> str:
    """Return an obstacle's name and shape in words: "obstacle 2, a circle" or "the obstacle table, a box"."""
    given = "the obstacle " * bool(obstacles[index].name)
    return f"{given}{obstacle_name(obstacles, index)}, a {SHAPES[type(obstacles[index])]}"


def check_names(obstacles: Sequence[Obstacle]) -> None:
    """Raise InvalidInput if two obstacles have the same name."""
    names = [obstacle_name(obstacles, index) for index in range(len(obstacles))]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidInput(f"obstacles: names must differ, got {names.count(twice)} obstacles named {twice}")


def _text(name: str, text: str) -> str:
    check_text(name, text)
    if text != text.strip():
        raise InvalidInput(f"{name} must not begin or end with a space, got {shown(text)}")
    return text


def _point(name: str, coordinates: ArrayLike, size: int) -> Float[np.ndarray, " size"]:
    point = finite_array(name, coordinates, shape=(size,))
    check_magnitude(name, point, "m")
    return point


# Distances of an arm's links from obstacles.
#
# Every obstacle is convex and has a signed distance to its surface, negative inside. A link is a capsule: the points
# within a radius of the segment between two consecutive nodes of the arm.


if TYPE_CHECKING:
    Numbers: TypeAlias = np.ndarray
else:
    Numbers = Any  # expressions, if derivatives are taken
Components: TypeAlias = Sequence[Numbers]  # one array each for x, y and, in space, z


LinkRadius: TypeAlias = float | Sequence[float]  # m: one radius of all links, or one per link, the base's first


def radii(radius: LinkRadius) -> float | Float[np.ndarray, " links"]:
    """Return the radius of all links, or an array of one per link."""
    return np.array(radius) if isinstance(radius, Sequence) else radius


def radius_of(radius: LinkRadius, link: int) -> float:
    """Return the radius [m] of one link, counted from the base, 0."""
    return radius[link] if isinstance(radius, Sequence) else radius


def clearance(
    obstacles: Sequence[Obstacle], nodes: Float[np.ndarray, "*batch nodes 3"], radius: LinkRadius = 0.0
) -> Float[np.ndarray, "*batch"]:
    """Return the smallest signed distance [m] from links to obstacles.

    The distance (*batch,) is negative inside an obstacle.

    nodes: positions (*batch, nodes, 3) [m] of the arm's joints and tool, in order
    radius: radius of all links [m], or one per link

    It is the signed distance of the links' axes minus the radius, which is exact if it is positive. Raises InvalidInput
    for no obstacles.

    >>> from paretoik.collision.obstacles import Circle
    >>> elbow = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.5, 0.0]])
    >>> float(clearance([Circle([0.2, 0.3], 0.1)], elbow, radius=0.05).round(12))
    0.15
    """
    if len(obstacles) == 0:
        raise InvalidInput("clearance: must have at least one obstacle, got none")
    starts, ends = nodes[..., :-1, :], nodes[..., 1:, :]
    distances = [signed_distance(obstacle, starts, ends) - radii(radius) for obstacle in obstacles]
    return np.asarray(reduce(np.minimum, [distance.min(axis=-1) for distance in distances]))


def closest_pair(obstacles: Sequence[Obstacle], nodes: Float[np.ndarray, "nodes 3"], radius: LinkRadius = 0.0) -> str:
    """Return in words the nearest pair of a link and an obstacle."""
    starts, ends = nodes[:-1], nodes[1:]
    distances = np.stack([signed_distance(obstacle, starts, ends) for obstacle in obstacles]) - radii(radius)
    obstacle, link = np.unravel_index(int(np.argmin(distances)), distances.shape)
    return f"{f'link {link}' if link else 'the base'} and {describe_obstacle(obstacles, int(obstacle))}"


def signed_distance(
    obstacle: Obstacle, starts: Float[np.ndarray, "*#batch 3"], ends: Float[np.ndarray, "*#batch 3"]
) -> Float[np.ndarray, "*batch"]:
    """Return the smallest signed distance [m] of segments to an obstacle.

    The distance to the surface is negative inside. Closed forms, exact up to rounding; NaN gives NaN.

    >>> from paretoik.collision.obstacles import Box
    >>> box = Box([0.0, 0.0, 0.0], half_sizes=[0.1, 0.2, 0.3])
    >>> signed_distance(box, np.array([[1.0, 0, 0], [0.1, 0, 0.0]]), np.array([[0.5, 0, 0], [0.02, 0, 0]])).round(12)
    array([ 0.4 , -0.08])
    """
    starts, ends = np.broadcast_arrays(starts, ends)
    distances = distance_components(obstacle, _components(starts.reshape(-1, 3)), _components(ends.reshape(-1, 3)))
    return distances.reshape(starts.shape[:-1])


def distance_components(obstacle: Obstacle, start: Components, end: Components) -> Numbers:
    """Return ``signed_distance`` of segments given as components, in plain NumPy that can be traced."""
    if isinstance(obstacle, Box):
        position = _components(obstacle.pose.position[None])
        axes = [_components(axis[None]) for axis in obstacle.pose.rotation.T[: len(obstacle.half_sizes)]]
        first, last = ([_dot(axis, _minus(points, position)) for axis in axes] for points in (start, end))
        return _segment_to_box(first, last, obstacle.half_sizes)
    if isinstance(obstacle, HalfSpace):
        point, normal = (_components(each[None]) for each in (obstacle.point, obstacle.normal))
        heights = [_dot(_minus(end[: len(point)], point), normal) for end in (start, end)]
        return np.minimum(*heights)  # exact: the distance from a plane is linear along a segment
    if isinstance(obstacle, Capsule):
        axis = _components(obstacle.start[None]), _components(obstacle.end[None])
        return _between_segments(start, end, *axis) - obstacle.radius
    center = _components(obstacle.center[None])
    return _point_to_segment(center, start[: len(center)], end[: len(center)]) - obstacle.radius


def _point_to_segment(point: Components, start: Components, end: Components) -> Numbers:
    step = _minus(end, start)
    offset = _minus(point, start)
    fraction = _fraction(_dot(offset, step), _dot(step, step))
    return _length([r - fraction * d for r, d in zip(offset, step, strict=True)])


def _between_segments(start: Components, end: Components, other_start: Components, other_end: Components) -> Numbers:
    """Return the distance of two segments.

    The nearest point is an end of one segment, or both nearest points of the two lines are within the segments.
    """
    step, other_step, offset = _minus(end, start), _minus(other_end, other_start), _minus(other_start, start)
    normal = _cross(step, other_step)  # products with the normal stay accurate for nearly parallel segments
    size = _dot(normal, normal)
    fraction = _fraction(_dot(_cross(offset, other_step), normal), size)
    other_fraction = _fraction(_dot(_cross(offset, step), normal), size)
    distances = [
        _length([r + other_fraction * e - fraction * d for r, d, e in zip(offset, step, other_step, strict=True)]),
        _point_to_segment(start, other_start, other_end),
        _point_to_segment(end, other_start, other_end),
        _point_to_segment(other_start, start, end),
        _point_to_segment(other_end, start, end),
    ]
    smallest: np.ndarray = reduce(np.minimum, distances)
    return smallest


def _segment_to_box(start: Components, end: Components, half_sizes: np.ndarray) -> Numbers:
    """Return the signed distance of a segment to a box about the origin.

    Outside the box, the squared distance is convex along the segment. Between crossings of the box's planes it is
    quadratic, and its derivative is linear. The derivative is zero between the last crossing at which it is at most 0
    and the first crossing at which it is at least 0.
    """
    step = _minus(end, start)

    def outside(fraction: np.ndarray) -> Components:
        points = [a + fraction * d for a, d in zip(start, step, strict=True)]
        return [p - np.clip(p, -h, h) for p, h in zip(points, half_sizes, strict=True)]

    low, high = 0.0 * step[0], 0.0 * step[0] + 1.0
    low_slope, high_slope = _dot(outside(low), step), _dot(outside(high), step)
    for a, d, h in zip(start, step, half_sizes, strict=True):
        for plane in (-h, h):
            fraction = _fraction((plane - a) * d, d * d)
            slope = _dot(outside(fraction), step)
            falls, rises = (slope <= 0) & (fraction > low), (slope >= 0) & (fraction < high)
            low, low_slope = np.where(falls, fraction, low), np.where(falls, slope, low_slope)
            high, high_slope = np.where(rises, fraction, high), np.where(rises, slope, high_slope)
    nearest: np.ndarray = low + (high - low) * _fraction(-low_slope, high_slope - low_slope)
    distances = _length(outside(nearest))
    touching = distances < 1e-9 * half_sizes.max()
    if not isinstance(touching, np.ndarray):  # traced for derivatives: both branches are recorded
        return np.where(touching, np.minimum(_depth(start, step, half_sizes), distances), distances)
    if touching.any():
        depths = _depth([a[touching] for a in start], [d[touching] for d in step], half_sizes)
        distances[touching] = np.where(depths < 0, depths, distances[touching])
    return distances


def _depth(start: Components, step: Components, half_sizes: np.ndarray) -> Numbers:
    """Return the signed distance of segments that enter the box.

    It is the minimum along a segment of max(|p| − half size). The maximum is over one rising and one falling line per
    axis. It is smallest at an end or at a crossing of a rising and a falling line.
    """
    lines = list(zip(start, step, half_sizes, strict=True))
    fractions = [0.0 * step[0], 0.0 * step[0] + 1.0]
    for a, d, h in lines:
        for b, e, k in lines:
            rising, falling = np.where(d < 0, -a, a) - h, np.where(e < 0, b, -b) - k
            fractions.append(_fraction(falling - rising, np.abs(d) + np.abs(e)))
    largest = [reduce(np.maximum, [np.abs(a + fraction * d) - h for a, d, h in lines]) for fraction in fractions]
    smallest: np.ndarray = reduce(np.minimum, largest)
    return smallest


def _fraction(part: Numbers, whole: Numbers) -> Numbers:
    """Return part / whole, clipped to [0, 1], and 0 if the whole is not positive."""
    positive = whole > 0
    with np.errstate(over="ignore", invalid="ignore"):
        fractions = np.where(positive, part / np.where(positive, whole, 1.0), 0.0)
    clipped: np.ndarray = np.clip(fractions, 0.0, 1.0)
    return clipped


def _components(points: np.ndarray) -> Components:
    return list(np.ascontiguousarray(points.T))


def _minus(left: Components, right: Components) -> Components:
    return [a - b for a, b in zip(left, right, strict=True)]


def _dot(left: Components, right: Components) -> Numbers:
    return sum((a * b for a, b in zip(left, right, strict=True)), start=np.zeros(()))


def _cross(left: Components, right: Components) -> Components:
    (a, b, c), (x, y, z) = left, right
    return [b * z - c * y, c * x - a * z, a * y - b * x]


def _length(vector: Components) -> Numbers:
    length: np.ndarray = np.sqrt(_dot(vector, vector))
    return length
