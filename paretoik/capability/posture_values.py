"""What an arm can do in given postures: the most along each direction, with the torques that hold it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Joints
from paretoik.capability.actuation import Actuation
from paretoik.capability.directional_program import Quantity
from paretoik.capability.joint_capability import joint_speeds, torque_capacity
from paretoik.capability.zonotopes import greatest_forces, highest_speeds
from paretoik.robot import dynamics, kinematics
from paretoik.robot.arm import Arm


def gravity_torques(arm: Arm, q: Joints) -> Joints:
    """Return the torques (*batch, dof) [N m, N] that hold the arm at rest."""
    return dynamics.inverse_dynamics(arm, q, np.zeros_like(q), np.zeros_like(q))


def values_at(
    arm: Arm, actuation: Actuation, directions: Float[np.ndarray, "directions task"], quantity: Quantity, q: Joints
) -> Float[np.ndarray, "*batch directions"]:
    """Return the most along each direction in given postures (*batch, dof); NaN where a joint cannot hold."""
    columns = kinematics.jacobian(arm, q)[..., : directions.shape[1], :]
    low, high = _joint_ranges(arm, actuation, quantity, q)
    return (highest_speeds if quantity == "velocity" else greatest_forces)(columns, low, high, directions)


def _joint_ranges(arm: Arm, actuation: Actuation, quantity: Quantity, q: Joints) -> tuple[Joints, Joints]:
    """Return the lowest and highest speeds, or added torques, of every joint; NaN where it cannot hold the arm."""
    torque = gravity_torques(arm, q)
    if quantity == "velocity":
        speeds = joint_speeds(actuation, q, torque)
        return speeds.low, speeds.high
    capacity = torque_capacity(actuation, q)[0]
    capacity = np.where(np.abs(torque) <= capacity, capacity, np.nan)
    return -capacity - torque, capacity - torque
