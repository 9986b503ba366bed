"""An arm's constants as components: frames, and inertial parameters regrouped so that most of them are zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from paretoik.robot.arm import Arm
from paretoik.robot.components import Component, Matrix, Vector, to_matrix, to_vector
from paretoik.robot.pose import Pose

ROTATION_TOLERANCE = 1e-15  # entries of a rotation this close to 0 or ±1 are the rounding of right angles


@dataclass(frozen=True, kw_only=True)
class LinkConstants:
    """Constants of one joint and the link it moves, as components.

    ``mass`` [kg], ``first_moment`` ∫ r dm [kg m], ``second_moments`` ∫ r rᵀ dm and ``inertia`` [kg m²], all about the
    link's origin, are base parameters: those of the link after ``_regroup_inertias``.
    """

    prismatic: bool
    rotation: Matrix
    translation: Vector
    mass: float
    first_moment: Vector
    second_moments: Matrix
    inertia: Matrix


@dataclass(frozen=True, kw_only=True)
class ArmConstants:
    """Constants of an arm, as components; ``gravity`` is given in the base frame."""

    links: tuple[LinkConstants, ...]
    tool_rotation: Matrix
    tool_translation: Vector
    base_rotation: Matrix
    base_translation: Vector
    gravity: Vector


@lru_cache(maxsize=64)
def arm_constants(arm: Arm) -> ArmConstants:
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
        for joint_type, placement, inertia in zip(arm.joint_types, arm.placements, _regroup_inertias(arm), strict=True)
    )
    tool_rotation, tool_translation = pose_constants(arm.tool)
    base_rotation, base_translation = pose_constants(arm.base)
    return ArmConstants(
        links=links,
        tool_rotation=tool_rotation,
        tool_translation=tool_translation,
        base_rotation=base_rotation,
        base_translation=base_translation,
        gravity=to_vector(_snap(arm.base.rotation).T @ arm.gravity),
    )


def joint_cosines_and_sines(
    links: Sequence[LinkConstants], q: Sequence[Component]
) -> list[tuple[Component, Component]]:
    """Return (cos q, sin q) of every rotating joint, (1, 0) of a prismatic one."""
    return [(1.0, 0.0) if link.prismatic else (np.cos(x), np.sin(x)) for link, x in zip(links, q, strict=True)]


def pose_constants(pose: Pose) -> tuple[Matrix, Vector]:
    """Return rotation and position of a pose as components."""
    return to_matrix(_snap(pose.rotation)), to_vector(pose.position)


def _regroup_inertias(arm: Arm) -> list[np.ndarray]:
    """Return each link's pseudo-inertia (4, 4) regrouped: moments that a joint does not move go to the link before.

    Mass on the axis of a rotating joint may as well belong to the link before, and so may the rotary inertia of a
    prismatic link: motions, torques and energies are the same. Passed from the tip to the base, most entries vanish,
    and the kernels skip zeros. Source: Khalil & Kleinfinger 1987, base inertial parameters.
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
    nearest = np.round(rotation)
    return np.where(np.abs(rotation - nearest) < ROTATION_TOLERANCE, nearest, rotation)
