"""Postures at a position, with sliders and speeds of joints in several directions: what they do, and within what."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Joints
from paretoik.capability.actuation import Actuation, DistributedActuation, speeds_with
from paretoik.capability.best_postures import loads
from paretoik.capability.zonotopes import fastest as highest
from paretoik.capability.zonotopes import turning
from paretoik.robot import kinematics
from paretoik.robot.arm import Arm
from paretoik.self_motion.postures import order_by_neighbour, wrap_difference
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors

APART = 0.1  # rad or m: postures nearer than this are one base
ROUNDING = 1e-9  # of ranges


@dataclass(frozen=True, kw_only=True, eq=False)
class Stance:
    """What genes say: postures ``q`` (points, dof), front sliders [m] (0 without), and tool speeds in each direction.

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
class Stances:
    """What is asked of an arm that stands ``still`` at a position, along ``directions`` (directions, task)."""

    arm: Arm
    actuation: Actuation
    still: MotionTask
    directions: Float[np.ndarray, "directions task"]

    def bases(self, found: Float[np.ndarray, "found dof"]) -> Float[np.ndarray, "bases dof"]:
        """Return postures that are not too near each other, each beside its neighbours."""
        kept = list[np.ndarray]()
        for one in found:
            if not kept or np.abs(wrap_difference(np.array(kept) - one, self.arm.periodic)).max(axis=1).min() > APART:
                kept.append(one)
        return order_by_neighbour(np.array(kept), self.arm.periodic)

    def frames(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return directions across the self-motion (batch, dof, rows) and along it (batch, dof, redundancy)."""
        targets = np.repeat(self.still.targets[:1], len(q), axis=0)
        slopes = np.moveaxis(task_errors(self.arm, self.still.tasks, q, targets)[1], -1, 0)
        turned = np.linalg.qr(np.swapaxes(slopes, -1, -2), mode="complete")[0]
        rows = slopes.shape[1]
        return turned[..., :rows], turned[..., rows:]

    def fastest(self, q: np.ndarray, front: np.ndarray) -> tuple[Stance, np.ndarray, np.ndarray]:
        """Return the fastest motions, the mean range of joint speeds (points,), and the self-motion's directions."""
        return self._fastest(q, front, *self._ranges(q, front))

    def _ranges(self, q: Joints, front: Joints) -> tuple[np.ndarray, ...]:
        """Return torques that hold the arm, lowest and highest joint speeds, 0 where a motor cannot, and who can."""
        torque = loads(self.arm, q)
        low, high = speeds_with(self.actuation, q, torque, front)
        able = ~np.isnan(high).any(axis=1)
        low, high = (np.where(able[:, None], each, 0.0) for each in (low, high))
        return torque, low, high, able

    def _fastest(
        self, q: Joints, front: Joints, torque: np.ndarray, low: np.ndarray, high: np.ndarray, able: np.ndarray
    ) -> tuple[Stance, np.ndarray, np.ndarray]:
        columns = kinematics.jacobian(self.arm, q)[:, : self.directions.shape[1]]
        speeds = highest(columns, low, high, self.directions)
        count = len(self.directions)
        every = [np.repeat(each, count, axis=0) for each in (columns, low, high)]
        vertices = (speeds[..., None] * self.directions).reshape(-1, self.directions.shape[1])
        dq = turning(every[0], every[1], every[2], vertices).reshape(len(q), count, -1)
        power = np.abs(torque[:, None] * dq).sum(axis=-1)
        excess = np.where(able, 0.0, 1.0)[:, None]
        span = np.maximum((high - low).mean(axis=1), 1e-12)
        return (
            Stance(q=q, front=front, speeds=speeds, dq=dq, power=power, excess=excess),
            span,
            self.frames(q)[1],
        )

    def moving(self, q: Joints, front: Joints, pace: np.ndarray, mixed: np.ndarray, lost: np.ndarray) -> Stance:
        """Return what joints do at a pace, moving along the self-motion besides, and which limits that violates."""
        torque, low, high, able = self._ranges(q, front)
        most, span, free = self._fastest(q, front, torque, low, high, able)
        dq = pace[..., None] * most.dq + span[:, None, None] * np.einsum("pjr,pkr->pkj", free, mixed)
        beyond = np.maximum(dq - high[:, None], low[:, None] - dq) / span[:, None, None]
        lower, upper = self.arm.position_limits.T
        past = np.maximum(np.maximum(q - upper, lower - q).max(axis=1), -1.0)
        excess = [lost.astype(float), past, most.excess[:, 0], self._slid_past(q, front)]
        excess.append(np.where(most.excess[:, 0] > 0, 0.0, beyond.max(axis=(1, 2)) - ROUNDING))
        return Stance(
            q=q,
            front=front,
            speeds=pace * most.speeds,
            dq=dq,
            power=np.abs(torque[:, None] * dq).sum(axis=-1),
            excess=np.stack(excess, axis=1),
        )

    def _slid_past(self, q: np.ndarray, front: np.ndarray) -> np.ndarray:
        """Return by how much back sliders, and sines of rods' angles, are past their bounds, as shares of the rod."""
        known = self.actuation
        if not isinstance(known, DistributedActuation):
            return np.zeros(len(q))
        back, angle = known.gears(q, front)[0], known.angles(q)
        low, high = known.back_bounds.T
        past = np.maximum(back - high, low - back) / known.rod
        turned = np.sin(known.least_angle) - np.sin(angle)
        found: np.ndarray = np.maximum(past, turned).max(axis=1) - ROUNDING
        return found

    def shared(self, at: Stance, torque: np.ndarray) -> np.ndarray:
        """Return slider speeds (points, directions, 2, dof) that turn the joints: each in proportion to its most."""
        assert isinstance(self.actuation, DistributedActuation)
        ratios = np.stack(self.actuation.gears(at.q, at.front)[1:], axis=1)
        efforts = ratios * torque[:, None]
        ends = [curve.speeds(efforts[:, m]) for m, curve in enumerate(self.actuation.curves)]
        low, high = (np.stack([end[side] for end in ends], axis=1) for side in (0, 1))
        ahead = at.dq[:, :, None] > 0
        most = np.where((ratios > 0)[:, None] == ahead, high[:, None], low[:, None])
        reach = (ratios[:, None] * most).sum(axis=2)
        share = np.divide(at.dq, reach, out=np.zeros_like(at.dq), where=reach != 0)
        found: np.ndarray = share[:, :, None] * most
        return found
