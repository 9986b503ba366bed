"""What the kernels share: an arm's constants as components, and samples in blocks that stay in the cache."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm
from paretoik.robot.components import Component, Rows, Triple, rows, triple
from paretoik.robot.pose import Pose

BLOCK = 6144  # samples: enough to drown the cost of a call; at 48 KB a column, memory is reused, not mapped anew
DUST = 1e-15  # entries this close to 0 or ±1 are the rounding of right angles


@dataclass(frozen=True, kw_only=True)
class Link:
    """Constants of one joint and the link it moves, as components.

    ``mass``, first ``moment``, ``second`` moments ∫ r rᵀ dm and ``inertia``, all about the link's origin, are what is
    left of the link after ``_shared_out``: the same in every motion, but mostly zero.
    """

    prismatic: bool
    rotation: Rows
    translation: Triple
    mass: float
    moment: Triple
    second: Rows
    inertia: Rows


@dataclass(frozen=True, kw_only=True)
class Constants:
    """Constants of an arm, as components; ``gravity`` is given in the base frame."""

    links: tuple[Link, ...]
    tool_rotation: Rows
    tool_translation: Triple
    base_rotation: Rows
    base_translation: Triple
    base_mass: float
    base_moment: Triple
    gravity: Triple


@lru_cache(maxsize=64)
def constants(arm: Arm) -> Constants:
    """Return the arm's constants in the form the kernels use."""
    masses, base = _shared_out(arm)
    links = tuple(
        Link(
            prismatic=kind == "prismatic",
            rotation=rows(_clean(placement.rotation)),
            translation=triple(placement.position),
            mass=float(mass[3, 3]),
            moment=triple(mass[:3, 3]),
            second=rows(mass[:3, :3]),
            inertia=rows(np.trace(mass[:3, :3]) * np.eye(3) - mass[:3, :3]),
        )
        for kind, placement, mass in zip(arm.joint_types, arm.placements, masses, strict=True)
    )
    tool_rotation, tool_translation = _constant(arm.tool)
    base_rotation, base_translation = _constant(arm.base)
    return Constants(
        links=links,
        tool_rotation=tool_rotation,
        tool_translation=tool_translation,
        base_rotation=base_rotation,
        base_translation=base_translation,
        base_mass=float(base[3, 3]),
        base_moment=triple(base[:3, 3]),
        gravity=triple(_clean(arm.base.rotation).T @ arm.gravity),
    )


def in_blocks(
    kernel: Callable[..., Sequence[Component]], arm: Arm, shape: tuple[int, ...], *arrays: np.ndarray
) -> np.ndarray:
    """Run ``kernel(*columns)`` over samples (*batch, dof), a block at a time; return (*batch, *shape).

    Each argument reaches the kernel as a list of dof contiguous columns; the kernel returns the entries of ``shape`` in
    order. Raises InvalidInput where an array's last axis is not the arm's dof or the batches differ.
    """
    arrays = tuple(np.asarray(array) for array in arrays)
    for array in arrays:
        if array.ndim == 0 or array.shape[-1] != arm.dof:
            raise InvalidInput(f"{arm.name} has {arm.dof} joints; got an array of shape {array.shape}")
        if array.shape != arrays[0].shape:
            raise InvalidInput(f"joint arrays must have one shape, got {arrays[0].shape} and {array.shape}")
    batch = arrays[0].shape[:-1]
    count = int(np.prod(batch))
    flat = [array.reshape(count, arm.dof) for array in arrays]
    entries = int(np.prod(shape))
    out = np.empty((count, entries), dtype=np.result_type(float, *arrays))
    for start in range(0, count, BLOCK):
        stop = min(start + BLOCK, count)
        block = [[np.ascontiguousarray(part[start:stop, joint]) for joint in range(arm.dof)] for part in flat]
        for entry, value in enumerate(kernel(*block)):
            out[start:stop, entry] = value
    return out.reshape(*batch, *shape)


def sines(links: Sequence[Link], q: Sequence[Component]) -> list[tuple[Component, Component]]:
    """Return (cos q, sin q) of every turning joint, (1, 0) of a sliding one."""
    return [(1.0, 0.0) if link.prismatic else (np.cos(x), np.sin(x)) for link, x in zip(links, q, strict=True)]


def _shared_out(arm: Arm) -> tuple[list[np.ndarray], np.ndarray]:
    """Return each link's and the base's mass moments, (4, 4) each, after passing on what a joint does not move.

    Matter on the axis of a turning joint may as well belong to the link before, and so may the rotary inertia of a link
    that slides: no motion, torque or energy can tell. Passed from the tip to the base, most moments vanish, and the
    kernels skip what is zero. Source: Khalil & Kleinfinger 1987, base inertial parameters.
    """
    moments = [np.zeros((4, 4)), *(body.moments for body in arm.bodies)]
    for i in reversed(range(arm.dof)):
        held = np.zeros((4, 4))
        unmoved = np.ix_([0, 1, 2], [0, 1, 2]) if arm.joint_types[i] == "prismatic" else np.ix_([2, 3], [2, 3])
        held[unmoved] = moments[i + 1][unmoved]
        moments[i + 1][unmoved] = 0.0
        place = arm.placements[i].matrix
        place[:3, :3] = _clean(place[:3, :3])
        moments[i] = moments[i] + place @ held @ place.T
    return moments[1:], moments[0]


def _constant(pose: Pose) -> tuple[Rows, Triple]:
    return rows(_clean(pose.rotation)), triple(pose.position)


def _clean(rotation: np.ndarray) -> np.ndarray:
    nearest = np.round(rotation)
    return np.where(np.abs(rotation - nearest) < DUST, nearest, rotation)
