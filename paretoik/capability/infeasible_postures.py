"""Which postures are feasible, and errors where none is: out of reach, past joint limits, or overloaded."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from paretoik.arrays import Joints
from paretoik.capability.actuation import Actuation
from paretoik.capability.joint_capability import joint_speeds, overload_error, torque_capacity
from paretoik.errors import Infeasible, OutOfReach, ParetoikError, SolverFailed
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques


def limit_excess(arm: Arm, q: Joints) -> Joints:
    """Return by how much joints (*batch, dof) are past their limits [rad, m], negative within."""
    lower, upper = arm.position_limits.T
    return np.asarray(np.maximum(q - upper, lower - q))


def overload(
    arm: Arm, actuation: Actuation, q: Joints, *, without_slider: float = 1e6
) -> Float[np.ndarray, " postures"]:
    """Return the largest load of any joint as a share of what its motor can hold; a number where no slider fits."""
    torque, (capacity, _) = gravity_torques(arm, q), torque_capacity(actuation, q)
    share = np.abs(torque) / np.where(capacity > 0, capacity, 1e-300)
    share = np.where(np.isnan(capacity), without_slider, share)
    return np.asarray(share.max(axis=1))


def can_hold(arm: Arm, actuation: Actuation, q: Joints) -> Bool[np.ndarray, " postures"]:
    """Return in which postures (postures, dof) the motors can hold the arm."""
    speeds = joint_speeds(actuation, q, gravity_torques(arm, q))
    return np.asarray(~np.isnan(speeds.high).any(axis=1))


def postures_error(arm: Arm, actuation: Actuation, q: np.ndarray, position: np.ndarray) -> Infeasible:
    """Return the error of postures none of which can be held within limits: of the one that comes nearest to it."""
    excess = limit_excess(arm, q)
    inside = q[(excess <= 0).all(axis=1)]
    if len(inside):
        best = inside[np.argmin(overload(arm, actuation, inside))]
        error = overload_error(actuation, arm, best, gravity_torques(arm, best))
        message = f"{error}; that is the best of {len(inside)} postures looked at"
        return Infeasible(message, limit=error.limit, violation=error.violation)
    row = int(np.argmin(excess.max(axis=1)))
    joint = int(np.argmax(excess[row]))
    return Infeasible(
        f"{arm.joint_names[joint]}: a position within its limits wanted, got {excess[row, joint]:.3g} rad or m "
        f"past them in the best of {len(q)} postures that reach {position.tolist()} m",
        limit=f"position of {arm.joint_names[joint]}",
    )


def planar_reach_error(table: tuple[np.ndarray, ...], position: np.ndarray) -> OutOfReach:
    """Return the error of a position that no posture of a planar arm with three joints reaches."""
    lengths, base = table[0], table[3][:2]
    shortest = max(0.0, 2 * float(lengths.max()) - float(lengths.sum()))
    return OutOfReach(
        f"position: {position.tolist()} m is {np.linalg.norm(position - base):.10g} m from the first joint, "
        f"the arm reaches from {shortest:.10g} m to {float(lengths.sum()):.10g} m",
        sample=0,
    )


def reach_error_at(error: ParetoikError, position: np.ndarray) -> ParetoikError:
    """Return the error of a task as one of a position: out of reach, or no posture was found."""
    if isinstance(error, OutOfReach):
        return OutOfReach(f"position out of reach: {str(error).split(': ', 1)[1]}", sample=0)
    return SolverFailed(f"position: no posture was found that reaches {position.tolist()} m; more samples may")
