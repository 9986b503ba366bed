"""Curves: what a path is between its samples, as data that can be called and pickled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Quaternion, Times, Vector3
from paretoik.robot.pose import quaternion_product, vector_to_quaternion
from paretoik.task.timing import progress

Places: TypeAlias = tuple[Float[np.ndarray, "time axes"], Float[np.ndarray, "time 4"] | None]
Curve: TypeAlias = Callable[[np.ndarray], Places]

SAME_PLACE = 1e-9  # m or rad: two ends of a path that are nearer than this are one


@dataclass(frozen=True, eq=False)
class Timed:
    """A ``shape``, which is a curve over the share covered (0 to 1), run through in ``duration`` [s] by a time law."""

    shape: Curve
    duration: float
    law: str

    def __call__(self, times: Times) -> Places:
        """Return positions and orientations at times [s]."""
        return self.shape(progress(times, self.duration, self.law))


@dataclass(frozen=True, eq=False)
class Line:
    """From ``origin`` by ``step`` [m], turning from ``quaternion``, if there is one, by the vector ``turn`` [rad]."""

    origin: Float[np.ndarray, " axes"]
    step: Float[np.ndarray, " axes"]
    quaternion: Quaternion | None
    turn: Vector3

    def __call__(self, shares: Times) -> Places:
        """Return positions and orientations at shares of the way, 0 to 1."""
        share = shares[:, None]
        places = self.origin + share * self.step
        if self.quaternion is None:
            return places, None
        return places, quaternion_product(self.quaternion, vector_to_quaternion(share * self.turn))


@dataclass(frozen=True, eq=False)
class Circle:
    """About ``center``, from the angle ``phase`` on by ``sweep`` [rad]; ``spokes`` lead to the angles 0 and π/2 [m]."""

    center: Float[np.ndarray, " axes"]
    spokes: Float[np.ndarray, "2 axes"]
    phase: float
    sweep: float
    quaternion: Quaternion | None

    def __call__(self, shares: Times) -> Places:
        """Return positions and orientations at shares of the way, 0 to 1."""
        angles = self.phase + self.sweep * shares
        places = self.center + np.stack([np.cos(angles), np.sin(angles)], axis=1) @ self.spokes
        return places, None if self.quaternion is None else np.tile(self.quaternion, (len(shares), 1))


@dataclass(frozen=True, eq=False)
class Spline:
    """SciPy's ``CubicSpline`` of positions, and ``RotationSpline`` of orientations or None, over the same knots."""

    positions: Any
    rotations: Any

    def __call__(self, knots: Times) -> Places:
        """Return positions and orientations at parameters within the knots."""
        places = self.positions(knots)
        return places, None if self.rotations is None else np.roll(self.rotations(knots).as_quat(), 1, axis=1)


def through(
    knots: Times, positions: Float[np.ndarray, "time axes"], quaternions: Float[np.ndarray, "time 4"] | None
) -> Spline:
    """Return the C² spline through positions and orientations at the knots, periodic in position if the ends meet."""
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import Rotation, RotationSpline

    closed = np.linalg.norm(positions[-1] - positions[0]) <= SAME_PLACE
    if closed:
        positions = np.concatenate([positions[:-1], positions[:1]])
    places = CubicSpline(knots, positions, bc_type="periodic" if closed else "not-a-knot")
    if quaternions is None:
        return Spline(places, None)
    return Spline(places, RotationSpline(knots, Rotation.from_quat(np.roll(quaternions, -1, axis=1))))
