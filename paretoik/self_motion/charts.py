"""Coordinates of the self-motion manifold around base motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from paretoik.arrays import JointPaths
from paretoik.robot.scales import joint_scales
from paretoik.self_motion.motion_starts import OPTIONS as STARTS
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import relative_errors, retract, row_space_basis


@dataclass(frozen=True, kw_only=True, eq=False)
class Charts:
    """Coordinates around base motions: q = base + null_space · y, then along ``row_space`` onto the path.

    ``null_space`` spans that of the tasks' Jacobian along each base, transported without turning, ``row_space`` its row
    space. Both are orthonormal, slides measured in lengths of the arm, so y = null_spaceᵀ (q − base) gives the
    coordinates back.
    """

    base: Float[np.ndarray, "bases time dof"]
    null_space: Float[np.ndarray, "bases time dof redundancy"]
    row_space: Float[np.ndarray, "bases time dof rows"]

    def at(
        self, task: MotionTask, which: np.ndarray, y: Float[np.ndarray, "*batch time redundancy"]
    ) -> tuple[JointPaths, Bool[np.ndarray, "*batch time"]]:
        """Return motions at coordinates y around bases ``which``, and which of their samples are on the path.

        A sample whose correction jumps from that of the sample before has come to another sheet, and is off.
        """
        scales = joint_scales(task.arm)
        start = self.base[which] + np.einsum("ptdr,ptr->ptd", self.null_space[which], y) * scales
        retracted = retract(task.arm, task.tasks, start, task.targets, self.row_space[which] * scales[:, None])
        q, on_path = retracted.q, retracted.on_path
        base_step = np.abs(np.diff(start / scales, axis=1)).max(axis=2)
        on_path[:, 1:] &= np.abs(np.diff((q - start) / scales, axis=1)).max(axis=2) <= STARTS.longest_jump + base_step
        return q, on_path

    def coordinates(
        self, task: MotionTask, which: np.ndarray, q: JointPaths
    ) -> Float[np.ndarray, "*batch time redundancy"]:
        """Return the coordinates y of motions around bases ``which``."""
        return np.einsum("ptdr,ptd->ptr", self.null_space[which], (q - self.base[which]) / joint_scales(task.arm))


def build_charts(task: MotionTask, base: Float[np.ndarray, "bases time dof"]) -> Charts:
    """Return coordinates around base motions on the path."""
    jacobian = relative_errors(task.arm, task.tasks, base, task.targets)[1]
    null_space = np.linalg.svd(jacobian)[2][..., task.rows :, :].swapaxes(-1, -2)
    for i in range(1, base.shape[1]):  # parallel transport: each basis turned as near as can be to the one before
        left, _, right = np.linalg.svd(np.swapaxes(null_space[:, i], -1, -2) @ null_space[:, i - 1])
        null_space[:, i] = null_space[:, i] @ (left @ right)
    if task.cyclic:
        null_space = _close_frames(null_space, task.times / task.times[-1])
    return Charts(base=base, null_space=null_space, row_space=row_space_basis(jacobian))


def _close_frames(null_space: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Turn each basis evenly over time so that it closes with the motion."""
    from scipy.linalg import expm, logm  # here: only cyclic motions need it

    closed = null_space.copy()
    for b, basis in enumerate(null_space):
        turn = np.real(logm(basis[-1].T @ basis[0]))
        closed[b] = basis @ np.stack([expm(part * (turn - turn.T) / 2) for part in share])
    closed[:, -1] = closed[:, 0]
    return closed
