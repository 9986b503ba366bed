"""Forward kinematics and the geometric Jacobian, in batches.

Everything is expressed in world axes; twists and Jacobians have the linear part first. Functions whose names end in
``_components`` serve kernels and derivatives: they take columns and return components. Source: Siciliano et al.,
Robotics: Modelling, Planning and Control, chapters 2 and 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from jaxtyping import Float, Inexact

from paretoik.arrays import Jacobians, Joints, Positions, Rotations, read_only
from paretoik.robot.arm_arguments import TOOL_FRAME
from paretoik.robot.chain import SerialChain
from paretoik.robot.components import (
    ZERO,
    Component,
    Matrix,
    Vector,
    add,
    apply,
    cross,
    evaluate_in_blocks,
    multiply,
    scale,
    subtract,
    to_matrix,
    to_vector,
    transpose,
)
from paretoik.robot.pose import Frame

# Constants of an arm as components.


@dataclass(frozen=True, kw_only=True)
class LinkConstants:
    """Constants of one joint and the link it moves, as components.

    Inertial parameters are base parameters about the link's origin, see ``base_parameters``.
    """

    prismatic: bool
    rotation: Matrix
    translation: Vector
    mass: float  # mass [kg]
    first_moment: Vector  # ∫ r dm [kg m]
    second_moments: Matrix  # ∫ r rᵀ dm [kg m²]
    inertia: Matrix  # inertia [kg m²]


@dataclass(frozen=True, kw_only=True)
class ArmConstants:
    """Rotation and position of tool and base, and gravity in the base frame, as components."""

    links: tuple[LinkConstants, ...]
    tool: tuple[Matrix, Vector]
    base: tuple[Matrix, Vector]
    gravity: Vector


@lru_cache(maxsize=64)
def arm_constants(arm: SerialChain) -> ArmConstants:
    """Return the arm's constants in the form the kernels use."""
    links = tuple(
        LinkConstants(
            prismatic=joint_type == "prismatic",
            rotation=to_matrix(_snap(placement.rotation)),
            translation=to_vector(placement.position),
            mass=float(inertia[3, 3]),
            first_moment=to_vector(inertia[:3, 3]),
            second_moments=to_matrix(inertia[:3, :3]),
            inertia=to_matrix(np.trace(inertia[:3, :3]) * np.eye(3) - inertia[:3, :3]),
        )
        for joint_type, placement, inertia in zip(arm.joint_types, arm.placements, base_parameters(arm), strict=True)
    )
    tool, base = ((to_matrix(_snap(pose.rotation)), to_vector(pose.position)) for pose in (arm.tool, arm.base))
    gravity = to_vector(_snap(arm.base.rotation).T @ arm.gravity)
    return ArmConstants(links=links, tool=tool, base=base, gravity=gravity)


def joint_cosines_and_sines(
    links: Sequence[LinkConstants], q: Sequence[Component]
) -> list[tuple[Component, Component]]:
    """Return (cos q, sin q) of each rotational joint, (1, 0) of each prismatic one."""
    return [(1.0, 0.0) if link.prismatic else (np.cos(x), np.sin(x)) for link, x in zip(links, q, strict=True)]


def base_parameters(arm: SerialChain) -> list[np.ndarray]:
    """Return each link's pseudo-inertia (4, 4), regrouped into base parameters.

    Moments that a joint does not move are added to the previous link: mass on the axis of a rotational joint, or the
    rotary inertia of a prismatic link. Motions, torques and energies stay the same. Most entries become zero, and
    kernels skip zeros. Source: Khalil & Kleinfinger 1987, base inertial parameters.
    """
    inertias = [body.pseudo_inertia for body in arm.bodies]
    for i in reversed(range(arm.dof)):
        passed = np.zeros((4, 4))
        unmoved = np.ix_([0, 1, 2], [0, 1, 2]) if arm.joint_types[i] == "prismatic" else np.ix_([2, 3], [2, 3])
        passed[unmoved] = inertias[i][unmoved]
        inertias[i][unmoved] = 0.0
        transform = arm.placements[i].matrix
        transform[:3, :3] = _snap(transform[:3, :3])
        if i > 0:
            inertias[i - 1] = inertias[i - 1] + transform @ passed @ transform.T
    return inertias


def _snap(rotation: np.ndarray) -> np.ndarray:
    """Return a rotation whose entries within 1e-15 of 0 or ±1 are rounded: they come from right angles."""
    nearest = np.round(rotation)
    return np.where(np.abs(rotation - nearest) < 1e-15, nearest, rotation)


# Scales of joint and tool positions, which make numbers independent of units.


@lru_cache(maxsize=256)
def characteristic_length(arm: SerialChain) -> float:
    """Return the sum of link lengths [m] from the first joint to the tool, with prismatic joints at 0.

    If the sum is 0, return the longest range of a prismatic joint, or 1 m if none is limited.
    """
    offsets = [*arm.placements[1:], arm.tool]
    length = float(sum(np.linalg.norm(pose.position) for pose in offsets))
    if length > 0.0:
        return length
    ranges = np.diff(arm.position_limits, axis=1)[~arm.periodic, 0]
    return float(ranges[np.isfinite(ranges)].max(initial=0.0)) or 1.0


@lru_cache(maxsize=256)
def joint_scales(arm: SerialChain) -> Float[np.ndarray, " dof"]:
    """Return the unit of each joint: 1 rad, or the arm's length [m] for a prismatic joint."""
    return read_only(np.where(arm.periodic, 1.0, characteristic_length(arm)))


@lru_cache(maxsize=256)
def geometry_key(arm: SerialChain) -> tuple[object, ...]:
    """Return a dictionary key of an arm's geometry; it is equal for arms with the same link poses and scales."""
    poses = [*arm.placements, arm.tool, arm.base]
    numbers = np.concatenate([part for pose in poses for part in (pose.position, pose.quaternion)])
    return arm.joint_types, arm.is_planar, characteristic_length(arm), numbers.tobytes()


# Link frames, forward kinematics and the Jacobian.


@dataclass(frozen=True)
class LinkFrames:
    """Every link's rotation and origin in the world, as components."""

    rotations: tuple[Matrix, ...]
    origins: tuple[Vector, ...]


def link_frames(arm: SerialChain, q: Sequence[Component]) -> LinkFrames:
    """Return the link frames of an arm at joint positions given as columns."""
    constants = arm_constants(arm)
    rotation, origin = constants.base
    rotations, origins = [], []
    cosines_and_sines = joint_cosines_and_sines(constants.links, q)
    for link, value, (cosine, sine) in zip(constants.links, q, cosines_and_sines, strict=True):
        origin = add(origin, apply(rotation, link.translation))
        rotation = multiply(rotation, link.rotation)
        x, y, z = transpose(rotation)
        if link.prismatic:
            origin = add(origin, scale(z, value))
        else:
            x, y = add(scale(x, cosine), scale(y, sine)), add(scale(y, cosine), scale(scale(x, -1.0), sine))
            rotation = transpose((x, y, z))
        rotations.append(rotation)
        origins.append(origin)
    return LinkFrames(tuple(rotations), tuple(origins))


def frame_components(arm: SerialChain, links: LinkFrames, frame: Frame) -> tuple[Matrix, Vector]:
    """Return rotation and position of a frame in the world, as components."""
    constants = arm_constants(arm)
    rotation, origin = constants.base
    if frame.link >= 0:
        rotation, origin = links.rotations[frame.link], links.origins[frame.link]
    offset_rotation, offset = constants.tool
    if frame.pose is not arm.tool:
        offset_rotation, offset = to_matrix(frame.pose.rotation), to_vector(frame.pose.position)
    return multiply(rotation, offset_rotation), add(origin, apply(rotation, offset))


def jacobian_components(
    arm: SerialChain, links: LinkFrames, frame: Frame, position: Vector
) -> list[tuple[Vector, Vector]]:
    """Return each joint's linear and angular Jacobian column, for a frame at ``position``."""
    columns = []
    for i, link in enumerate(arm_constants(arm).links):
        axis = transpose(links.rotations[i])[2]
        if i > frame.link:
            columns.append((ZERO, ZERO))
        elif link.prismatic:
            columns.append((axis, ZERO))
        else:
            columns.append((cross(axis, subtract(position, links.origins[i])), axis))
    return columns


def forward_kinematics(arm: SerialChain, q: Joints, frame: str = TOOL_FRAME) -> tuple[Rotations, Positions]:
    """Return a frame's rotation (*batch, 3, 3) and position (*batch, 3) [m] in the world."""
    on_link = arm.frame(frame)

    def kernel(q: Sequence[Component]) -> list[Component]:
        rotation, position = frame_components(arm, link_frames(arm, q), on_link)
        return [*rotation[0], *rotation[1], *rotation[2], *position]

    out = evaluate_in_blocks(kernel, arm, (12,), q)
    return out[..., :9].reshape(*out.shape[:-1], 3, 3), out[..., 9:]


def jacobian(arm: SerialChain, q: Joints, frame: str = TOOL_FRAME) -> Jacobians:
    """Return the geometric Jacobian (*batch, 6, dof) of a frame in world axes, linear rows first."""
    on_link = arm.frame(frame)

    def kernel(q: Sequence[Component]) -> list[Component]:
        links = link_frames(arm, q)
        columns = jacobian_components(arm, links, on_link, frame_components(arm, links, on_link)[1])
        return [column[part][axis] for part in (0, 1) for axis in range(3) for column in columns]

    return evaluate_in_blocks(kernel, arm, (6, arm.dof), q)


def link_nodes(arm: SerialChain, q: Joints) -> Inexact[np.ndarray, "*batch nodes 3"]:
    """Return the arm as a polyline (*batch, dof + 2, 3) [m]: base, every joint, tool."""
    return evaluate_in_blocks(partial(node_components, arm), arm, (arm.dof + 2, 3), q)


def node_components(arm: SerialChain, q: Sequence[Component]) -> list[Component]:
    """Return the nodes of ``link_nodes`` as components: x, y, z of each node."""
    links = link_frames(arm, q)
    tool = frame_components(arm, links, arm.frame(TOOL_FRAME))[1]
    return [value for node in (arm_constants(arm).base[1], *links.origins, tool) for value in node]
