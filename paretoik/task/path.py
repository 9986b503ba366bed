"""A path: where the tool must be at every time, as a continuous function and as samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times, read_only
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.inputs import ArrayLike, check_magnitude, check_size, finite_array, positive_number, shown
from paretoik.robot.pose import quaternion_to_matrix, rotation_vector
from paretoik.tables import html_representation
from paretoik.task.curves import CLOSURE_TOLERANCE, Curve, Line, Rates, SmoothCurve
from paretoik.task.differences import with_midpoints

DIFFERENCE_STEP = 1e-4  # share of the duration, for paths whose curve has no derivatives

Points: TypeAlias = Float[np.ndarray, "time axes"]
Quaternions: TypeAlias = Float[np.ndarray, "time 4"]


@check_call
@dataclass(frozen=True, eq=False, repr=False)
class Path:
    """Where the tool must be over time; made by ``line``, ``circle``, ``waypoints`` or ``poses``.

    ``times`` (time,) [s] start at 0 and increase, evenly or not. ``positions`` (time, 2 or 3) [m] are the samples, with
    unit ``quaternions`` (time, 4), (w, x, y, z) with continued signs, on a path of poses. ``curve`` is the path itself,
    a function of time. The arrays are read-only. Raises InvalidInput where they are those of no path.
    """

    times: Times
    positions: Points
    quaternions: Quaternions | None
    curve: Curve

    def __post_init__(self) -> None:
        times, positions = finite_array("path times", self.times), finite_array("path positions", self.positions)
        if times.ndim != 1 or positions.shape not in ((len(times), 2), (len(times), 3)):
            raise InvalidInput(f"path positions: must be one point for each of the times, got shape {positions.shape}")
        check_instants(times)
        check_magnitude("path times", times[-1], "s", positive=True)
        check_magnitude("path positions", positions, "m")
        quaternions = self.quaternions
        if quaternions is not None:
            quaternions = finite_array("path quaternions", quaternions, (len(times), 4))
        if not callable(self.curve):
            raise InvalidInput(f"path curve: a function of time wanted, got {shown(self.curve)}")
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
        """Whether the path ends where it starts: position within 1e-9 of its extent, orientation within 1e-9 rad."""
        extent = float(np.linalg.norm(np.ptp(self.positions, axis=0)))
        turn = 0.0 if self.quaternions is None else float(rotation_angles(self.quaternions[[0, -1]])[0])
        distance = float(np.linalg.norm(self.positions[-1] - self.positions[0]))
        return distance <= CLOSURE_TOLERANCE * extent and turn <= CLOSURE_TOLERANCE

    def at(self, t: ArrayLike) -> tuple[Float[np.ndarray, "*batch axes"], Float[np.ndarray, "*batch 4"] | None]:
        """Positions (..., 2 or 3) [m] and quaternions (..., 4), None on a path of points, at any times ``t`` (...) [s].

        Raises
        ------
        InvalidInput
            For times outside the path by more than rounding (1e-9 of its duration).
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
        """Velocities and accelerations of the path at times ``t`` (time,) [s], turning about world axes.

        They are exact; if the ``curve`` is a bare function, they are differences of it.

        Raises
        ------
        InvalidInput
            For times outside the path.
        """
        instants = self._instants(t)
        if instants.ndim != 1:
            raise InvalidInput(f"path: times t must be one row of numbers, got shape {instants.shape}")
        return self.curve.rates(instants) if isinstance(self.curve, SmoothCurve) else self._differences(instants)

    def _differences(self, t: Times) -> Rates:
        """Return differences of the path, on one side of times near an end."""
        step = DIFFERENCE_STEP * self.duration
        first = np.select([t < 2 * step, t > self.duration - 2 * step], [0, -4], -2)
        index = first[:, None] + np.arange(5)
        positions, quaternions = self.at(t[:, None] + step * index)
        polynomials = np.linalg.inv(index[..., None] ** np.arange(5.0))  # rows: coefficients of powers of a step
        slopes = polynomials[:, 1:3] * (np.array([1.0, 2.0]) / step ** np.array([1, 2]))[:, None]
        linear = slopes @ positions
        if quaternions is None:
            return Rates(linear[:, 0], linear[:, 1], None, None)
        now = self.at(t)[1]
        assert now is not None
        turned = rotation_vector(quaternion_to_matrix(quaternions) @ quaternion_to_matrix(now)[:, None].mT)
        angular = slopes @ turned
        return Rates(linear[:, 0], linear[:, 1], angular[:, 0], angular[:, 1])

    def _instants(self, t: ArrayLike) -> np.ndarray:
        """Return times as an array, cut off to the path by rounding alone."""
        instants = finite_array("path: time t", t)
        outside = np.flatnonzero(np.abs(instants / self.duration - 0.5) > 0.5 + 1e-9)
        if len(outside):
            raise InvalidInput(f"path: time t: must lie in [0, {self.duration:g}] s, got {instants.flat[outside[0]]:g}")
        return instants.clip(0.0, self.duration)

    def resample(self, samples: int) -> Path:
        """Return the same path with that many samples, evenly spaced in time."""
        return sample_curve(self.curve, even_times(self.duration, samples))

    def with_midpoints(self) -> Path:
        """Return the same path with a sample in the middle of every interval too."""
        return sample_curve(self.curve, with_midpoints(self.times))

    def subsample(self, samples: int) -> Path:
        """Return the same path at that many of its samples: both ends, the others as even as can be.

        Raises InvalidInput for more samples than the path has, or fewer than three.
        """
        if sample_count(samples) > self.samples:
            raise InvalidInput(f"samples: must be at most the path's own {self.samples}, got {shown(samples)}")
        return self._select(np.rint(np.linspace(0, self.samples - 1, samples)).astype(int))

    def truncate(self, samples: int) -> Path:
        """Return the path of the first ``samples`` samples; raises InvalidInput as ``subsample`` does."""
        if sample_count(samples) > self.samples:
            raise InvalidInput(f"samples: must be at most the path's own {self.samples}, got {samples}")
        return self._select(np.arange(samples))

    def standing(self, times: Times, sample: int = 0) -> Path:
        """Return the path of a tool that stays where this one is at a sample, at other times (time,) [s]."""
        instants = finite_array("path times", times)
        if instants.ndim != 1:
            raise InvalidInput(f"path times: must be one row of numbers, got shape {instants.shape}")
        check_size("sample", sample, 0)
        if sample >= len(self.times):
            raise InvalidInput(f"sample must be at most {len(self.times) - 1}, the path's last, got {sample}")
        quaternion = None if self.quaternions is None else self.quaternions[sample]
        start = self.positions[sample]
        return sample_curve(Line(start, np.zeros_like(start), quaternion, np.zeros(3)), instants)

    def _select(self, index: np.ndarray) -> Path:
        quaternions = None if self.quaternions is None else self.quaternions[index]
        return Path(self.times[index], self.positions[index], quaternions, self.curve)


def sample_curve(curve: Curve, times: Times) -> Path:
    """Return a curve with its samples at ``times``, the signs of quaternions continued from one to the next."""
    positions, quaternions = curve(times)
    if quaternions is not None:
        reversals = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0, -1.0, 1.0)
        quaternions[1:] *= np.cumprod(reversals)[:, None]
    return Path(times, positions, quaternions, curve)


def even_times(duration: float, samples: int) -> Times:
    """Return evenly spaced times [s] from 0 to ``duration``; raises InvalidInput for a bad duration or count."""
    return np.linspace(0.0, positive_number("duration", duration, "s"), sample_count(samples))


def sample_count(samples: int) -> int:
    """Return the number of samples of a path; raises InvalidInput for fewer than three."""
    check_size("samples", samples, 3)
    return int(samples)


def check_instants(times: Times) -> None:
    """Raise InvalidInput unless times start at 0 and increase, three at least."""
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
