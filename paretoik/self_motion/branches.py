"""Branches: which way each joint is bent, as labels of whole motions."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import jacobian, link_nodes
from paretoik.robot.scales import characteristic_length
from paretoik.task.motion import Motion

SINE_TOLERANCE = 1e-9  # of the angle between axes that count as parallel, or a joint that counts as straight


def bend_signs(arm: Arm, q: Float[np.ndarray, "*batch dof"]) -> Int[np.ndarray, "*batch inner"]:
    """Return the sign in which every inner joint is bent, 0 where it is straight: shoulder, elbow, wrist.

    For three consecutive axes that are not parallel it is the sign of their triple product; for parallel ones that of
    the turn from one link to the next. It changes just where a joint aligns its neighbours. Arms of two joints or fewer
    have none.
    """
    if arm.dof < 3:
        return np.zeros((*q.shape[:-1], 0), dtype=int)
    axes, origins = _axes(arm, q), link_nodes(arm, q)[..., 1:, :]
    before, here, after = axes[..., :-2, :], axes[..., 1:-1, :], axes[..., 2:, :]
    product = np.sum(np.cross(before, after) * here, axis=-1)
    links = np.diff(origins, axis=-2) / characteristic_length(arm)
    turn = np.sum(np.cross(links[..., :-1, :], links[..., 1:, :]) * axes[..., 1:, :], axis=-1)
    parallel = _always_parallel(arm)
    inner = np.where(parallel, turn[..., : arm.dof - 2], product)
    last = turn[..., arm.dof - 2 :] if parallel[-1] else np.zeros((*q.shape[:-1], 0))
    signed = np.concatenate([inner, last], axis=-1)
    return np.where(np.abs(signed) < SINE_TOLERANCE, 0, np.sign(signed)).astype(int)


def branch_labels(motion: Motion) -> list[str]:
    """Return a label for each motion of a batch (motions, time, dof), such as ``+-`` or ``+~``.

    One sign per inner joint: how it is bent over the whole motion, or ``~`` where it passes through straight, followed
    by the sign it ends with.
    """
    signs = bend_signs(motion.arm, motion.q)
    constant = np.logical_or((signs >= 0).all(axis=-2), (signs <= 0).all(axis=-2))
    return [
        "".join(
            ("" if is_constant else "~") + "-0+"[sign + 1] for sign, is_constant in zip(ends, constant_all, strict=True)
        )
        for ends, constant_all in zip(signs[..., -1, :], np.atleast_2d(constant), strict=True)
    ]


def _axes(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Return the direction of every joint's axis in the world (*batch, dof, 3)."""
    columns = np.swapaxes(jacobian(arm, q), -1, -2)
    return np.where(arm.periodic[:, None], columns[..., 3:], columns[..., :3])


def _always_parallel(arm: Arm) -> np.ndarray:
    """Return for every inner joint whether the axes on either side of it are parallel at all postures."""
    axes = _axes(arm, np.arange(1.0, arm.dof + 1))  # a posture like any other
    return np.all(np.abs(np.cross(axes[:-2], axes[2:])) < SINE_TOLERANCE, axis=-1)
