"""Capability of joints under an actuation, and of the tool: speeds under a torque, torques, and forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Joints
from paretoik.capability import actuator_kernels as actuators
from paretoik.capability.actuation import Actuation, DistributedActuation, JointActuation
from paretoik.errors import Infeasible, InvalidInput
from paretoik.inputs import shown
from paretoik.nlp.convex_programs import furthest
from paretoik.robot import dynamics, kinematics
from paretoik.robot.arm import Arm

# Highest speed of a tool in one posture: the nearest facet, along a direction, of the zonotope of tool velocities.
# Sources: Kim, Shin & Jang 2021 (allowable polygons); Ziegler, Lectures on Polytopes, section 7.3.


@dataclass(frozen=True, kw_only=True)
class FacetOptions:
    """Tolerances of facets."""

    orthogonal: float = 1e-9  # largest cosine between a normal and a column orthogonal to it; relative error of speeds
    crossing: float = 1e-14  # least cosine between a normal and a direction that it bounds


OPTIONS = FacetOptions()


def normals(columns: Float[np.ndarray, "*batch task dof"]) -> Float[np.ndarray, "*batch normals task"]:
    """Return the normals that facets can have. They are not normalised, and some of them are 0.

    Tool velocities J q̇ of independent joint speeds are a zonotope. A facet's normal is orthogonal to the columns of J
    that span it: one column in the plane, two in space. Axes are added as columns, in case columns are parallel.
    """
    task = columns.shape[-2]
    axes = np.broadcast_to(np.eye(task), (*columns.shape[:-2], task, task))
    every = np.concatenate([columns, axes], axis=-1)
    if task == 2:
        return np.stack([-every[..., 1, :], every[..., 0, :]], axis=-1)
    pairs = np.array(list(combinations(range(every.shape[-1]), 2)))
    return np.cross(every[..., pairs[:, 0]], every[..., pairs[:, 1]], axis=-2).swapaxes(-1, -2)


def highest_speeds(
    columns: Float[np.ndarray, "*batch task dof"],
    low: Float[np.ndarray, "*batch dof"],
    high: Float[np.ndarray, "*batch dof"],
    directions: Float[np.ndarray, "*#batch directions task"],
) -> Float[np.ndarray, "*batch directions"]:
    """Return the highest speed along each direction [m/s]; NaN if a joint's speeds are NaN.

    ``columns`` is the Jacobian of positions, and low ≤ 0 ≤ high.
    """
    _, bound, nearest = _facets(columns, low, high, directions)
    return _where_known(low, high, np.take_along_axis(bound, nearest[..., None, :], axis=-2)[..., 0, :])


def greatest_forces(
    columns: Float[np.ndarray, "*batch task dof"],
    low: Float[np.ndarray, "*batch dof"],
    high: Float[np.ndarray, "*batch dof"],
    directions: Float[np.ndarray, "*#batch directions task"],
) -> Float[np.ndarray, "*batch directions"]:
    """Return the greatest force along each direction [N] with low ≤ Jᵀ f ≤ high; inf if no joint bears it."""
    shares = directions @ columns
    with np.errstate(divide="ignore", invalid="ignore"):
        bound = np.where(shares > 0, high[..., None, :], low[..., None, :]) / shares
    return _where_known(low, high, np.where(shares != 0, bound, np.inf).min(axis=-1))


def _where_known(low: np.ndarray, high: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values (*batch, directions), NaN if a joint's range is NaN."""
    return np.where((np.isnan(low) | np.isnan(high)).any(axis=-1)[..., None], np.nan, values)


def fastest_joint_speeds(
    columns: Float[np.ndarray, "batch task dof"],
    low: Float[np.ndarray, "batch dof"],
    high: Float[np.ndarray, "batch dof"],
    directions: Float[np.ndarray, "batch task"],
) -> tuple[Float[np.ndarray, " batch"], Float[np.ndarray, "batch dof"]]:
    """Return ``highest_speeds`` for one direction per posture, and joint speeds that reach them.

    On a facet, the joints whose columns span it have speeds that follow from the velocity; all others are at an end of
    their range.
    """
    faces, bound, index = _facets(columns, low, high, directions[:, None])
    rows = np.arange(len(faces))
    speeds = _where_known(low, high, bound[rows, index[:, 0]])[:, 0]
    vertices = directions * speeds[:, None]
    nearest = faces[rows, index[:, 0]]
    nearest = nearest * np.where((nearest * vertices).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    shares = np.einsum("ba,baj->bj", nearest, columns)
    size = np.linalg.norm(nearest, axis=1)[:, None] * np.linalg.norm(columns, axis=1)
    between = np.abs(shares) <= OPTIONS.orthogonal * size
    ends = np.where(between, 0.0, np.where(shares > 0, high, low))
    remainder = vertices - np.einsum("baj,bj->ba", columns, ends)
    dq = ends + np.einsum("bja,ba->bj", np.linalg.pinv(columns * between[:, None]), remainder)
    tolerance = OPTIONS.orthogonal * (high - low)
    missed = np.abs(np.einsum("baj,bj->ba", columns, dq) - vertices).max(axis=1)
    wrong = ((dq < low - tolerance) | (dq > high + tolerance)).any(axis=1)
    for row in np.flatnonzero(wrong | (missed > OPTIONS.orthogonal * np.linalg.norm(vertices, axis=1))):
        length = float(np.linalg.norm(vertices[row])) or 1.0
        _, dq[row] = furthest(columns[row], low[row], high[row], vertices[row] / length)
    return speeds, np.clip(dq, low, high)


def _facets(
    columns: np.ndarray, low: np.ndarray, high: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the normals, the value that each allows (*batch, normals, directions), and the strictest normal's index.

    For its choice, rounding errors are added to the values: they are large for normals nearly orthogonal to a
    direction.
    """
    faces = normals(columns)
    shares = faces @ columns
    one, other = shares * low[..., None, :], shares * high[..., None, :]
    ahead, behind = np.maximum(one, other).sum(axis=-1), -np.minimum(one, other).sum(axis=-1)
    along = faces @ np.swapaxes(directions, -1, -2)
    length = np.linalg.norm(faces, axis=-1)
    reach = np.sum(np.linalg.norm(columns, axis=-2) * np.maximum(-low, high), axis=-1)
    size = length[..., None] * np.linalg.norm(directions, axis=-1)[..., None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        bound = np.where(along > 0, ahead[..., None], behind[..., None]) / np.abs(along)
        rounding = 8 * np.finfo(float).eps * (length * reach[..., None])[..., None] / np.abs(along)
    crosses = np.abs(along) > OPTIONS.crossing * size
    nearest = np.where(crosses, bound + rounding, np.inf).argmin(axis=-2)
    return faces, np.where(crosses, bound, np.inf), nearest


# Capability of joints: speeds under a torque, torques, forces.


Quantity = Literal["velocity", "force"]


@dataclass(frozen=True, kw_only=True, eq=False)
class JointSpeeds:
    """The lowest and highest speed of every joint (*batch, dof) [rad/s, m/s]; NaN if it cannot bear its torque.

    ``front_low`` and ``front_high`` are the positions [m] of the front sliders that give them; 0 without sliders.
    """

    low: Joints
    high: Joints
    front_low: Joints
    front_high: Joints


def joint_speeds(actuation: Actuation, q: Joints, torque: Joints) -> JointSpeeds:
    """Return the speeds (*batch, dof) of joints under a torque, at the best positions of sliders."""
    if np.shape(q) != np.shape(torque) or np.shape(q)[-1:] != (actuation.dof,):
        raise InvalidInput(
            f"q and torque must have shape (..., {actuation.dof}), got {np.shape(q)} and {np.shape(torque)}"
        )
    high, low = (_joint_maxima(actuation, q, load, actuators.SPEED) for load in (torque, -torque))
    return JointSpeeds(low=-low[..., 0], high=high[..., 0], front_low=low[..., 1], front_high=high[..., 1])


def speeds_at_sliders(actuation: Actuation, q: Joints, torque: Joints, front: Joints) -> tuple[Joints, Joints]:
    """Return the lowest and highest joint speeds (*batch, dof) at positions of front sliders; NaN if overloaded."""
    ratios = actuation.ratios(q, front)
    efforts = ratios * torque[..., None, :]
    low, high = ((ratios * _fastest_motors(actuation, ratios, efforts, ahead)).sum(-2) for ahead in (False, True))
    return low, high


def torques_at_sliders(actuation: Actuation, q: Joints, front: Joints) -> Joints:
    """Return the torques (*batch, dof) [N m, N] that joints at rest can hold at positions of front sliders."""
    ratios, stall = actuation.ratios(q, front), np.stack([curve.stall for curve in actuation.curves])
    with np.errstate(divide="ignore"):  # a motor orthogonal to the joint's motion bears no load
        return np.asarray((stall / np.abs(ratios)).min(axis=-2))


def motor_speeds(
    actuation: Actuation,
    q: Float[np.ndarray, "*#batch dof"],
    front: Float[np.ndarray, "*#batch dof"],
    torque: Float[np.ndarray, "*#batch dof"],
    dq: Joints,
) -> tuple[Float[np.ndarray, "*batch motors dof"], Float[np.ndarray, "*#batch motors dof"]]:
    """Return the speeds and efforts of all motors that turn joints at dq under a torque.

    The sliders of a joint share its speed: each runs in proportion to its highest speed under its load.
    """
    ratios = actuation.ratios(q, front)
    efforts = ratios * torque[..., None, :]
    if isinstance(actuation, JointActuation):
        return dq[..., None, :], efforts
    fastest = _fastest_motors(actuation, ratios, efforts, dq[..., None, :] >= 0)
    highest = (ratios * fastest).sum(axis=-2)
    share = np.divide(dq, highest, out=np.zeros_like(dq), where=highest != 0)
    return share[..., None, :] * fastest, efforts


def _fastest_motors(actuation: Actuation, ratios: np.ndarray, efforts: np.ndarray, ahead: Any) -> np.ndarray:
    """Return the motor speeds (*batch, motors, dof) that turn joints fastest, ``ahead`` or back."""
    ends = [curve.speeds(efforts[..., m, :]) for m, curve in enumerate(actuation.curves)]
    low, high = (np.stack(speeds, axis=-2) for speeds in zip(*ends, strict=True))
    return np.where((ratios > 0) == ahead, high, low)


def torque_capacity(actuation: Actuation, q: Joints) -> tuple[Joints, Joints]:
    """Return the torques [N m, N] that joints at rest can hold, and positions of front sliders, both (*batch, dof).

    The sliders are at their best positions; torques are NaN if no position is possible.
    """
    maxima = _joint_maxima(actuation, q, np.zeros_like(q), actuators.HOLD)
    return maxima[..., 0], maxima[..., 1]


def quantities_along(quantity: object, count: int) -> tuple[Quantity, ...]:
    """Return the quantity along each direction, from one for all or a list; raises InvalidInput."""
    each: Any = (quantity,) * count if isinstance(quantity, str) else quantity
    valid = isinstance(each, Sequence) and len(each) == count and all(one in get_args(Quantity) for one in each)
    if not valid:
        raise InvalidInput(
            f"quantity must be one of {', '.join(get_args(Quantity))}, or a list of {count}, one per direction, "
            f"got {shown(quantity)}"
        )
    return tuple(each)


def overload_error(actuation: Actuation, arm: Arm, q: Joints, torque: Joints) -> Infeasible:
    """Return the error, naming the joint, of a posture (dof,) that motors cannot hold."""
    capacity, _ = torque_capacity(actuation, q)
    share = np.where(np.isnan(capacity), np.inf, np.abs(torque) / np.where(capacity > 0, capacity, 1e-300))
    worst = int(np.argmax(share))
    name = arm.joint_names[worst]
    if np.isnan(capacity[worst]):
        assert isinstance(actuation, DistributedActuation)
        angle = np.rad2deg(np.mod(actuation.angles(q)[worst] + np.pi, 2 * np.pi) - np.pi)
        lower, upper = np.rad2deg(actuation.angle_bounds[worst])
        return Infeasible(
            f"{name} must have a rod's angle that its sliders can reach, {lower:.4g}° to {upper:.4g}° (0 and 180° are "
            f"toggles), got {angle:.4g}°",
            limit=f"angle of {name}",
        )
    return Infeasible(
        f"{name} must bear a torque of at most {capacity[worst]:.4g} N m, the capacity of its motor there, "
        f"got {abs(torque[worst]):.4g} N m",
        limit=f"torque of {name}",
        violation=float(share[worst] - 1.0),
    )


def values_at(
    arm: Arm, actuation: Actuation, directions: Float[np.ndarray, "directions task"], quantity: Quantity, q: Joints
) -> Float[np.ndarray, "*batch directions"]:
    """Return the maxima along each direction in postures (*batch, dof); NaN if a joint cannot hold the arm."""
    columns = kinematics.jacobian(arm, q)[..., : directions.shape[1], :]
    torque = dynamics.gravity_torques(arm, q)
    if quantity == "velocity":
        speeds = joint_speeds(actuation, q, torque)
        return highest_speeds(columns, speeds.low, speeds.high, directions)
    capacity = torque_capacity(actuation, q)[0]
    capacity = np.where(np.abs(torque) <= capacity, capacity, np.nan)
    return greatest_forces(columns, -capacity - torque, capacity - torque, directions)


def _joint_maxima(actuation: Actuation, q: Joints, torque: Joints, quantity: int) -> np.ndarray:
    q, torque = (np.ascontiguousarray(each, dtype=float) for each in (q, torque))
    maxima = np.empty((q.size // actuation.dof, actuation.dof, 2))
    flat = (each.reshape(-1, actuation.dof) for each in (q, torque))
    actuators.joint_maxima(actuation.table, *flat, quantity, maxima)
    return maxima.reshape(*q.shape, 2)
