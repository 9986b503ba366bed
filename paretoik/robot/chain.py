"""The chain of an arm as data, and joints frozen at a value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Vector3, read_only
from paretoik.errors import InvalidInput
from paretoik.inputs import check_choice, finite_number, likely_spelling, shown
from paretoik.robot.arm_arguments import BASE_FRAME, JOINT_TYPES, OTHER_NAMES, TOOL_FRAME, JointType
from paretoik.robot.body import Body, combine_bodies, transform_body
from paretoik.robot.pose import Frame, Pose

EARTH_GRAVITY = (0.0, 0.0, -9.81)  # m/s²


@runtime_checkable
class LinkGeometry(Protocol):
    """Collision geometry of a robot's links; ``paretoik.collision.bodies.Bodies`` implements it."""

    def with_fixed_joint(self, joint: int, motion: Pose) -> LinkGeometry:
        """Return the geometry of the arm whose joint with this index is frozen.

        motion: pose of the joint's frame, at its frozen value, in the frame before it
        """
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class SerialChain:
    """The data of a serial arm; ``Arm`` documents the fields."""

    name: str
    joint_names: tuple[str, ...]
    joint_types: tuple[JointType, ...]
    placements: tuple[Pose, ...]
    bodies: tuple[Body, ...]
    tool: Pose
    base: Pose = field(default_factory=lambda: Pose(np.zeros(3)))
    gravity: Vector3 = field(default_factory=lambda: np.array(EARTH_GRAVITY))
    position_limits: Float[np.ndarray, "dof 2"]
    velocity_limits: Float[np.ndarray, " dof"]
    torque_limits: Float[np.ndarray, " dof"]
    acceleration_limits: Float[np.ndarray, " dof"] | None = None
    jerk_limits: Float[np.ndarray, " dof"] | None = None
    is_planar: bool = False
    frames: Mapping[str, Frame] = field(default_factory=dict)
    source: Path | None = None
    source_digest: str | None = None
    notices: tuple[str, ...] = ()
    geometry: LinkGeometry | None = field(default=None, metadata={"fingerprint": "if given"})

    def __post_init__(self) -> None:
        """Check names, types and limits; make the arrays read-only."""
        names = self.joint_names
        if not names:
            raise InvalidInput(f"arm {self.name} must have at least one moving joint, got none")
        if len(set(names)) != len(names):
            raise InvalidInput(f"arm {self.name}: joint names must differ, got {', '.join(names)}")
        for joint_type in self.joint_types:
            check_choice(f"arm {self.name}: joint type", joint_type, JOINT_TYPES)
        for name, (low, high) in zip(names, np.reshape(self.position_limits, (-1, 2)), strict=False):
            if not low <= high:
                wish = f"arm {self.name}, {name}: position limits must be lower ≤ upper"
                raise InvalidInput(f"{wish}, got {low:g}, {high:g}")
        limits = self.position_limits, self.velocity_limits, self.torque_limits
        for array in (self.gravity, *limits, self.acceleration_limits, self.jerk_limits):
            if array is not None:
                array.setflags(write=False)

    @property
    def dof(self) -> int:
        """Number of joints that move."""
        return len(self.joint_names)

    @cached_property
    def periodic(self) -> np.ndarray:
        """Whether each joint's position is an angle, equivalent modulo 2π; shape (dof,), read-only."""
        return read_only(np.array([joint_type != "prismatic" for joint_type in self.joint_types]))

    def frame(self, name: str) -> Frame:
        """Return a frame of the arm.

        name: name of a link of the URDF, of a joint (the frame of the link that it moves), "tool" or "base"

        ``"<tool>"`` and ``"<base>"`` always are the arm's tool and base, even if a link or joint is called "tool" or
        "base". Raises InvalidInput listing the valid names.
        """
        origin = Pose(np.zeros(3))
        tool, base = Frame(link=self.dof - 1, pose=self.tool), Frame(link=-1, pose=origin)
        frames = {
            **dict(zip(OTHER_NAMES, (tool, base), strict=True)),
            **{joint: Frame(link=i, pose=origin) for i, joint in enumerate(self.joint_names)},
            **self.frames,
            TOOL_FRAME: tool,
            BASE_FRAME: base,
        }
        if not isinstance(name, str) or name not in frames:
            hint = likely_spelling(name, frames)
            wish = f"must be one of {self.name}'s: {', '.join(frames)}"
            raise InvalidInput(f"frame {wish}, got {shown(name)}{hint}")
        return frames[name]


# Joints frozen at a value.


AnyChain = TypeVar("AnyChain", bound=SerialChain)


def fix_joint(arm: AnyChain, joint: str, value: float) -> AnyChain:
    """Return the arm with one joint frozen at ``value`` [rad, m]; its link is merged with the previous one.

    Raises InvalidInput for an unknown joint, a value that is not finite, or the only joint.
    """
    if joint not in arm.joint_names:
        hint = likely_spelling(joint, arm.joint_names)
        raise InvalidInput(f"fixed must name joints among {', '.join(arm.joint_names)}, got {shown(joint)}{hint}")
    value = finite_number(f"joint {joint}", value)
    if arm.dof == 1:
        raise InvalidInput(f"joint {joint} must be one of several moving joints, got the only one of {arm.name}")
    i = arm.joint_names.index(joint)
    lower, upper = arm.position_limits[i]
    if not lower <= value <= upper:
        raise InvalidInput(f"joint {joint} must be from {lower:g} to {upper:g}, got {value:g}")
    fixed = arm.placements[i] @ joint_motion(arm.joint_types[i], value)
    placements, bodies, tool = list(arm.placements), list(arm.bodies), arm.tool
    if i + 1 < arm.dof:
        placements[i + 1] = fixed @ placements[i + 1]
    else:
        tool = fixed @ tool
    if i > 0:
        bodies[i - 1] = combine_bodies(bodies[i - 1], transform_body(bodies[i], fixed))
    del placements[i], bodies[i]
    kinds = ("position_limits", "velocity_limits", "torque_limits", "acceleration_limits", "jerk_limits")
    limits = {kind: np.delete(own, i, axis=0) for kind in kinds if (own := getattr(arm, kind)) is not None}
    frames = {}
    for name, frame in arm.frames.items():
        pose = fixed @ frame.pose if frame.link == i else frame.pose
        frames[name] = frame if frame.link < i else Frame(link=frame.link - 1, pose=pose)
    return replace(
        arm,
        joint_names=arm.joint_names[:i] + arm.joint_names[i + 1 :],
        joint_types=arm.joint_types[:i] + arm.joint_types[i + 1 :],
        placements=tuple(placements),
        bodies=tuple(bodies),
        tool=tool,
        frames=frames,
        geometry=None if arm.geometry is None else arm.geometry.with_fixed_joint(i, fixed),
        **limits,
    )


def joint_motion(joint_type: str, value: float, axis: Sequence[float] = (0.0, 0.0, 1.0)) -> Pose:
    """Return the pose that a joint at ``value`` [rad, m] adds to its placement; identity for other types."""
    if joint_type == "prismatic":
        return Pose(value * np.array(axis))
    if joint_type in ("revolute", "continuous"):
        return Pose(np.zeros(3), np.array([np.cos(value / 2), *(np.sin(value / 2) * np.array(axis))]))
    return Pose(np.zeros(3))
