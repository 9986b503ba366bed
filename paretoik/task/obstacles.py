"""Obstacles: convex shapes in the plane and in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Vector3
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.inputs import ArrayLike, check_magnitude, finite_array, positive_number
from paretoik.robot.pose import Pose, check_pose
from paretoik.tables import field_representation, html_representation


@check_call
@dataclass(frozen=True, init=False, eq=False)
class Circle:
    """A disc in the xy-plane, ``center`` (2,) and ``radius`` [m]; in space an infinite cylinder along z."""

    center: Float[np.ndarray, " 2"]
    radius: float

    __repr__ = field_representation
    _repr_html_ = html_representation

    def __init__(self, center: ArrayLike, radius: float) -> None:
        _freeze(
            self,
            center=_point("circle center", center, 2),
            radius=positive_number("circle radius", radius, "m"),
        )


@check_call
@dataclass(frozen=True, init=False, eq=False)
class Sphere:
    """A ball, ``center`` (3,) and ``radius`` [m]."""

    center: Vector3
    radius: float

    __repr__ = field_representation
    _repr_html_ = html_representation

    def __init__(self, center: ArrayLike, radius: float) -> None:
        _freeze(
            self,
            center=_point("sphere center", center, 3),
            radius=positive_number("sphere radius", radius, "m"),
        )


@check_call
@dataclass(frozen=True, init=False, eq=False)
class Capsule:
    """The points within ``radius`` of the segment from ``start`` (3,) to ``end`` (3,) [m], which may be one point."""

    start: Vector3
    end: Vector3
    radius: float

    __repr__ = field_representation
    _repr_html_ = html_representation

    def __init__(self, start: ArrayLike, end: ArrayLike, radius: float) -> None:
        first = _point("capsule start", start, 3)
        last = _point("capsule end", end, 3)
        _freeze(self, start=first, end=last, radius=positive_number("capsule radius", radius, "m"))


@check_call
@dataclass(frozen=True, init=False, eq=False)
class Box:
    """A box about ``center``, a point or, if it is rotated, a pose; ``half_sizes`` [m] along its own axes.

    Three half sizes make a box in space. Two make a rectangle in its own xy-plane, in space an infinite beam along its
    own z; its center is then a 2-D point or a pose (``Pose.planar``). Raises InvalidInput for other sizes and centers.
    """

    pose: Pose
    half_sizes: Float[np.ndarray, " axes"]

    __repr__ = field_representation
    _repr_html_ = html_representation

    def __init__(self, center: Pose | ArrayLike, half_sizes: ArrayLike) -> None:
        sizes = finite_array("box half_sizes", half_sizes)
        if sizes.shape not in ((2,), (3,)):
            raise InvalidInput(f"box half_sizes: must be 2 or 3, got shape {sizes.shape}")
        if sizes.min() <= 0:
            raise InvalidInput(f"box half_sizes: must be positive, got {sizes.min():g} m at index {sizes.argmin()}")
        if not isinstance(center, Pose):
            point = _point("box center", center, len(sizes))
            center = Pose(np.pad(point, (0, 3 - len(point))))
        check_pose("box center", center)
        _freeze(self, pose=center, half_sizes=sizes)


Obstacle: TypeAlias = Circle | Sphere | Capsule | Box


def _point(name: str, coordinates: ArrayLike, size: int) -> Float[np.ndarray, " size"]:
    point = finite_array(name, coordinates, shape=(size,))
    check_magnitude(name, point, "m")
    return point


def _freeze(obstacle: object, **fields: object) -> None:
    for name, value in fields.items():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(obstacle, name, value)
