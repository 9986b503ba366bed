"""What an actuation lets every joint do: its range of speeds under a torque, and the torque it can hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from paretoik.arrays import Joints
from paretoik.capability.actuation import Actuation, DistributedActuation, JointActuation
from paretoik.capability.compiled import actuators
from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot.arm import Arm


@dataclass(frozen=True, kw_only=True, eq=False)
class JointSpeeds:
    """The lowest and highest speed of every joint, all (*batch, dof) [rad/s, m/s]; NaN where a joint cannot hold.

    ``front_low`` and ``front_high`` are the front sliders' positions [m] that attain them; 0 without sliders.
    """

    low: Joints
    high: Joints
    front_low: Joints
    front_high: Joints


def joint_speeds(actuation: Actuation, q: Joints, torque: Joints) -> JointSpeeds:
    """Return how fast each joint may turn while it holds a torque, sliders at their best; all (*batch, dof).

    Raises InvalidInput where the arrays don't fit.
    """
    high, low = (_best(actuation, q, turned, actuators.SPEED) for turned in (torque, -torque))
    return JointSpeeds(low=-low[..., 0], high=high[..., 0], front_low=low[..., 1], front_high=high[..., 1])


def speeds_at_sliders(actuation: Actuation, q: Joints, torque: Joints, front: Joints) -> tuple[Joints, Joints]:
    """Return the lowest and highest joint speeds with front sliders where they are, all (*batch, dof).

    NaN where a motor cannot bear the torque. Without sliders ``front`` is not looked at.
    """
    if isinstance(actuation, JointActuation):
        return actuation.motors.speeds(torque)
    ratios = actuation.gears(q, front)[1:]
    ends = [
        np.sort([ratio * speed for speed in curve.speeds(ratio * torque)], axis=0)
        for ratio, curve in zip(ratios, actuation.curves, strict=True)
    ]
    return ends[0][0] + ends[1][0], ends[0][1] + ends[1][1]


def torque_capacity(actuation: Actuation, q: Joints) -> tuple[Joints, Joints]:
    """Return the torque [N m, N] that each joint can hold at rest, and the front sliders for it; both (*batch, dof).

    NaN where no slider fits. Raises InvalidInput where the arrays don't fit.
    """
    found = _best(actuation, q, np.zeros_like(q), actuators.HOLD)
    return found[..., 0], found[..., 1]


def overload_error(actuation: Actuation, arm: Arm, q: Joints, torque: Joints) -> Infeasible:
    """Return the error that says which joint of one posture (dof,) cannot hold what, or has no slider that fits."""
    can, _ = torque_capacity(actuation, q)
    share = np.where(np.isnan(can), np.inf, np.abs(torque) / np.where(can > 0, can, 1e-300))
    worst = int(np.argmax(share))
    name = arm.joint_names[worst]
    if np.isnan(can[worst]):
        assert isinstance(actuation, DistributedActuation)
        angle = np.rad2deg(np.mod(actuation.angles(q)[worst] + np.pi, 2 * np.pi) - np.pi)
        least, most = np.rad2deg(actuation.angle_bounds[worst])
        return Infeasible(
            f"{name}: a rod's angle that its sliders can reach wanted, {least:.4g}° to {most:.4g}° (0 and 180° are "
            f"toggles), got {angle:.4g}°",
            limit=f"angle of {name}",
        )
    return Infeasible(
        f"{name}: a torque of at most {can[worst]:.4g} N m wanted, what its motor can hold there, "
        f"got {abs(torque[worst]):.4g} N m",
        limit=f"torque of {name}",
        violation=float(share[worst] - 1.0),
    )


def _best(actuation: Actuation, q: Joints, torque: Joints, what: int) -> np.ndarray:
    q, torque = (np.ascontiguousarray(each, dtype=float) for each in (q, torque))
    if q.shape != torque.shape or not q.ndim or q.shape[-1] != actuation.dof:
        raise InvalidInput(f"actuation: arrays (..., {actuation.dof}) wanted, got {q.shape} and {torque.shape}")
    found = np.empty((q.size // actuation.dof, actuation.dof, 2))
    actuators.joint_maxima(actuation.table, *(each.reshape(-1, actuation.dof) for each in (q, torque)), what, found)
    return found.reshape(*q.shape, 2)
