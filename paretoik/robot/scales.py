"""The scales of joint and tool positions: no number depends on the choice of units."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from paretoik.arrays import read_only
from paretoik.robot.arm import Arm


@lru_cache(maxsize=256)
def characteristic_length(arm: Arm) -> float:
    """Return the length [m] of an arm stretched out, from its first joint to its tool, slides at 0.

    If all of that is 0, it is the longest range of a slide, or 1 m if none is limited.
    """
    offsets = [*arm.placements[1:], arm.tool]
    length = float(sum(np.linalg.norm(pose.position) for pose in offsets))
    if length > 0.0:
        return length
    ranges = np.diff(arm.position_limits, axis=1)[~arm.periodic, 0]
    return float(ranges[np.isfinite(ranges)].max(initial=0.0)) or 1.0


@lru_cache(maxsize=256)
def joint_scales(arm: Arm) -> Float[np.ndarray, " dof"]:
    """Return what distances of each joint are measured in: 1 rad, or the arm's characteristic length [m] of a slide."""
    return read_only(np.where(arm.periodic, 1.0, characteristic_length(arm)))


@lru_cache(maxsize=256)
def geometry_key(arm: Arm) -> tuple[object, ...]:
    """Return all that poses of an arm's links and its scales depend on, for dictionaries: arms alike share a key."""
    poses = [*arm.placements, arm.tool, arm.base]
    numbers = np.concatenate([part for pose in poses for part in (pose.position, pose.quaternion)])
    return arm.joint_types, arm.is_planar, characteristic_length(arm), numbers.tobytes()
