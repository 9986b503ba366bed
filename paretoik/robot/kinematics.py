"""Forward kinematics, geometric Jacobian and its rate, for whole batches at once.

Everything is expressed in world axes; twists and Jacobians have the linear part first. Source: Siciliano et al.,
Robotics: Modelling, Planning and Control, chapters 2 and 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Inexact

from paretoik.arrays import Jacobians, Joints, Positions, Rotations, Twists
from paretoik.robot.arm import Arm, Frame
from paretoik.robot.chain import Constants, constants, in_blocks, sines
from paretoik.robot.components import (
    ZERO,
    Component,
    Rows,
    Triple,
    add,
    apply,
    cross,
    multiply,
    rows,
    scale,
    subtract,
    transpose,
    triple,
)
from paretoik.robot.pose import Pose


@dataclass(frozen=True)
class Chain:
    """Every link's rotation (rows) and origin in the world, as components."""

    rotations: tuple[Rows, ...]
    origins: tuple[Triple, ...]


def chain(arm: Arm, q: Sequence[Component]) -> Chain:
    """Return the link frames of an arm at joint positions given as columns."""
    known = constants(arm)
    rotation, origin = known.base_rotation, known.base_translation
    rotations, origins = [], []
    for link, value, (cosine, sine) in zip(known.links, q, sines(known.links, q), strict=True):
        origin = add(origin, apply(rotation, link.translation))
        rotation = multiply(rotation, link.rotation)
        x, y, z = transpose(rotation)
        if link.prismatic:
            origin = add(origin, scale(z, value))
        else:
            x, y = _turned(x, y, cosine, sine), _turned(y, scale(x, -1.0), cosine, sine)
            rotation = transpose((x, y, z))
        rotations.append(rotation)
        origins.append(origin)
    return Chain(tuple(rotations), tuple(origins))


def located(arm: Arm, links: Chain, frame: Frame) -> tuple[Rows, Triple]:
    """Return rotation (rows) and position of a frame in the world, as components."""
    known = constants(arm)
    rotation, origin = (
        (known.base_rotation, known.base_translation)
        if frame.link < 0
        else (links.rotations[frame.link], links.origins[frame.link])
    )
    held, place = _pose(known, arm, frame.pose)
    return multiply(rotation, held), add(origin, apply(rotation, place))


def columns(arm: Arm, links: Chain, frame: Frame, position: Triple) -> list[tuple[Triple, Triple]]:
    """Return the Jacobian of a frame at ``position``: for each joint its linear and angular column."""
    known = constants(arm)
    found = []
    for i, link in enumerate(known.links):
        axis = transpose(links.rotations[i])[2]
        if i > frame.link:
            found.append((ZERO, ZERO))
        elif link.prismatic:
            found.append((axis, ZERO))
        else:
            found.append((cross(axis, subtract(position, links.origins[i])), axis))
    return found


def tool_pose(arm: Arm, q: Joints, frame: str = "tool") -> tuple[Rotations, Positions]:
    """Return rotation (*batch, 3, 3) and position (*batch, 3) [m] of a frame in the world at q (*batch, dof).

    Raises InvalidInput for an unknown frame or a wrong number of joints.
    """
    place = arm.frame(frame)

    def kernel(q: Sequence[Component]) -> list[Component]:
        rotation, position = located(arm, chain(arm, q), place)
        return [*rotation[0], *rotation[1], *rotation[2], *position]

    out = in_blocks(kernel, arm, (12,), q)
    return out[..., :9].reshape(*out.shape[:-1], 3, 3), out[..., 9:]


def jacobian(arm: Arm, q: Joints, frame: str = "tool") -> Jacobians:
    """Return the geometric Jacobian (*batch, 6, dof), linear rows first, of a frame in world axes.

    Raises InvalidInput for an unknown frame or a wrong number of joints.
    """
    place = arm.frame(frame)

    def kernel(q: Sequence[Component]) -> list[Component]:
        links = chain(arm, q)
        pairs = columns(arm, links, place, located(arm, links, place)[1])
        return [pair[part][axis] for part in (0, 1) for axis in range(3) for pair in pairs]

    return in_blocks(kernel, arm, (6, arm.dof), q)


def posed_jacobian(arm: Arm, q: Joints, frame: str = "tool") -> tuple[Rotations, Positions, Jacobians]:
    """Return ``tool_pose`` and ``jacobian`` of a frame from one pass over the chain.

    Raises InvalidInput for an unknown frame or a wrong number of joints.
    """
    place = arm.frame(frame)

    def kernel(q: Sequence[Component]) -> list[Component]:
        links = chain(arm, q)
        rotation, position = located(arm, links, place)
        pairs = columns(arm, links, place, position)
        slopes = [pair[part][axis] for part in (0, 1) for axis in range(3) for pair in pairs]
        return [*rotation[0], *rotation[1], *rotation[2], *position, *slopes]

    out = in_blocks(kernel, arm, (12 + 6 * arm.dof,), q)
    batch = out.shape[:-1]
    return out[..., :9].reshape(*batch, 3, 3), out[..., 9:12], out[..., 12:].reshape(*batch, 6, arm.dof)


def jacobian_rate(arm: Arm, q: Joints, dq: Joints, frame: str = "tool") -> Twists:
    """Return J̇ q̇ (*batch, 6) [m/s², rad/s²]: the acceleration of a frame when q̈ = 0.

    Raises InvalidInput for an unknown frame or a wrong number of joints.
    """
    place = arm.frame(frame)

    def kernel(q: Sequence[Component], dq: Sequence[Component]) -> list[Component]:
        known = constants(arm)
        links = chain(arm, q)
        before, spin, swing, pull = known.base_translation, ZERO, ZERO, ZERO
        for i, link in enumerate(known.links[: place.link + 1]):
            arm_, axis = subtract(links.origins[i], before), transpose(links.rotations[i])[2]
            pull = add(pull, add(cross(swing, arm_), cross(spin, cross(spin, arm_))))
            before, move = links.origins[i], scale(axis, dq[i])
            if link.prismatic:
                pull = add(pull, scale(cross(spin, move), 2.0))
            else:
                swing = add(swing, cross(spin, move))
                spin = add(spin, move)
        reach = subtract(located(arm, links, place)[1], before)
        pull = add(pull, add(cross(swing, reach), cross(spin, cross(spin, reach))))
        return [*pull, *swing]

    return in_blocks(kernel, arm, (6,), q, dq)


def link_nodes(arm: Arm, q: Joints) -> Inexact[np.ndarray, "*batch nodes 3"]:
    """Return the arm as a polyline (*batch, dof + 2, 3) [m]: base, every joint, tool."""
    return in_blocks(partial(node_components, arm), arm, (arm.dof + 2, 3), q)


def node_components(arm: Arm, q: Sequence[Component]) -> list[Component]:
    """Return the nodes of ``link_nodes`` as components, x, y, z of each in turn."""
    links = chain(arm, q)
    nodes = [constants(arm).base_translation, *links.origins, located(arm, links, arm.frame("tool"))[1]]
    return [value for node in nodes for value in node]


def _turned(x: Triple, y: Triple, cosine: Component, sine: Component) -> Triple:
    return add(scale(x, cosine), scale(y, sine))


def _pose(known: Constants, arm: Arm, pose: Pose) -> tuple[Rows, Triple]:
    if pose is arm.tool:
        return known.tool_rotation, known.tool_translation
    return rows(pose.rotation), triple(pose.position)
