"""In which postures an arm can do most: planar arms of three joints all around, others climbed to from many."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Joints
from paretoik.convex.sequential import minimised
from paretoik.errors import EvaluationFailed, Infeasible, OutOfReach, ParetoikError
from paretoik.redundancy import planar_maxima
from paretoik.redundancy.capability import Capability, Quantity
from paretoik.redundancy.self_motion import postures, unreachable
from paretoik.redundancy.self_motion_curves import wrapped
from paretoik.redundancy.zonotopes import fastest, strongest
from paretoik.robot import dynamics, kinematics, motors
from paretoik.robot.actuation import Actuation, holding, joint_speeds, overloaded
from paretoik.robot.arm import Arm
from paretoik.task.curves import Line
from paretoik.task.motion_task import MotionTask, motion_task
from paretoik.task.objectives import joint_travel
from paretoik.task.path import Path

KEPT = 5  # postures that are climbed from, for each direction
APART = 0.5  # rad or m: how far from each other they are at least, in some joint
SAME = 1e-12  # a planar arm this little tilted is not
HELD = 1e-8  # violation of a climbed posture's program up to which it counts


def best_postures(
    arm: Arm,
    actuation: Actuation,
    position: Float[np.ndarray, " task"],
    directions: Float[np.ndarray, "directions task"],
    quantity: Quantity,
    *,
    samples: int,
    rng: np.random.Generator,
) -> Float[np.ndarray, "directions dof"]:
    """Return for each direction the posture at a position in which most can be done along it.

    Raises OutOfReach and Infeasible as ``directional_maxima`` does.
    """
    table = _planar(arm)
    if table is not None:
        return _swept(table, arm, actuation, position, directions, quantity, samples, rng)
    return _climbed(arm, actuation, position, directions, quantity, samples, rng)


def loads(arm: Arm, q: Joints) -> Joints:
    """Return the torques (*batch, dof) [N m, N] that hold the arm still."""
    return dynamics.inverse_dynamics(arm, q, np.zeros_like(q), np.zeros_like(q))


def values_at(
    arm: Arm, actuation: Actuation, directions: Float[np.ndarray, "directions task"], quantity: Quantity, q: Joints
) -> Float[np.ndarray, "*batch directions"]:
    """Return the most along each direction in given postures (*batch, dof); NaN where a joint cannot hold."""
    columns = kinematics.jacobian(arm, q)[..., : directions.shape[1], :]
    low, high = _able(arm, actuation, quantity, q)
    return (fastest if quantity == "velocity" else strongest)(columns, low, high, directions)


def _able(arm: Arm, actuation: Actuation, quantity: Quantity, q: Joints) -> tuple[Joints, Joints]:
    """Return between which speeds, or added torques, every joint can be; NaN where it cannot hold the arm."""
    torque = loads(arm, q)
    if quantity == "velocity":
        speeds = joint_speeds(actuation, q, torque)
        return speeds.low, speeds.high
    most = holding(actuation, q)[0]
    most = np.where(np.abs(torque) <= most, most, np.nan)
    return -most - torque, most - torque


@lru_cache(maxsize=64)
def _planar(arm: Arm) -> tuple[np.ndarray, ...] | None:
    """Return what ``planar_maxima`` reads of an arm; None where it is none in the plane with three turning joints."""
    upright = abs(arm.base.rotation[2, 2] - 1.0) <= SAME
    if not (arm.is_planar and arm.dof == 3 and arm.periodic.all() and upright):
        return None
    steps = [arm.placements[1].position, arm.placements[2].position, arm.tool.position]
    lengths = np.array([np.hypot(step[0], step[1]) for step in steps])
    if not (lengths > 0).all():
        return None
    turned = np.array([np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0]) for pose in arm.placements])
    offsets = np.array([np.arctan2(step[1], step[0]) for step in steps])
    first = arm.base.position + arm.base.rotation @ arm.placements[0].position
    lying = np.arctan2(arm.base.rotation[1, 0], arm.base.rotation[0, 0])
    weights = np.array([[body.mass, *body.center[:2]] for body in arm.bodies] + [[*arm.gravity[:2], 0.0]])
    return lengths, turned, offsets, np.array([first[0], first[1], lying]), weights, np.array(arm.position_limits)


def _swept(
    table: tuple[np.ndarray, ...],
    arm: Arm,
    actuation: Actuation,
    position: np.ndarray,
    directions: np.ndarray,
    quantity: Quantity,
    samples: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return the best postures of a planar arm with three joints."""
    values, q = np.empty(len(directions)), np.empty((len(directions), arm.dof))
    what = motors.SPEED if quantity == "velocity" else motors.HOLD
    if not planar_maxima.maxima((table, actuation.table, position, what), directions, values, q):
        raise _out_of_reach(table, position)
    if (values < 0).any():
        raise _cannot_hold(arm, actuation, several_postures(arm, position, samples, rng))
    return q


def _climbed(
    arm: Arm,
    actuation: Actuation,
    position: np.ndarray,
    directions: np.ndarray,
    quantity: Quantity,
    samples: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return the best postures of an arm of any kind: the best of many, climbed from."""
    q = several_postures(arm, position, samples, rng)
    found = values_at(arm, actuation, directions, quantity, q)
    able = np.isfinite(found).all(axis=1) if quantity == "velocity" else ~np.isnan(found).any(axis=1)
    if not able.any():
        raise _cannot_hold(arm, actuation, q)
    q, found = q[able], found[able]
    asked = Capability(arm=arm, actuation=actuation, quantity=quantity, count=1)
    cost = np.zeros(asked.unknowns)
    cost[asked.begins["values"]] = -1.0
    best = np.empty((len(directions), arm.dof))
    for k, direction in enumerate(directions):
        tried = _apart(arm, q[np.argsort(-found[:, k], kind="stable")])
        size = float(found[:, k].max())
        if 0 < size < np.inf:
            program = asked.program(position, direction[None], size)
            ends = [minimised(program, cost, asked.begun(each)) for each in tried]
            tried += [asked.parts(end.z, size)["q"] for end in ends if end.violation <= HELD]
        values = values_at(arm, actuation, direction[None], quantity, np.array(tried))[:, 0]
        best[k] = tried[int(np.nanargmax(values))]
    return best


def _apart(arm: Arm, q: np.ndarray) -> list[np.ndarray]:
    """Return the first few postures that are not near each other."""
    found = [q[0]]
    for one in q[1:]:
        if len(found) == KEPT:
            break
        if np.abs(wrapped(np.array(found) - one, arm.periodic)).max(axis=1).min() > APART:
            found.append(one)
    return found


def several_postures(arm: Arm, position: np.ndarray, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Return postures that reach a position within the arm's limits."""
    task = held_still(arm, position)
    found = postures(task, samples, rng)
    if not len(found):
        raise _renamed(unreachable(task, rng, 0), position)
    lower, upper = arm.position_limits.T
    inside = ((found >= lower) & (found <= upper)).all(axis=1)
    if not inside.any():
        excess = np.maximum(found - upper, lower - found)
        least = int(np.argmin(excess.max(axis=1)))
        joint = int(np.argmax(excess[least]))
        raise Infeasible(
            f"{arm.joint_names[joint]}: a position within its limits wanted, got {excess[least, joint]:.3g} rad or m "
            f"past them in the best of {len(found)} postures that reach {position.tolist()} m",
            limit=f"position of {arm.joint_names[joint]}",
        )
    return found[inside]


def _cannot_hold(arm: Arm, actuation: Actuation, q: np.ndarray) -> Infeasible:
    """Return the error of the posture that is overloaded least."""
    torque, (able, _) = loads(arm, q), holding(actuation, q)
    share = np.where(np.isnan(able), 1e6, np.abs(torque) / np.where(able > 0, able, 1e-300))
    least = int(np.argmin(np.sort(share, axis=1)[:, ::-1] @ 1e-3 ** np.arange(arm.dof)))
    return overloaded(actuation, arm, q[least], torque[least])


def _out_of_reach(table: tuple[np.ndarray, ...], position: np.ndarray) -> OutOfReach:
    lengths, base = table[0], table[3][:2]
    least = max(0.0, 2 * float(lengths.max()) - float(lengths.sum()))
    return OutOfReach(
        f"position: {position.tolist()} m is {np.linalg.norm(position - base):.4g} m from the first joint, "
        f"the arm reaches from {least:.4g} m to {float(lengths.sum()):.4g} m",
        sample=0,
    )


def _renamed(error: ParetoikError, position: np.ndarray) -> ParetoikError:
    if isinstance(error, OutOfReach):
        return OutOfReach(f"position out of reach: {str(error).split(': ', 1)[1]}", sample=0)
    return EvaluationFailed(f"position: no posture was found that reaches {position.tolist()} m; more samples may")


def held_still(arm: Arm, position: Float[np.ndarray, " task"]) -> MotionTask:
    """Return the task of a tool that stays where it is."""
    still = Line(position, np.zeros_like(position), None, np.zeros(3))
    path = Path(np.array([0.0, 0.5, 1.0]), np.tile(position, (3, 1)), None, still)
    return motion_task(arm, path, objectives=[joint_travel])
