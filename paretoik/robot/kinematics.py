"""Forward kinematics and the geometric Jacobian, for whole batches at once.

Everything is expressed in world axes; twists and Jacobians have the linear part first. Functions whose names end in
``_components`` serve kernels and derivatives: they take columns and return components. Source: Siciliano et al.,
Robotics: Modelling, Planning and Control, chapters 2 and 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Inexact

from paretoik.arrays import Jacobians, Joints, Positions, Rotations
from paretoik.robot.arm import Arm
from paretoik.robot.arm_constants import arm_constants, joint_cosines_and_sines
from paretoik.robot.arm_inputs import TOOL_FRAME
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
from paretoik.robot.frame import Frame


@dataclass(frozen=True)
class LinkFrames:
    """Every link's rotation and origin in the world, as components."""

    rotations: tuple[Matrix, ...]
    origins: tuple[Vector, ...]


def link_frames(arm: Arm, q: Sequence[Component]) -> LinkFrames:
    """Return the link frames of an arm at joint positions given as columns."""
    constants = arm_constants(arm)
    rotation, origin = constants.base_rotation, constants.base_translation
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


def frame_components(arm: Arm, links: LinkFrames, frame: Frame) -> tuple[Matrix, Vector]:
    """Return rotation and position of a frame in the world, as components."""
    constants = arm_constants(arm)
    rotation, origin = (
        (constants.base_rotation, constants.base_translation)
        if frame.link < 0
        else (links.rotations[frame.link], links.origins[frame.link])
    )
    offset_rotation, offset = (
        (constants.tool_rotation, constants.tool_translation)
        if frame.pose is arm.tool
        else (to_matrix(frame.pose.rotation), to_vector(frame.pose.position))
    )
    return multiply(rotation, offset_rotation), add(origin, apply(rotation, offset))


def jacobian_components(arm: Arm, links: LinkFrames, frame: Frame, position: Vector) -> list[tuple[Vector, Vector]]:
    """Return the Jacobian of a frame at ``position``: for each joint its linear and angular column."""
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


def forward_kinematics(arm: Arm, q: Joints, frame: str = TOOL_FRAME) -> tuple[Rotations, Positions]:
    """Return rotation (*batch, 3, 3) and position (*batch, 3) [m] of a frame in the world at q (*batch, dof).

    Raises InvalidInput for an unknown frame or a wrong number of joints.
    """
    on_link = arm.frame(frame)

    def kernel(q: Sequence[Component]) -> list[Component]:
        rotation, position = frame_components(arm, link_frames(arm, q), on_link)
        return [*rotation[0], *rotation[1], *rotation[2], *position]

    out = evaluate_in_blocks(kernel, arm, (12,), q)
    return out[..., :9].reshape(*out.shape[:-1], 3, 3), out[..., 9:]


def jacobian(arm: Arm, q: Joints, frame: str = TOOL_FRAME) -> Jacobians:
    """Return the geometric Jacobian (*batch, 6, dof), linear rows first, of a frame in world axes.

    Raises InvalidInput for an unknown frame or a wrong number of joints.
    """
    on_link = arm.frame(frame)

    def kernel(q: Sequence[Component]) -> list[Component]:
        links = link_frames(arm, q)
        columns = jacobian_components(arm, links, on_link, frame_components(arm, links, on_link)[1])
        return [column[part][axis] for part in (0, 1) for axis in range(3) for column in columns]

    return evaluate_in_blocks(kernel, arm, (6, arm.dof), q)


def link_nodes(arm: Arm, q: Joints) -> Inexact[np.ndarray, "*batch nodes 3"]:
    """Return the arm as a polyline (*batch, dof + 2, 3) [m]: base, every joint, tool."""
    return evaluate_in_blocks(partial(node_components, arm), arm, (arm.dof + 2, 3), q)


def node_components(arm: Arm, q: Sequence[Component]) -> list[Component]:
    """Return the nodes of ``link_nodes`` as components, x, y, z of each in turn."""
    links = link_frames(arm, q)
    tool = frame_components(arm, links, arm.frame(TOOL_FRAME))[1]
    return [value for node in (arm_constants(arm).base_translation, *links.origins, tool) for value in node]
