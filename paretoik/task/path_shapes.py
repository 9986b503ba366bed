"""Curves: paths as continuous functions of time, which can be pickled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Quaternion, Times, Vector3
from paretoik.inputs import check_choice
from paretoik.robot.pose import quaternion_product, quaternion_to_matrix, vector_to_quaternion

# Time laws: the fraction of the path covered at each time.


TIME_LAWS = ("raised-cosine", "quintic", "uniform")


def progress(t: Float[np.ndarray, "*batch"], duration: float, law: str) -> Float[np.ndarray, "*batch"]:
    """Return the fraction of the path covered at times ``t`` [s].

    Times are in [0, duration]. The fraction is exactly 0 at the start and exactly 1 at the end.

    - ``"raised-cosine"``: the first half accelerates with (4/T²)(1 - cos(4πt/T)), the second brakes likewise;
      acceleration and jerk are continuous and zero at 0, T/2 and T; peak speed 2/T, peak acceleration 8/T². Tringali
      and Cocuzza (2020), Eq. 19 with the factor ½ that is missing there; (2021), Eq. 5.
    - ``"quintic"``: 10τ³ - 15τ⁴ + 6τ⁵ with τ = t/T, the least squared jerk from rest to rest; peak speed 15/(8T).
    - ``"uniform"``: τ.

    >>> progress(np.array([0.0, 0.5, 1.0, 2.0]), duration=2.0, law="quintic").round(6)
    array([0.      , 0.103516, 0.5     , 1.      ])
    """
    fraction = np.asarray(t, dtype=float) / duration
    if law == "uniform":
        return fraction
    from_nearer_end = np.minimum(fraction, 1 - fraction)  # s(1 - τ) = 1 - s(τ) for both laws, exact at both ends
    if law == "quintic":
        half = from_nearer_end**3 * (10 + from_nearer_end * (6 * from_nearer_end - 15))
    else:
        half = 2 * from_nearer_end**2 - (np.sin(2 * np.pi * from_nearer_end) / np.pi) ** 2 / 2
    covered: np.ndarray = np.where(fraction <= 0.5, half, 1 - half)
    return covered


def progress_rates(
    t: Float[np.ndarray, "*batch"], duration: float, law: str
) -> tuple[Float[np.ndarray, "*batch"], Float[np.ndarray, "*batch"]]:
    """Return the first two time derivatives [1/s, 1/s²] of ``progress``. Times ``t`` are in [0, duration] [s]."""
    fraction = np.asarray(t, dtype=float) / duration
    if law == "uniform":
        return np.full_like(fraction, 1 / duration), np.zeros_like(fraction)
    from_nearer_end = np.minimum(fraction, 1 - fraction)
    if law == "quintic":
        product = from_nearer_end * (1 - from_nearer_end)
        speed, acceleration = 30 * product**2, 60 * product * (1 - 2 * from_nearer_end)
    else:
        angle = 4 * np.pi * from_nearer_end
        speed, acceleration = 4 * from_nearer_end - np.sin(angle) / np.pi, 8 * np.sin(angle / 2) ** 2
    signs = np.where(fraction <= 0.5, 1.0, -1.0)  # s(τ) = 1 - s(1 - τ): the speed is symmetric about the middle
    return speed / duration, signs * acceleration / duration**2


# Curves as functions of time.


Samples: TypeAlias = tuple[Float[np.ndarray, "time axes"], Float[np.ndarray, "time 4"] | None]
Curve: TypeAlias = Callable[[np.ndarray], Samples]


class Rates(NamedTuple):
    """Derivatives of a curve's positions [m] and orientations [rad].

    Angular rates are about world axes, None for points.
    """

    velocity: Float[np.ndarray, "time axes"]
    acceleration: Float[np.ndarray, "time axes"]
    angular_velocity: Float[np.ndarray, "time 3"] | None
    angular_acceleration: Float[np.ndarray, "time 3"] | None


@runtime_checkable
class SmoothCurve(Protocol):
    """A curve with first and second derivatives with respect to its parameter."""

    def __call__(self, parameters: Times, /) -> Samples:
        """Return positions and orientations at parameters."""

    def rates(self, parameters: Times, /) -> Rates:
        """Return first and second derivatives at parameters."""


CLOSURE_TOLERANCE = 1e-9  # share of a path's or an arm's length, or rad: nearer points are the same


@dataclass(frozen=True, eq=False)
class TimedCurve:
    """A curve ``shape`` of the fraction covered, travelled in ``duration`` [s] with a time law."""

    shape: SmoothCurve
    duration: float
    law: str

    def __post_init__(self) -> None:
        check_choice("timing:", self.law, TIME_LAWS)

    def __call__(self, times: Times) -> Samples:
        """Return positions and orientations at times [s]."""
        return self.shape(progress(times, self.duration, self.law))

    def rates(self, times: Times) -> Rates:
        """Return velocities and accelerations at times [s]."""
        speed, acceleration = (values[:, None] for values in progress_rates(times, self.duration, self.law))
        v, a, omega, alpha = self.shape.rates(progress(times, self.duration, self.law))
        linear = v * speed, v * acceleration + a * speed**2
        if omega is None or alpha is None:
            return Rates(*linear, None, None)
        return Rates(*linear, omega * speed, omega * acceleration + alpha * speed**2)


@dataclass(frozen=True, eq=False)
class Line:
    """A line from ``origin`` by ``step`` [m].

    The orientation rotates by ``rotation_vector`` [rad] from ``quaternion``. A line of points has no quaternion.
    """

    origin: Float[np.ndarray, " axes"]
    step: Float[np.ndarray, " axes"]
    quaternion: Quaternion | None
    rotation_vector: Vector3

    def __call__(self, fractions: Times) -> Samples:
        """Return positions and orientations at fractions covered, 0 to 1."""
        fraction = fractions[:, None]
        positions = self.origin + fraction * self.step
        if self.quaternion is None:
            return positions, None
        return positions, quaternion_product(self.quaternion, vector_to_quaternion(fraction * self.rotation_vector))

    def rates(self, fractions: Times) -> Rates:
        """Return derivatives with respect to the fraction covered."""
        count = len(fractions)
        velocity = np.tile(self.step, (count, 1))
        if self.quaternion is None:
            return Rates(velocity, np.zeros_like(velocity), None, None)
        axis = quaternion_to_matrix(self.quaternion) @ self.rotation_vector
        return Rates(velocity, np.zeros_like(velocity), np.tile(axis, (count, 1)), np.zeros((count, 3)))


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle about ``center`` from angle ``phase`` by ``sweep`` [rad].

    The ``axes`` are the radius vectors [m] at the angles 0 and π/2.
    """

    center: Float[np.ndarray, " axes"]
    axes: Float[np.ndarray, "2 axes"]
    phase: float
    sweep: float
    quaternion: Quaternion | None

    def __call__(self, fractions: Times) -> Samples:
        """Return positions and orientations at fractions covered, 0 to 1."""
        angles = self.phase + self.sweep * fractions
        positions = self.center + np.stack([np.cos(angles), np.sin(angles)], axis=1) @ self.axes
        return positions, None if self.quaternion is None else np.tile(self.quaternion, (len(fractions), 1))

    def rates(self, fractions: Times) -> Rates:
        """Return derivatives with respect to the fraction covered."""
        angles = self.phase + self.sweep * fractions
        velocity = self.sweep * np.stack([-np.sin(angles), np.cos(angles)], axis=1) @ self.axes
        acceleration = -(self.sweep**2) * np.stack([np.cos(angles), np.sin(angles)], axis=1) @ self.axes
        still = None if self.quaternion is None else np.zeros((len(fractions), 3))
        return Rates(velocity, acceleration, still, still)


@dataclass(frozen=True, eq=False)
class Spline:
    """SciPy's ``CubicSpline`` of positions and ``RotationSpline`` of orientations.

    Both have the same knots; orientations may be None.
    """

    positions: Any
    rotations: Any

    def __call__(self, knots: Times) -> Samples:
        """Return positions and orientations at parameters within the knots."""
        positions = self.positions(knots)
        return positions, None if self.rotations is None else np.roll(self.rotations(knots).as_quat(), 1, axis=1)

    def rates(self, knots: Times) -> Rates:
        """Return derivatives with respect to the parameter of the knots."""
        velocity, acceleration = self.positions(knots, 1), self.positions(knots, 2)
        if self.rotations is None:
            return Rates(velocity, acceleration, None, None)
        turned = self.rotations(knots)  # SciPy's rates are in the rotating frame: (R ω)˙ = R ω̇, since ω × ω = 0
        return Rates(velocity, acceleration, *(turned.apply(self.rotations(knots, order)) for order in (1, 2)))


def interpolate(
    knots: Times, positions: Float[np.ndarray, "time axes"], quaternions: Float[np.ndarray, "time 4"] | None
) -> Spline:
    """Return the C² spline through positions and orientations at knots. Positions are periodic if the ends meet."""
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import Rotation, RotationSpline

    extent = np.linalg.norm(np.ptp(positions, axis=0))
    closed = np.linalg.norm(positions[-1] - positions[0]) <= CLOSURE_TOLERANCE * extent
    if closed:
        positions = np.concatenate([positions[:-1], positions[:1]])
    spline = CubicSpline(knots, positions, bc_type="periodic" if closed else "not-a-knot")
    if quaternions is None:
        return Spline(spline, None)
    return Spline(spline, RotationSpline(knots, Rotation.from_quat(np.roll(quaternions, -1, axis=1))))
