"""Paths: where the tool must be at every time, a continuous function and the samples that motions are computed at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import index
from typing import TypeAlias, cast

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times
from paretoik.errors import InvalidInput
from paretoik.robot.pose import (
    ArrayLike,
    Pose,
    finite_array,
    quaternion_to_matrix,
    rotation_vector,
)
from paretoik.task.curves import SAME_PLACE, Circle, Curve, Line, Timed, through
from paretoik.task.timing import known_law

Points: TypeAlias = Float[np.ndarray, "time axes"]
Quaternions: TypeAlias = Float[np.ndarray, "time 4"]

FEWEST_SAMPLES = 3


@dataclass(frozen=True, eq=False, repr=False)
class Path:
    """Where the tool must be over time; made by ``line``, ``circle``, ``waypoints`` or ``poses``.

    ``times`` (time,) [s] start at 0 and increase, evenly or not. ``positions`` (time, 2 or 3) [m] are the samples, with
    unit ``quaternions`` (time, 4), (w, x, y, z) with continued signs, on a path of poses. ``curve`` is the path itself,
    a function of time. The arrays are read-only.
    """

    times: Times
    positions: Points
    quaternions: Quaternions | None
    curve: Curve

    def __post_init__(self) -> None:
        for values in (self.times, self.positions, self.quaternions):
            if values is not None:
                values.setflags(write=False)

    def __repr__(self) -> str:
        kind = f"{self.positions.shape[1]}-D points" if self.quaternions is None else "poses"
        return f"Path({self.samples} {kind}, {self.duration:g} s)"

    @property
    def samples(self) -> int:
        """Number of samples, both ends included."""
        return len(self.times)

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.times[-1])

    @property
    def closed(self) -> bool:
        """Whether the path ends where it began: the same place within 1e-9 m and orientation within 1e-9 rad."""
        apart = float(np.linalg.norm(self.positions[-1] - self.positions[0]))
        if self.quaternions is not None:
            apart = max(apart, float(_turns(self.quaternions[[0, -1]])[0]))
        return apart <= SAME_PLACE

    def at(self, t: ArrayLike) -> tuple[Float[np.ndarray, "*batch axes"], Float[np.ndarray, "*batch 4"] | None]:
        """Positions (..., 2 or 3) [m] and quaternions (..., 4), None on a path of points, at any times ``t`` (...) [s].

        Raises
        ------
        InvalidInput
            For times outside the path by more than rounding (1e-9 of its duration).
        """
        wanted = finite_array("time on the path", t)
        outside = np.flatnonzero(np.abs(wanted / self.duration - 0.5) > 0.5 + 1e-9)
        if len(outside):
            raise InvalidInput(
                f"time on the path: must lie in [0, {self.duration:g}] s, got {wanted.flat[outside[0]]:g}"
            )
        times = wanted.clip(0.0, self.duration).ravel()
        positions, quaternions = self.curve(times)
        positions = positions.reshape(*wanted.shape, -1)
        if self.quaternions is None or quaternions is None:
            return positions, None
        later = np.searchsorted(self.times, times).clip(1, self.samples - 1)
        nearest = later - (times - self.times[later - 1] < self.times[later] - times)
        flipped = (quaternions * self.quaternions[nearest]).sum(axis=1) < 0
        return positions, np.where(flipped[:, None], -quaternions, quaternions).reshape(*wanted.shape, 4)

    def resampled(self, samples: int) -> Path:
        """Return the same path with that many samples, evenly spaced in time."""
        return _sampled(self.curve, _even_times(self.duration, samples))

    def subsampled(self, samples: int) -> Path:
        """Return the same path with so many of its samples: both ends, and others spread as evenly as they allow.

        Raises InvalidInput for more samples than the path has, or fewer than three.
        """
        if _count(samples) > self.samples:
            raise InvalidInput(f"samples: must be at most the path's own {self.samples}, got {samples}")
        return self._of(np.rint(np.linspace(0, self.samples - 1, samples)).astype(int))

    def until(self, samples: int) -> Path:
        """Return the first so many samples of the path; raises InvalidInput as ``subsampled`` does."""
        if _count(samples) > self.samples:
            raise InvalidInput(f"samples: must be at most the path's own {self.samples}, got {samples}")
        return self._of(np.arange(samples))

    def _of(self, kept: np.ndarray) -> Path:
        quaternions = None if self.quaternions is None else self.quaternions[kept]
        return Path(self.times[kept], self.positions[kept], quaternions, self.curve)


def line(
    start: Pose | ArrayLike,
    end: Pose | ArrayLike,
    *,
    duration: float,
    samples: int = 101,
    timing: str = "raised-cosine",
) -> Path:
    """Straight path between two points (2-D or 3-D) [m], or two poses, in ``duration`` [s] by a time law.

    Between poses the orientation turns at the same law about one axis, by at most half a turn (the geodesic).

    Raises
    ------
    InvalidInput
        For ends of different kinds or at the same place, a bad duration, fewer than 3 samples, an unknown time law.

    >>> path = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0)
    >>> path
    Path(101 2-D points, 1 s)
    >>> path.at(0.5)[0].round(5)
    array([0.28305, 0.0763 ])
    """
    times = _even_times(duration, samples)
    if isinstance(start, Pose) and isinstance(end, Pose):
        turn = rotation_vector(start.rotation.T @ end.rotation)
        shape = Line(start.position, end.position - start.position, start.quaternion, turn)
    elif isinstance(start, Pose) or isinstance(end, Pose):
        raise InvalidInput("line: start and end must both be poses or both be points, got one of each")
    else:
        origin, goal = _point("line start", start), _point("line end", end)
        if len(origin) != len(goal):
            raise InvalidInput(f"line: start and end must both be 2-D or 3-D, got {len(origin)}-D and {len(goal)}-D")
        shape = Line(origin, goal - origin, None, np.zeros(3))
    if max(np.linalg.norm(shape.step), np.linalg.norm(shape.turn)) <= SAME_PLACE:
        raise InvalidInput(f"line: must have a length, but start and end are both {shape.origin.tolist()}")
    return _sampled(Timed(shape, float(duration), known_law(timing)), times)


def circle(
    center: Pose | ArrayLike,
    radius: float,
    *,
    duration: float,
    samples: int = 101,
    start_angle: float = 0.0,
    turns: float = 1,
    timing: str = "raised-cosine",
    normal: ArrayLike | None = None,
) -> Path:
    """Circle of ``radius`` [m] about ``center``, ``turns`` times round in ``duration`` [s] (a part of 1 is an arc).

    A 2-D or 3-D ``center`` gives a path of points; a 3-D circle goes round counter-clockwise about ``normal`` (default
    +z) and counts ``start_angle`` [rad] from the direction of +x in its plane (of +y where the normal is along x). A
    pose gives a path of poses: a circle in the pose's own xy-plane, counted from its own x, all in the pose's
    orientation. Negative ``turns`` go the other way round.

    Raises
    ------
    InvalidInput
        For a radius that is not positive, no turns, a zero normal or one with nothing to do, and as ``line`` does.

    >>> circle([0.5, 0.0], 0.1, duration=2.0, start_angle=np.pi).positions[0].round(12)
    array([0.4, 0. ])
    """
    times = _even_times(duration, samples)
    size = _positive("circle radius", radius, "m")
    sweep = 2 * np.pi * float(finite_array("circle turns", turns, shape=()))
    if sweep == 0:
        raise InvalidInput("circle turns: must not be 0")
    phase = float(finite_array("circle start_angle", start_angle, shape=()))
    place = center.position if isinstance(center, Pose) else _point("circle center", center)
    if isinstance(center, Pose):
        axes = center.rotation.T[:2]
    elif len(place) == 2:
        axes = np.eye(2)
    else:
        axes = _plane_axes((0.0, 0.0, 1.0) if normal is None else normal)
    if normal is not None and (isinstance(center, Pose) or len(place) == 2):
        raise InvalidInput("circle normal: only goes with a 3-D point as center; a pose has its own plane, 2-D has one")
    orientation = center.quaternion if isinstance(center, Pose) else None
    shape = Circle(place, size * axes, phase, sweep, orientation)
    return _sampled(Timed(shape, float(duration), known_law(timing)), times)


def waypoints(
    points: Sequence[Pose] | ArrayLike,
    *,
    duration: float,
    samples: int = 101,
    timing: str = "raised-cosine",
) -> Path:
    """Smooth path through all ``points``: an array (n, 2 or 3) [m] or a sequence of poses, in ``duration`` [s].

    A C² cubic spline over the chord length between the points (over the angle between them where poses only turn),
    periodic if the last point is the first again, with SciPy's ``RotationSpline`` for orientations. ``timing`` governs
    the chord length covered. The samples are even in time, so in general none falls on a point between the ends.

    Raises
    ------
    InvalidInput
        For fewer than 2 points, one that is where the last one was (with its index), and as ``line`` does.

    >>> path = waypoints([[0, 0], [1, 1], [2, 0]], duration=1.0)
    >>> path.at(0.5)[0].round(12)
    array([1., 1.])
    """
    times = _even_times(duration, samples)
    positions, quaternions = _points_or_poses("waypoints", points)
    if len(positions) < 2:
        raise InvalidInput(f"waypoints: must be at least 2, got {len(positions)}")
    gaps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    if quaternions is not None and gaps.max() <= SAME_PLACE:
        gaps = _turns(quaternions)
    repeated = np.flatnonzero(gaps <= SAME_PLACE)
    if len(repeated):
        first = int(repeated[0])
        raise InvalidInput(f"waypoints: must differ from one to the next, but {first} and {first + 1} are the same")
    knots = np.concatenate([[0.0], np.cumsum(gaps) / gaps.sum()])
    knots[-1] = 1.0
    return _sampled(Timed(through(knots, positions, quaternions), float(duration), known_law(timing)), times)


def poses(times: ArrayLike, poses: Sequence[Pose] | ArrayLike) -> Path:
    """Path through ``poses`` at ``times`` [s]: a sequence of poses, or an array of points (time, 2 or 3) [m].

    The given times, which start at 0, are the samples. Between them runs a C² cubic spline, periodic if the last
    position is the first again, with SciPy's ``RotationSpline`` for orientations.

    Raises
    ------
    InvalidInput
        For times that do not increase (with the index) or start at 0, fewer than 3, or more or fewer than the poses.

    >>> poses([0.0, 0.2, 1.0], [[0.5, 0.0], [0.5, 0.1], [0.5, 0.3]]).at(0.2)[0].round(12)
    array([0.5, 0.1])
    """
    instants = finite_array("path times", times)
    if instants.ndim != 1:
        raise InvalidInput(f"path times: must be one row of numbers, got shape {instants.shape}")
    positions, quaternions = _points_or_poses("poses", poses)
    if len(instants) != len(positions):
        raise InvalidInput(f"poses: must be one for each time, got {len(positions)} for {len(instants)} times")
    _count(len(instants))
    if instants[0] != 0:
        raise InvalidInput(f"path times: must start at 0 s, got {instants[0]:g}")
    late = np.flatnonzero(np.diff(instants) <= 0)
    if len(late):
        k = int(late[0]) + 1
        raise InvalidInput(f"path times: must increase, got {instants[k]:g} after {instants[k - 1]:g} at index {k}")
    return _sampled(through(instants, positions, quaternions), instants)


def _sampled(curve: Curve, times: Times) -> Path:
    positions, quaternions = curve(times)
    if quaternions is not None:
        reversals = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0, -1.0, 1.0)
        quaternions[1:] *= np.cumprod(reversals)[:, None]
    return Path(times, positions, quaternions, curve)


def _even_times(duration: float, samples: int) -> Times:
    return np.linspace(0.0, _positive("duration", duration, "s"), _count(samples))


def _count(samples: int) -> int:
    try:
        count = index(samples)
    except TypeError:
        raise InvalidInput(f"samples: must be a whole number, got {samples!r}") from None
    if count < FEWEST_SAMPLES:
        raise InvalidInput(f"samples: must be at least {FEWEST_SAMPLES}, got {count}")
    return count


def _positive(name: str, value: float, unit: str) -> float:
    size = float(finite_array(name, value, shape=()))
    if size <= 0:
        raise InvalidInput(f"{name}: must be positive, got {size:g} {unit}")
    return size


def _point(name: str, value: ArrayLike) -> np.ndarray:
    point = finite_array(name, value)
    if point.shape not in ((2,), (3,)):
        raise InvalidInput(f"{name}: must be a 2-D or 3-D point, got shape {point.shape}")
    return point


def _points_or_poses(name: str, given: Sequence[Pose] | ArrayLike) -> tuple[np.ndarray, np.ndarray | None]:
    found = [member for member in given if isinstance(member, Pose)] if isinstance(given, Sequence) else []
    if isinstance(given, Sequence) and found:
        if len(found) < len(given):
            stray = next(i for i, member in enumerate(given) if not isinstance(member, Pose))
            raise InvalidInput(f"{name}: must be all poses or all points, but index {stray} is no pose")
        return np.stack([pose.position for pose in found]), np.stack([pose.quaternion for pose in found])
    points = finite_array(name, cast(ArrayLike, given))
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InvalidInput(f"{name}: must be poses or an array of points (n, 2) or (n, 3), got shape {points.shape}")
    return points, None


def _plane_axes(normal: ArrayLike) -> Float[np.ndarray, "2 3"]:
    direction = finite_array("circle normal", normal, shape=(3,))
    length = float(np.linalg.norm(direction))
    if length == 0:
        raise InvalidInput("circle normal: must not be zero")
    direction /= length
    along_x = np.abs(direction[0]) > 1 - 1e-9
    first = np.eye(3)[1 if along_x else 0]
    first = first - direction * (first @ direction)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)])


def _turns(quaternions: np.ndarray) -> np.ndarray:
    """Angles [rad] between one orientation and the next."""
    matrices = quaternion_to_matrix(quaternions)
    turns: np.ndarray = np.linalg.norm(rotation_vector(np.swapaxes(matrices[:-1], -1, -2) @ matrices[1:]), axis=-1)
    return turns
