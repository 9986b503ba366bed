"""Why no posture at a position will do: out of reach, past joint limits, or overloaded; the errors that say so."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Joints
from paretoik.capability.actuation import Actuation
from paretoik.capability.joint_capability import overload_error, torque_capacity
from paretoik.capability.posture_values import gravity_torques
from paretoik.errors import Infeasible, OutOfReach, ParetoikError, SolverFailed
from paretoik.robot.arm import Arm


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


def postures_error(arm: Arm, actuation: Actuation, q: np.ndarray, position: np.ndarray) -> Infeasible:
    """Return the error of postures none of which can be held within limits."""
    inside = q[(limit_excess(arm, q) <= 0).all(axis=1)]
    return _overload_error(arm, actuation, inside) if len(inside) else _limit_error(arm, q, position)


def _overload_error(arm: Arm, actuation: Actuation, q: np.ndarray) -> Infeasible:
    """Return the error of the posture that is overloaded least."""
    least = int(np.argmin(overload(arm, actuation, q)))
    error = overload_error(actuation, arm, q[least], gravity_torques(arm, q[least]))
    message = f"{error}; that is the best of {len(q)} postures looked at"
    return Infeasible(message, limit=error.limit, violation=error.violation)


def _limit_error(arm: Arm, q: np.ndarray, position: np.ndarray) -> Infeasible:
    """Return the error of the posture that is least past its joints' limits."""
    excess = limit_excess(arm, q)
    least = int(np.argmin(excess.max(axis=1)))
    joint = int(np.argmax(excess[least]))
    return Infeasible(
        f"{arm.joint_names[joint]}: a position within its limits wanted, got {excess[least, joint]:.3g} rad or m "
        f"past them in the best of {len(q)} postures that reach {position.tolist()} m",
        limit=f"position of {arm.joint_names[joint]}",
    )


def planar_reach_error(table: tuple[np.ndarray, ...], position: np.ndarray) -> OutOfReach:
    """Return the error of a position that no posture of a planar arm with three joints reaches."""
    lengths, base = table[0], table[3][:2]
    least = max(0.0, 2 * float(lengths.max()) - float(lengths.sum()))
    return OutOfReach(
        f"position: {position.tolist()} m is {np.linalg.norm(position - base):.10g} m from the first joint, "
        f"the arm reaches from {least:.10g} m to {float(lengths.sum()):.10g} m",
        sample=0,
    )


def reach_error_at(error: ParetoikError, position: np.ndarray) -> ParetoikError:
    """Return the error of a task, told of the position: out of reach, or no posture was found."""
    if isinstance(error, OutOfReach):
        return OutOfReach(f"position out of reach: {str(error).split(': ', 1)[1]}", sample=0)
    return SolverFailed(f"position: no posture was found that reaches {position.tolist()} m; more samples may")
