"""Configurations at a position: posture, sliders, joint speeds and forces in several directions, with their limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from paretoik.arrays import Joints
from paretoik.capability.actuation import Actuation, DistributedActuation
from paretoik.capability.joint_capability import (
    Quantity,
    motor_speeds,
    speeds_at_sliders,
    torque_capacity,
    torques_at_sliders,
    values_at,
)
from paretoik.capability.posture_maxima import OPTIONS as FACETS
from paretoik.capability.posture_maxima import fastest_joint_speeds, greatest_forces
from paretoik.errors import InvalidInput
from paretoik.robot import kinematics
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques
from paretoik.self_motion.start_postures import order_by_neighbour, wrap_difference
from paretoik.task.limits import LIMIT_TOLERANCE
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors


@dataclass(frozen=True, kw_only=True, eq=False)
class Configuration:
    """Decoded genes: postures ``q`` (points, dof), front sliders [m] (0 without), and what the tool does each way.

    ``values`` (points, directions) are the tool's speeds [m/s] or forces [N], inf where no joint has to bear a force.
    The speeds have joint velocities ``dq`` (points, speeds, dof) and take ``power`` (points, speeds) [W]. ``excess``
    (points, limits) says by how much each kind of limit is violated: whether the position is missed, rad or m, whether
    motors are overloaded, shares of the rod, shares of the mean range of joint speeds.
    """

    q: Float[np.ndarray, "points dof"]
    front: Float[np.ndarray, "points dof"]
    values: Float[np.ndarray, "points directions"]
    dq: Float[np.ndarray, "points speeds dof"]
    power: Float[np.ndarray, "points speeds"]
    excess: Float[np.ndarray, "points limits"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Configurations:
    """Configurations of an arm with its tool at rest, the task ``stationary``, and ``directions`` (count, task).

    ``quantities`` are what is wanted along each.
    """

    arm: Arm
    actuation: Actuation
    stationary: MotionTask
    directions: Float[np.ndarray, "directions task"]
    quantities: tuple[Quantity, ...]

    @cached_property
    def moving(self) -> Bool[np.ndarray, " directions"]:
        """Along which directions speeds are wanted, not forces."""
        return np.array([quantity == "velocity" for quantity in self.quantities])

    def bases(self, q: Float[np.ndarray, "postures dof"]) -> Float[np.ndarray, "bases dof"]:
        """Return postures no nearer to each other than 0.1 rad or m, each beside its neighbours."""
        bases = list[np.ndarray]()
        for posture in q:
            distances = np.abs(wrap_difference(np.reshape(bases, (-1, len(posture))) - posture, self.arm.periodic))
            if distances.max(axis=1).min(initial=np.inf) > 0.1:
                bases.append(posture)
        return order_by_neighbour(self.arm, np.array(bases))

    def sizes(self, q: Float[np.ndarray, "postures dof"]) -> Float[np.ndarray, " directions"]:
        """Return for each direction the highest speed [m/s], or force [N], of postures along any, at best sliders.

        Raises InvalidInput, naming the direction, for a force that no motor bounds in any posture.
        """
        sizes, moving = np.empty(len(self.directions)), self.moving
        if moving.any():
            sizes[moving] = np.nanmax(values_at(self.arm, self.actuation, self.directions[moving], "velocity", q))
        if moving.all():
            return sizes
        if not any(np.isfinite(curve.stall).any() for curve in self.actuation.curves):
            raise InvalidInput("actuation: a motor with a finite stall wanted, to bound forces, got none")
        columns = kinematics.jacobian(self.arm, q)[:, : self.directions.shape[1]]
        shares, lengths = np.abs(self.directions @ columns), np.linalg.norm(columns, axis=1)
        limited = np.isfinite(torque_capacity(self.actuation, q)[0])
        bears = ((shares > FACETS.orthogonal * lengths[:, None]) & limited[:, None]).any(axis=2)
        for k in np.flatnonzero(~moving & ~bears.any(axis=0)):
            raise InvalidInput(
                f"direction {k + 1}: a force that some motor of {self.arm.name} has to bear wanted, got "
                f"{self.directions[k].round(4).tolist()}, along which none has to: it has no bounds"
            )
        forces = values_at(self.arm, self.actuation, self.directions[~moving], "force", q)
        sizes[~moving] = forces[bears[:, ~moving]].max()
        return sizes

    def frames(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return directions across the self-motion (batch, dof, rows) and along it (batch, dof, redundancy)."""
        jacobian = task_errors(self.arm, self.stationary.tasks, q, self.stationary.targets[0])[1]
        basis = np.linalg.qr(jacobian.swapaxes(-1, -2), mode="complete")[0]
        rows = self.stationary.rows
        return basis[..., :rows], basis[..., rows:]

    def maxima(self, q: np.ndarray, front: np.ndarray) -> tuple[Configuration, np.ndarray, np.ndarray]:
        """Return the maxima, the mean range of joint speeds (points,), and the self-motion's directions."""
        return self._maxima(q, front, *self._ranges(q, front))

    def _ranges(self, q: Joints, front: Joints) -> tuple[np.ndarray, ...]:
        """Return torques that hold the arm, lowest and highest joint speeds, 0 where a motor cannot, and who can."""
        torque = gravity_torques(self.arm, q)
        low, high = speeds_at_sliders(self.actuation, q, torque, front)
        holds = ~np.isnan(high).any(axis=1)
        low, high = (np.where(holds[:, None], each, 0.0) for each in (low, high))
        return torque, low, high, holds

    def _maxima(
        self, q: Joints, front: Joints, torque: np.ndarray, low: np.ndarray, high: np.ndarray, holds: np.ndarray
    ) -> tuple[Configuration, np.ndarray, np.ndarray]:
        columns = kinematics.jacobian(self.arm, q)[:, : self.directions.shape[1]]
        values, count = np.empty((len(q), len(self.directions))), int(self.moving.sum())
        at_each, lowest, highest = (np.repeat(each, count, axis=0) for each in (columns, low, high))
        ways = np.tile(self.directions[self.moving], (len(q), 1))
        speeds, dq = fastest_joint_speeds(at_each, lowest, highest, ways)
        values[:, self.moving], dq = speeds.reshape(len(q), count), dq.reshape(len(q), count, q.shape[1])
        capacity = np.where(holds[:, None], torques_at_sliders(self.actuation, q, front), np.abs(torque))
        downwards, upwards = np.minimum(-capacity - torque, 0.0), np.maximum(capacity - torque, 0.0)
        forces = greatest_forces(columns, downwards, upwards, self.directions[~self.moving])
        values[:, ~self.moving] = np.where(holds[:, None], forces, 0.0)
        power = np.abs(torque[:, None] * dq).sum(axis=-1)
        excess = np.where(holds, 0.0, 1.0)[:, None]
        span = np.maximum((high - low).mean(axis=1), 1e-12)
        return (
            Configuration(q=q, front=front, values=values, dq=dq, power=power, excess=excess),
            span,
            self.frames(q)[1],
        )

    def at_pace(
        self, q: Joints, front: Joints, pace: np.ndarray, self_motion: np.ndarray, off_path: np.ndarray
    ) -> Configuration:
        """Return configurations at shares of their highest speeds, ``pace`` (points, speeds), with all excesses.

        Joints move along the self-motion too, (points, speeds, redundancy), in mean ranges of their speeds. Forces are
        the greatest: less would save nothing.
        """
        torque, low, high, holds = self._ranges(q, front)
        best, span, free = self._maxima(q, front, torque, low, high, holds)
        along = np.einsum("pjr,pkr->pkj", free, self_motion)
        dq = pace[..., None] * best.dq + span[:, None, None] * along
        speed_excess = np.maximum(dq - high[:, None], low[:, None] - dq) / span[:, None, None]
        values = best.values.copy()
        values[:, self.moving] *= pace
        lower, upper = self.arm.position_limits.T
        limit_excess = np.maximum(np.maximum(q - upper, lower - q).max(axis=1), -1.0)
        excess = [off_path.astype(float), limit_excess, best.excess[:, 0], self._slider_excess(q, front)]
        shares = speed_excess.max(axis=(1, 2), initial=-1.0) - LIMIT_TOLERANCE
        excess.append(np.where(best.excess[:, 0] > 0, 0.0, shares))
        return Configuration(
            q=q,
            front=front,
            values=values,
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
