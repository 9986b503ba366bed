"""A path: the tool's desired position or pose over time, as a function and samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, cast

import numpy as np
from jaxtyping import Float
from scipy.ndimage import maximum_filter1d

from paretoik.arrays import Times, read_only
from paretoik.errors import InvalidInput, warn_user
from paretoik.inputs import (
    ArrayLike,
    check_magnitude,
    check_size,
    finite_array,
    finite_number,
    positive_number,
    shown,
)
from paretoik.robot.pose import Pose, check_pose, quaternion_to_matrix, rotation_vector
from paretoik.tables import html_representation
from paretoik.task.differences import with_midpoints
from paretoik.task.path_shapes import (
    CLOSURE_TOLERANCE,
    Circle,
    Curve,
    Line,
    Rates,
    SmoothCurve,
    TimedCurve,
    interpolate,
)

Points: TypeAlias = Float[np.ndarray, "time axes"]
Quaternions: TypeAlias = Float[np.ndarray, "time 4"]


@dataclass(frozen=True, eq=False, repr=False)
class Path:
    """The tool's desired position or pose over time; made by ``line``, ``circle``, ``waypoints`` or ``poses``.

    curve: function of time, the path itself
    times: sample times (time,) [s] that start at 0 and increase, evenly or not
    positions: samples (time, 2 or 3) [m]
    quaternions: unit quaternions (time, 4), (w, x, y, z) without jumps of sign, or None on a path of points

    The arrays are read-only. Raises InvalidInput if they do not make a path.
    """

    times: Times
    positions: Points
    quaternions: Quaternions | None
    curve: Curve

    def __post_init__(self) -> None:
        times, positions = finite_array("path times", self.times), finite_array("path positions", self.positions)
        if times.ndim != 1 or positions.shape not in ((len(times), 2), (len(times), 3)):
            raise InvalidInput(f"path positions: must be one point per time, got shape {positions.shape}")
        check_instants(times)
        check_magnitude("path times", times[-1], "s", positive=True)
        check_magnitude("path positions", positions, "m")
        quaternions = self.quaternions
        if quaternions is not None:
            quaternions = finite_array("path quaternions", quaternions, (len(times), 4))
        if not callable(self.curve):
            raise InvalidInput(f"path curve must be a function of time, got {shown(self.curve)}")
        for name, values in (("times", times), ("positions", positions), ("quaternions", quaternions)):
            if values is not None:
                object.__setattr__(self, name, read_only(values))

    def __repr__(self) -> str:
        kind = f"{self.positions.shape[1]}-D points" if self.quaternions is None else "poses"
        return f"Path({self.samples} {kind}, {self.duration:g} s)"

    _repr_html_ = html_representation

    @property
    def samples(self) -> int:
        """Number of samples, both ends included."""
        return len(self.times)

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.times[-1])

    @property
    def is_closed(self) -> bool:
        """Whether the path ends at its start, within 1e-9 of its extent and 1e-9 rad."""
        extent = float(np.linalg.norm(np.ptp(self.positions, axis=0)))
        turn = 0.0 if self.quaternions is None else float(rotation_angles(self.quaternions[[0, -1]])[0])
        distance = float(np.linalg.norm(self.positions[-1] - self.positions[0]))
        return distance <= CLOSURE_TOLERANCE * extent and turn <= CLOSURE_TOLERANCE

    def at(self, t: ArrayLike) -> tuple[Float[np.ndarray, "*batch axes"], Float[np.ndarray, "*batch 4"] | None]:
        """Return positions (..., 2 or 3) [m] and quaternions (..., 4), or None, at times t (...) [s].

        Raises InvalidInput for times outside the path by more than rounding (1e-9 of its duration).
        """
        instants = self._instants(t)
        times = instants.ravel()
        positions, quaternions = self.curve(times)
        positions = positions.reshape(*instants.shape, self.positions.shape[1])
        if self.quaternions is None or quaternions is None:
            return positions, None
        later = np.searchsorted(self.times, times).clip(1, self.samples - 1)
        nearest = later - (times - self.times[later - 1] < self.times[later] - times)
        flipped = (quaternions * self.quaternions[nearest]).sum(axis=1) < 0
        return positions, np.where(flipped[:, None], -quaternions, quaternions).reshape(*instants.shape, 4)

    def rates(self, t: Times) -> Rates:
        """Return velocities and accelerations of the path at times t (time,) [s].

        Angular rates are about world axes. Rates are differences if the ``curve`` has no derivatives. Raises
        InvalidInput for times outside the path.
        """
        instants = self._instants(t)
        if instants.ndim != 1:
            raise InvalidInput(f"path: times t must be one row of numbers, got shape {instants.shape}")
        if isinstance(self.curve, SmoothCurve):
            return self.curve.rates(instants)
        # finite differences of the path, one-sided near an end
        step = OPTIONS.difference_step * self.duration
        first = np.select([instants < 2 * step, instants > self.duration - 2 * step], [0, -4], -2)
        index = first[:, None] + np.arange(5)
        positions, quaternions = self.at(instants[:, None] + step * index)
        polynomials = np.linalg.inv(index[..., None] ** np.arange(5.0))  # rows: coefficients of powers of a step
        slopes = polynomials[:, 1:3] * (np.array([1.0, 2.0]) / step ** np.array([1, 2]))[:, None]
        linear = slopes @ positions
        if quaternions is None:
            return Rates(linear[:, 0], linear[:, 1], None, None)
        now = self.at(instants)[1]
        assert now is not None
        turned = rotation_vector(quaternion_to_matrix(quaternions) @ quaternion_to_matrix(now)[:, None].mT)
        angular = slopes @ turned
        return Rates(linear[:, 0], linear[:, 1], angular[:, 0], angular[:, 1])

    def _instants(self, t: ArrayLike) -> np.ndarray:
        """Return times as an array, clipped to the path. Raises InvalidInput for times outside it."""
        instants = finite_array("path: time t", t)
        outside = np.flatnonzero(np.abs(instants / self.duration - 0.5) > 0.5 + 1e-9)
        if len(outside):
            raise InvalidInput(f"path: time t must be in [0, {self.duration:g}] s, got {instants.flat[outside[0]]:g}")
        return instants.clip(0.0, self.duration)

    def resample(self, samples: int) -> Path:
        """Return the same path with this number of samples, evenly spaced in time."""
        return sample_curve(self.curve, even_times(self.duration, samples))

    def with_midpoints(self) -> Path:
        """Return the same path with one sample added at each interval's midpoint."""
        return sample_curve(self.curve, with_midpoints(self.times))

    def subsample(self, samples: int) -> Path:
        """Return the same path at this number of its samples, ends included, as evenly spaced as possible.

        Raises InvalidInput for more samples than the path has, or fewer than three.
        """
        return self._select(np.rint(np.linspace(0, self.samples - 1, self._count_among(samples))).astype(int))

    def truncate(self, samples: int) -> Path:
        """Return the path of the first ``samples`` samples. Raises InvalidInput as ``subsample`` does."""
        return self._select(np.arange(self._count_among(samples)))

    def standing(self, times: Times, sample: int = 0) -> Path:
        """Return the path of a tool that rests at a sample's position or pose.

        times: sample times (time,) [s] of the new path
        sample: index of the sample
        """
        instants = finite_array("path times", times)
        if instants.ndim != 1:
            raise InvalidInput(f"path times: must be one row of numbers, got shape {instants.shape}")
        check_size("sample", sample, 0)
        if sample >= len(self.times):
            raise InvalidInput(f"sample must be at most {len(self.times) - 1}, the path's last, got {sample}")
        quaternion = None if self.quaternions is None else self.quaternions[sample]
        start = self.positions[sample]
        return sample_curve(Line(start, np.zeros_like(start), quaternion, np.zeros(3)), instants)

    def _count_among(self, samples: int) -> int:
        if sample_count(samples) > self.samples:
            raise InvalidInput(f"samples must be at most {self.samples}, as the path has, got {shown(samples)}")
        return int(samples)

    def _select(self, index: np.ndarray) -> Path:
        quaternions = None if self.quaternions is None else self.quaternions[index]
        return Path(self.times[index], self.positions[index], quaternions, self.curve)


def sample_curve(curve: Curve, times: Times) -> Path:
    """Return the path of a curve with samples at ``times``. Quaternions have no jumps of sign."""
    positions, quaternions = curve(times)
    if quaternions is not None:
        reversals = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0, -1.0, 1.0)
        quaternions[1:] *= np.cumprod(reversals)[:, None]
    return Path(times, positions, quaternions, curve)


def even_times(duration: float, samples: int) -> Times:
    """Return evenly spaced times [s] from 0 to ``duration``. Raises InvalidInput."""
    return np.linspace(0.0, positive_number("duration", duration, "s"), sample_count(samples))


def sample_count(samples: int) -> int:
    """Return the number of samples of a path. Raises InvalidInput for fewer than three samples."""
    check_size("samples", samples, 3)
    return int(samples)


def check_instants(times: Times) -> None:
    """Raise InvalidInput unless three or more times increase from 0."""
    sample_count(len(times))
    if times[0] != 0:
        raise InvalidInput(f"path times: must start at 0 s, got {times[0]:g}")
    decreasing = np.flatnonzero(np.diff(times) <= 0)
    if len(decreasing):
        k = int(decreasing[0]) + 1
        raise InvalidInput(f"path times: must increase, got {times[k]:g} after {times[k - 1]:g} at index {k}")


def rotation_angles(quaternions: np.ndarray) -> np.ndarray:
    """Return the angles [rad] between each orientation and the next."""
    matrices = quaternion_to_matrix(quaternions)
    angles: np.ndarray = np.linalg.norm(rotation_vector(np.swapaxes(matrices[:-1], -1, -2) @ matrices[1:]), axis=-1)
    return angles


# Constructors of paths.


@dataclass(frozen=True, kw_only=True)
class PathOptions:
    """Bounds of paths, and thresholds of warnings about taught points."""

    difference_step: float = 1e-4  # share of the duration, for paths whose curve has no derivatives
    most_turns: float = 1e6  # turns of a circle; positions are then exact to 1e-9 of the radius
    near: float = 0.01  # share of the neighbouring distances: a smaller distance gives a warning
    around: int = 3  # number of neighbouring distances before and after
    turned: float = 1e-3  # rad: largest turn between near points
    backwards: float = 0.01  # share of the points' median distance: a longer backward motion gives a warning
    overshoot: float = 0.25  # share of the shorter step at a corner of more than 90°: backward motion without warning
    pieces: int = 32  # number of pieces of the curve between two points


OPTIONS = PathOptions()


def line(
    start: Pose | ArrayLike,
    end: Pose | ArrayLike,
    *,
    duration: float,
    samples: int = 101,
    timing: str = "raised-cosine",
) -> Path:
    """Return a straight path between two points or two poses.

    start, end: points (2,) or (3,) [m], or poses
    duration: time from start to end [s]
    samples: number of samples, at least 3
    timing: time law, "raised-cosine", "quintic" or "uniform"

    Between poses the orientation follows the geodesic by the same law. Raises InvalidInput for ends of different kinds,
    equal ends, a bad duration, fewer than 3 samples, or an unknown time law.

    >>> path = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0)
    >>> path
    Path(101 2-D points, 1 s)
    >>> path.at(0.5)[0].round(5)
    array([0.28305, 0.0763 ])
    """
    times = even_times(duration, samples)
    if isinstance(start, Pose) and isinstance(end, Pose):
        check_pose("line start", start)
        check_pose("line end", end)
        rotation = rotation_vector(start.rotation.T @ end.rotation)
        shape = Line(start.position, end.position - start.position, start.quaternion, rotation)
    elif isinstance(start, Pose) or isinstance(end, Pose):
        raise InvalidInput("line: start and end must both be poses or both be points, got one of each")
    else:
        origin, goal = _point("line start", start), _point("line end", end)
        if len(origin) != len(goal):
            raise InvalidInput(f"line: start and end must both be 2-D or 3-D, got {len(origin)}-D and {len(goal)}-D")
        shape = Line(origin, goal - origin, None, np.zeros(3))
    length = CLOSURE_TOLERANCE * np.linalg.norm(shape.origin)  # rounding error
    if np.linalg.norm(shape.step) <= length and np.linalg.norm(shape.rotation_vector) <= CLOSURE_TOLERANCE:
        raise InvalidInput(f"line: start and end must differ, got both at {shape.origin.tolist()}")
    return sample_curve(TimedCurve(shape, times[-1], timing), times)


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
    """Return a circular path.

    center: point (2,) or (3,) [m] for a path of points; pose for a path of poses in its own xy-plane and orientation
    radius: radius [m]
    duration: time from start to end [s]
    samples: number of samples, at least 3
    start_angle: angle [rad] from +x in the circle's plane (from +y if the normal is along x; from the pose's own x)
    turns: number of turns, a fraction for an arc, negative for clockwise
    timing: time law, as for ``line``
    normal: direction (3,) that a 3-D circle turns about, None for +z

    Raises InvalidInput for a radius that is not positive, no turns, a zero normal or one without a 3-D point, and as
    ``line`` does.

    >>> circle([0.5, 0.0], 0.1, duration=2.0, start_angle=np.pi).positions[0].round(12)
    array([0.4, 0. ])
    """
    times = even_times(duration, samples)
    radius = positive_number("circle radius", radius, "m")
    number = finite_number("circle turns", turns)
    if not 0 < abs(number) <= OPTIONS.most_turns:
        raise InvalidInput(f"circle |turns| must be above 0 and at most {OPTIONS.most_turns:g}, got {number:g}")
    phase, orientation, fact = finite_number("circle start_angle", start_angle), None, ""
    if isinstance(center, Pose):
        check_pose("circle center", center)
        origin, axes, orientation = center.position, center.rotation.T[:2], center.quaternion
        fact = "a pose, which has its own plane"
    elif len(origin := _point("circle center", center)) == 2:
        axes, fact = np.eye(2), "a 2-D point"
    else:
        # x and y of the circle's plane
        direction = finite_array("circle normal", (0.0, 0.0, 1.0) if normal is None else normal, shape=(3,))
        length = float(np.linalg.norm(direction))
        if length == 0:
            raise InvalidInput("circle normal: must not be zero, got 0 0 0")
        direction /= length
        first = np.eye(3)[1 if np.abs(direction[0]) > 1 - 1e-9 else 0]  # x, or y if the normal is along x
        first = first - direction * (first @ direction)
        first /= np.linalg.norm(first)
        axes = np.stack([first, np.cross(direction, first)])
    if normal is not None and fact:
        raise InvalidInput(f"circle normal: must be None unless the center is a 3-D point, got a normal and {fact}")
    shape = Circle(origin, radius * axes, phase, 2 * np.pi * number, orientation)
    return sample_curve(TimedCurve(shape, times[-1], timing), times)


def waypoints(
    points: Sequence[Pose] | Pose | ArrayLike,
    *,
    duration: float,
    samples: int = 101,
    timing: str = "raised-cosine",
) -> Path:
    """Return a smooth path through points or poses.

    points: array (n, 2 or 3) [m], or a sequence of poses
    duration: time from the first to the last point [s]
    samples: number of samples, at least 3, evenly spaced in time; in general only the first and last are at points
    timing: time law of the chord length covered, as for ``line``

    The path is a C² cubic spline over the chord length between the points (over the angle if poses only turn), periodic
    if the last point equals the first, with SciPy's ``RotationSpline`` for orientations. Raises InvalidInput for fewer
    than 2 points, two equal points in a row (with the index), and as ``line`` does.

    >>> path = waypoints([[0, 0], [1, 1], [2, 0]], duration=1.0)
    >>> path.at(0.5)[0].round(12)
    array([1., 1.])
    """
    times = even_times(duration, samples)
    positions, quaternions = _points_or_poses("waypoints: points", points)
    if len(positions) < 2:
        raise InvalidInput(f"waypoints: must be at least 2, got {len(positions)}")
    lengths = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    shortest = CLOSURE_TOLERANCE * np.linalg.norm(positions, axis=1).max()
    if quaternions is not None and lengths.max() <= shortest:
        lengths, shortest = rotation_angles(quaternions), CLOSURE_TOLERANCE
    repeated = np.flatnonzero(lengths <= shortest)
    if len(repeated):
        first = int(repeated[0])
        raise InvalidInput(f"waypoints: must differ from one to the next, got the same for {first} and {first + 1}")
    knots = np.concatenate([[0.0], np.cumsum(lengths) / lengths.sum()])
    knots[-1] = 1.0
    curve = interpolate(knots, positions, quaternions)
    _warn_of_taught_points("waypoints: points", curve, knots, positions, quaternions)
    return sample_curve(TimedCurve(curve, times[-1], timing), times)


def poses(times: ArrayLike, poses: Sequence[Pose] | Pose | ArrayLike) -> Path:
    """Return a path through poses or points at given times.

    times: sample times (time,) [s] that start at 0 and increase
    poses: a sequence of poses, or points (time, 2 or 3) [m]

    The path is a C² cubic spline, periodic if the last position equals the first, with SciPy's ``RotationSpline`` for
    orientations. Raises InvalidInput for times that do not increase (with the index) or do not start at 0, fewer than
    3, or a number other than that of the poses.

    >>> poses([0.0, 0.2, 1.0], [[0.5, 0.0], [0.5, 0.1], [0.5, 0.3]]).at(0.2)[0].round(12)
    array([0.5, 0.1])
    """
    instants = finite_array("path times", times)
    if instants.ndim != 1:
        raise InvalidInput(f"path times: must be one row of numbers, got shape {instants.shape}")
    positions, quaternions = _points_or_poses("poses", poses)
    if len(instants) != len(positions):
        raise InvalidInput(f"poses: must be one for each time, got {len(positions)} for {len(instants)} times")
    check_instants(instants)
    curve = interpolate(instants, positions, quaternions)
    _warn_of_taught_points("poses: samples", curve, instants, positions, quaternions)
    return sample_curve(curve, instants)


def _warn_of_taught_points(
    name: str,
    curve: SmoothCurve,
    knots: Times,
    positions: Float[np.ndarray, "points axes"],
    quaternions: Float[np.ndarray, "points 4"] | None,
) -> None:
    """Warn of points much nearer than their neighbours, and of curves that run backwards.

    A curve runs backwards if it moves against the step between points, or away from them if this step is 0.
    """
    steps = np.diff(positions, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    around = maximum_filter1d(lengths, 2 * OPTIONS.around + 1, mode="nearest")
    near = (lengths < OPTIONS.near * around) & (lengths > CLOSURE_TOLERANCE * np.linalg.norm(positions, axis=1).max())
    if quaternions is not None:
        near &= rotation_angles(quaternions) < OPTIONS.turned
    if near.any():
        k = int(np.argmin(np.where(near, lengths / np.maximum(around, 1e-300), np.inf)))
        warn_user(
            f"{name} {k} and {k + 1} are only {lengths[k]:.3g} m apart, their neighbours {around[k]:.3g} m: one may "
            "have been taught twice; leave it out"
        )
    places = knots[:-1, None] + np.diff(knots)[:, None] * np.linspace(0.0, 1.0, OPTIONS.pieces + 1)
    away = curve(places.ravel())[0].reshape(*places.shape, -1) - positions[:-1, None]
    unit = steps / np.where(lengths > 0, lengths, 1.0)[:, None]
    progress = np.where(lengths[:, None] > 0, np.einsum("kpa,ka->kp", away, unit), -np.linalg.norm(away, axis=2))
    backwards = (np.maximum.accumulate(progress, axis=1) - progress).max(axis=1)
    sharp = np.pad((steps[1:] * steps[:-1]).sum(axis=1) < 0, 1)  # corners, which any smooth curve overshoots
    shorter = np.pad(np.minimum(lengths[1:], lengths[:-1]), 1)
    overshoot = OPTIONS.overshoot * np.where(sharp, shorter, 0.0)
    excess = backwards - np.maximum(overshoot[:-1], overshoot[1:])
    k = int(np.argmax(excess))
    if excess[k] > OPTIONS.backwards * np.median(lengths):
        warn_user(
            f"{name} {k} and {k + 1}: the curve runs {backwards[k]:.3g} m backwards between them; add points there, or "
            "choose times that fit the distances"
        )


def _point(name: str, value: ArrayLike) -> np.ndarray:
    point = finite_array(name, value)
    if point.shape not in ((2,), (3,)):
        raise InvalidInput(f"{name}: must be a 2-D or 3-D point, got shape {point.shape}")
    check_magnitude(name, point, "m")
    return point


def _points_or_poses(name: str, values: Sequence[Pose] | Pose | ArrayLike) -> tuple[np.ndarray, np.ndarray | None]:
    if isinstance(values, Pose) and values.position.ndim == 2:
        return values.position.copy(), values.quaternion.copy()
    poses = [value for value in values if isinstance(value, Pose)] if isinstance(values, Sequence) else []
    if isinstance(values, Sequence) and poses:
        if len(poses) < len(values):
            first = next(i for i, value in enumerate(values) if not isinstance(value, Pose))
            raise InvalidInput(f"{name}: must be all poses or all points, got no pose at index {first}")
        for pose in poses:
            check_pose(name, pose)
        return np.stack([pose.position for pose in poses]), np.stack([pose.quaternion for pose in poses])
    points = finite_array(name, cast(ArrayLike, values))
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InvalidInput(f"{name}: must be poses or an array of points (n, 2) or (n, 3), got shape {points.shape}")
    check_magnitude(name, points, "m")
    return points, None
