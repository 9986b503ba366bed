"""Joint frames from Denavit–Hartenberg parameters, in both conventions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from paretoik.arrays import Matrix3
from paretoik.robot.pose import Pose


def joint_placements(
    *,
    a: Sequence[float] | np.ndarray,
    alpha: Sequence[float] | np.ndarray,
    d: Sequence[float] | np.ndarray,
    theta: Sequence[float] | np.ndarray,
    convention: Literal["modified", "standard"],
) -> tuple[tuple[Pose, ...], tuple[Pose, ...], Pose]:
    """Return the placement of each joint on the one before, of each link frame on its joint, and of the tool.

    a, d: lengths [m], one per joint
    alpha, theta: angles [rad], one per joint
    convention: that of the parameters and link frames

    A joint's frame has the joint's axis along z in both conventions. The joint moves along or about z, so that its
    offsets d and theta commute with its motion. Source: Craig, Introduction to Robotics, chapter 3 (modified);
    Siciliano et al., chapter 2 (standard).
    """
    count, origin = len(a), Pose(np.zeros(3))
    along_z = [_transform(0.0, 0.0, d[i], theta[i]) for i in range(count)]
    along_x = [_transform(a[i], alpha[i], 0.0, 0.0) for i in range(count)]
    if convention == "modified":
        return tuple(x @ z for x, z in zip(along_x, along_z, strict=True)), (origin,) * count, origin
    previous = [origin, *along_x[:-1]]
    return tuple(x @ z for x, z in zip(previous, along_z, strict=True)), tuple(along_x), along_x[-1]


def _transform(a: float, alpha: float, d: float, theta: float) -> Pose:
    """Return a translation by a along x and a rotation by alpha about it, then d and theta along and about z."""
    rotation: Matrix3 = np.array(
        [
            [np.cos(theta), -np.sin(theta), 0.0],
            [np.cos(alpha) * np.sin(theta), np.cos(alpha) * np.cos(theta), -np.sin(alpha)],
            [np.sin(alpha) * np.sin(theta), np.sin(alpha) * np.cos(theta), np.cos(alpha)],
        ]
    )
    return Pose.from_matrix(rotation, np.array([a, -np.sin(alpha) * d, np.cos(alpha) * d]))
