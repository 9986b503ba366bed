"""Postures along a path and their durations: every joint turns as fast as it can while it holds the arm.

A path leaves a planar arm with three joints one freedom: the direction of its last link. Between neighbouring samples
every joint turns by the difference, so that a piece takes the time of its slowest joint. ``continuous`` chooses
postures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.capability.joint_capability import joint_speeds
from paretoik.robot.dynamics import gravity_torques


@dataclass(frozen=True, kw_only=True, eq=False)
class Mechanism:
    """An arm and its actuation."""

    arm: pk.Arm
    actuation: pk.capability.JointActuation | pk.capability.DistributedActuation


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """Postures ``q`` (n, 3) along ``points`` (n, 2) [m], ``times`` (n,) [s]; holding torques ``torque`` (n, 3).

    ``angles`` (n,) are the last link's, ``elbows`` (n,) the signs of the second joint's angle.
    """

    points: Float[np.ndarray, "n 2"]
    angles: Float[np.ndarray, " n"]
    elbows: Float[np.ndarray, " n"]
    q: Float[np.ndarray, "n 3"]
    torque: Float[np.ndarray, "n 3"]
    times: Float[np.ndarray, " n"]

    @property
    def turned(self) -> Float[np.ndarray, "pieces 3"]:
        """Turn of the joints in every piece [rad]."""
        return wrap_angles(np.diff(self.q, axis=0))

    @property
    def work(self) -> Float[np.ndarray, " 3"]:
        """∫ |τ q̇| dt of every joint [J]."""
        loaded = np.abs(self.torque[1:] + self.torque[:-1]) / 2
        slowness: np.ndarray = (loaded * np.abs(self.turned)).sum(axis=0)
        return slowness


@dataclass(frozen=True, kw_only=True, eq=False)
class Nodes:
    """Possible postures of each sample, their torques [N m], and 1 / speed [s/rad] down and up: inf if impossible."""

    q: Float[np.ndarray, "samples choices 3"]
    torque: Float[np.ndarray, "samples choices 3"]
    slowness: Float[np.ndarray, "2 samples choices 3"]


def nodes(
    mechanism: Mechanism,
    points: Float[np.ndarray, "samples 2"],
    angles: Float[np.ndarray, "samples choices"],
    elbows: object,
) -> Nodes:
    """Return postures by the last link's angle and the sign of the second joint's."""
    arm = mechanism.arm
    first, second, third = (pose.position[0] for pose in (arm.placements[1], arm.placements[2], arm.tool))
    wrist = points[:, None] - third * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    x, y = wrist[..., 0], wrist[..., 1]
    cosine = (x**2 + y**2 - first**2 - second**2) / (2 * first * second)
    bent = np.asarray(elbows) * np.arccos(np.clip(cosine, -1.0, 1.0))
    begun = np.arctan2(y, x) - np.arctan2(second * np.sin(bent), first + second * np.cos(bent))
    q = wrap_angles(np.stack([begun, bent, angles - begun - bent], axis=-1))
    torque = gravity_torques(arm, q)
    known = joint_speeds(mechanism.actuation, q, torque)
    speeds = np.stack([-known.low, known.high])
    low, high = np.where(np.isfinite(arm.position_limits), arm.position_limits, [-np.pi, np.pi]).T
    inside = np.abs(wrap_angles(q - (low + high) / 2)) <= (high - low) / 2
    able = (np.abs(cosine) <= 1.0)[..., None] & inside & (speeds > 0)  # NaN, if it cannot hold, is not above 0
    slowness = np.divide(1.0, speeds, out=np.full_like(speeds, np.inf), where=able)
    return Nodes(q=q, torque=torque, slowness=slowness)


def minimum_timing(
    mechanism: Mechanism,
    points: Float[np.ndarray, "n 2"],
    angles: Float[np.ndarray, " n"],
    elbows: Float[np.ndarray, " n"],
) -> Profile:
    """Return a profile with its times: every piece takes that of its slowest joint."""
    known = nodes(mechanism, points, angles[:, None], elbows[:, None])
    q, slowness = known.q[:, 0], known.slowness[:, :, 0]
    pieces = lasting(wrap_angles(np.diff(q, axis=0)), slowness[:, :-1], slowness[:, 1:]).max(axis=-1)
    times = np.append(0.0, np.cumsum(pieces))
    return Profile(points=points, angles=angles, elbows=elbows, q=q, torque=known.torque[:, 0], times=times)


def refine_profile(mechanism: Mechanism, known: Profile, points: Float[np.ndarray, "n 2"]) -> Profile:
    """Return a profile on more points of its path, evenly between its own, the last link's angle linear between."""
    count = len(known.angles)
    places = np.linspace(0, count - 1, len(points))
    angles = np.interp(places, np.arange(count), np.unwrap(known.angles))
    return minimum_timing(mechanism, points, angles, known.elbows[np.round(places).astype(int)])


def evenly(points: Float[np.ndarray, "n 2"], pieces: int) -> Float[np.ndarray, "m 2"]:
    """Return points of a path at equal distances along it."""
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    places = np.linspace(0.0, along[-1], pieces + 1)
    return np.stack([np.interp(places, along, column) for column in points.T], axis=1)


def lasting(
    turned: Float[np.ndarray, "*batch 3"],
    before: Float[np.ndarray, "2 *batch 3"],
    after: Float[np.ndarray, "2 *batch 3"],
) -> Float[np.ndarray, "*batch 3"]:
    """Return the time of each joint [s], by the mean slowness of both ends in its direction of turning."""
    mean = (before + after) / 2
    with np.errstate(invalid="ignore"):
        slow = np.abs(turned) * np.where(turned < 0, mean[0], mean[1])
    slowness: np.ndarray = np.where(np.isnan(slow), np.inf, slow)
    return slowness


def wrap_angles(angle: np.ndarray) -> np.ndarray:
    """Return angles within half a turn of 0."""
    wrapped: np.ndarray = angle - 2 * np.pi * np.round(angle / (2 * np.pi))
    return wrapped
