"""Configurations at a position: posture, sliders, and joint speeds in several directions, with their limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Joints
from paretoik.capability.actuation import Actuation, DistributedActuation
from paretoik.capability.joint_capability import motor_speeds, speeds_at_sliders
from paretoik.capability.posture_maxima import fastest_joint_speeds
from paretoik.robot import kinematics
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques
from paretoik.self_motion.start_postures import order_by_neighbour, wrap_difference
from paretoik.task.limits import LIMIT_TOLERANCE
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors


@dataclass(frozen=True, kw_only=True, eq=False)
class Configuration:
    """Decoded genes: postures ``q`` (points, dof), front sliders [m] (0 without), and tool speeds in each direction.

    ``speeds`` (points, directions) [m/s] with joint velocities ``dq`` (points, directions, dof), the ``power`` that
    each takes [W], and by how much each kind of limit is violated, ``excess`` (points, limits): whether the position
    is missed, rad or m, whether motors are overloaded, shares of the rod, shares of the mean range of joint speeds.
    """

    q: Float[np.ndarray, "points dof"]
    front: Float[np.ndarray, "points dof"]
    speeds: Float[np.ndarray, "points directions"]
    dq: Float[np.ndarray, "points directions dof"]
    power: Float[np.ndarray, "points directions"]
    excess: Float[np.ndarray, "points limits"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Configurations:
    """Configurations of an arm with its tool at rest, the task ``stationary``, and ``directions`` (count, task)."""

    arm: Arm
    actuation: Actuation
    stationary: MotionTask
    directions: Float[np.ndarray, "directions task"]

    def bases(self, q: Float[np.ndarray, "postures dof"]) -> Float[np.ndarray, "bases dof"]:
        """Return postures no nearer to each other than 0.1 rad or m, each beside its neighbours."""
        bases = list[np.ndarray]()
        for posture in q:
            distances = np.abs(wrap_difference(np.reshape(bases, (-1, len(posture))) - posture, self.arm.periodic))
            if distances.max(axis=1).min(initial=np.inf) > 0.1:
                bases.append(posture)
        return order_by_neighbour(self.arm, np.array(bases))

    def frames(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return directions across the self-motion (batch, dof, rows) and along it (batch, dof, redundancy)."""
        jacobian = task_errors(self.arm, self.stationary.tasks, q, self.stationary.targets[0])[1]
        basis = np.linalg.qr(jacobian.swapaxes(-1, -2), mode="complete")[0]
        rows = self.stationary.rows
        return basis[..., :rows], basis[..., rows:]

    def fastest(self, q: np.ndarray, front: np.ndarray) -> tuple[Configuration, np.ndarray, np.ndarray]:
        """Return the fastest motions, the mean range of joint speeds (points,), and the self-motion's directions."""
        return self._fastest(q, front, *self._ranges(q, front))

    def _ranges(self, q: Joints, front: Joints) -> tuple[np.ndarray, ...]:
        """Return torques that hold the arm, lowest and highest joint speeds, 0 where a motor cannot, and who can."""
        torque = gravity_torques(self.arm, q)
        low, high = speeds_at_sliders(self.actuation, q, torque, front)
        holds = ~np.isnan(high).any(axis=1)
        low, high = (np.where(holds[:, None], each, 0.0) for each in (low, high))
        return torque, low, high, holds

    def _fastest(
        self, q: Joints, front: Joints, torque: np.ndarray, low: np.ndarray, high: np.ndarray, holds: np.ndarray
    ) -> tuple[Configuration, np.ndarray, np.ndarray]:
        columns = kinematics.jacobian(self.arm, q)[:, : self.directions.shape[1]]
        count = len(self.directions)
        columns, low, high = (np.repeat(each, count, axis=0) for each in (columns, low, high))
        speeds, dq = fastest_joint_speeds(columns, low, high, np.tile(self.directions, (len(q), 1)))
        speeds, dq = speeds.reshape(len(q), count), dq.reshape(len(q), count, -1)
        power = np.abs(torque[:, None] * dq).sum(axis=-1)
        excess = np.where(holds, 0.0, 1.0)[:, None]
        span = np.maximum((high[::count] - low[::count]).mean(axis=1), 1e-12)
        return (
            Configuration(q=q, front=front, speeds=speeds, dq=dq, power=power, excess=excess),
            span,
            self.frames(q)[1],
        )

    def with_speeds(
        self, q: Joints, front: Joints, pace: np.ndarray, self_motion: np.ndarray, off_path: np.ndarray
    ) -> Configuration:
        """Return configurations at a pace, with speeds along the self-motion, and by how much limits are violated."""
        torque, low, high, holds = self._ranges(q, front)
        best, span, free = self._fastest(q, front, torque, low, high, holds)
        dq = pace[..., None] * best.dq + span[:, None, None] * np.einsum("pjr,pkr->pkj", free, self_motion)
        speed_excess = np.maximum(dq - high[:, None], low[:, None] - dq) / span[:, None, None]
        lower, upper = self.arm.position_limits.T
        limit_excess = np.maximum(np.maximum(q - upper, lower - q).max(axis=1), -1.0)
        excess = [off_path.astype(float), limit_excess, best.excess[:, 0], self._slider_excess(q, front)]
        excess.append(np.where(best.excess[:, 0] > 0, 0.0, speed_excess.max(axis=(1, 2)) - LIMIT_TOLERANCE))
        return Configuration(
            q=q,
            front=front,
            speeds=pace * best.speeds,
            dq=dq,
            power=np.abs(torque[:, None] * dq).sum(axis=-1),
            excess=np.stack(excess, axis=1),
        )

    def _slider_excess(self, q: np.ndarray, front: np.ndarray) -> np.ndarray:
        """Return by how much back sliders, and sines of rods' angles, are past their bounds, as shares of the rod."""
        sliders = self.actuation
        if not isinstance(sliders, DistributedActuation):
            return np.zeros(len(q))
        back, angle = sliders.gears(q, front)[0], sliders.angles(q)
        low, high = sliders.back_bounds.T
        back_excess = np.maximum(back - high, low - back) / sliders.rod
        angle_excess = np.sin(sliders.least_angle) - np.sin(angle)
        values: np.ndarray = np.maximum(back_excess, angle_excess).max(axis=1) - LIMIT_TOLERANCE
        return values

    def slider_speeds(self, at: Configuration, torque: np.ndarray) -> np.ndarray:
        """Return slider speeds (points, directions, 2, dof) that turn the joints: each in proportion to its best."""
        return motor_speeds(self.actuation, at.q[:, None], at.front[:, None], torque[:, None], at.dq)[0]
