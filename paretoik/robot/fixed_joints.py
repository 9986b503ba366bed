"""Joints frozen at a value: the arm with one joint less, and the motion of a joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.inputs import finite_number, likely_spelling, shown
from paretoik.robot.arm import Arm
from paretoik.robot.body import combine_bodies, transform_body
from paretoik.robot.frame import Frame
from paretoik.robot.pose import Pose


def fix_joint(arm: Arm, joint: str, value: float) -> Arm:
    """Return the arm with one joint frozen at ``value`` [rad, m], its link part of the one before.

    Raises InvalidInput for an unknown joint, a value that is not finite, or the last joint of an arm.
    """
    if joint not in arm.joint_names:
        hint = likely_spelling(joint, arm.joint_names)
        raise InvalidInput(f"fixed: joints among {', '.join(arm.joint_names)} wanted, got {shown(joint)}{hint}")
    value = finite_number(f"joint {joint}", value)
    if arm.dof == 1:
        raise InvalidInput(f"joint {joint}: wanted one of several that move, got the last of {arm.name}")
    i = arm.joint_names.index(joint)
    lower, upper = arm.position_limits[i]
    if not lower <= value <= upper:
        raise InvalidInput(f"joint {joint}: a value from {lower:g} to {upper:g} wanted, got {value:g}")
    fixed = arm.placements[i] @ joint_motion(arm.joint_types[i], value)
    placements, bodies, tool = list(arm.placements), list(arm.bodies), arm.tool
    if i + 1 < arm.dof:
        placements[i + 1] = fixed @ placements[i + 1]
    else:
        tool = fixed @ tool
    if i > 0:
        bodies[i - 1] = combine_bodies(bodies[i - 1], transform_body(bodies[i], fixed))
    del placements[i], bodies[i]
    others = np.arange(arm.dof) != i
    return replace(
        arm,
        joint_names=arm.joint_names[:i] + arm.joint_names[i + 1 :],
        joint_types=arm.joint_types[:i] + arm.joint_types[i + 1 :],
        placements=tuple(placements),
        bodies=tuple(bodies),
        tool=tool,
        position_limits=arm.position_limits[others],
        velocity_limits=arm.velocity_limits[others],
        torque_limits=arm.torque_limits[others],
        acceleration_limits=None if arm.acceleration_limits is None else arm.acceleration_limits[others],
        jerk_limits=None if arm.jerk_limits is None else arm.jerk_limits[others],
        frames={name: _without_joint(frame, i, fixed) for name, frame in arm.frames.items()},
    )


def joint_motion(joint_type: str, value: float, axis: Sequence[float] = (0.0, 0.0, 1.0)) -> Pose:
    """Return the pose that a joint at ``value`` [rad or m] adds after its placement; none for those of other types."""
    if joint_type == "prismatic":
        return Pose(value * np.array(axis))
    if joint_type in ("revolute", "continuous"):
        return Pose(np.zeros(3), np.array([np.cos(value / 2), *(np.sin(value / 2) * np.array(axis))]))
    return Pose(np.zeros(3))


def _without_joint(frame: Frame, joint: int, fixed: Pose) -> Frame:
    """Return a frame of the arm after a joint is fixed at the pose ``fixed`` on the link before."""
    if frame.link < joint:
        return frame
    return Frame(link=frame.link - 1, pose=fixed @ frame.pose if frame.link == joint else frame.pose)
