"""In which postures an arm can do most: planar arms of three joints all around, others climbed to from many."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Joints
from paretoik.capability.actuation import Actuation, DistributedActuation, holding, joint_speeds, overloaded
from paretoik.capability.capability import Capability, Quantity
from paretoik.capability.compiled import actuators, planar_maxima
from paretoik.capability.zonotopes import fastest, strongest
from paretoik.errors import EvaluationFailed, Infeasible, InvalidInput, OutOfReach, ParetoikError, SolverFailed
from paretoik.nlp.dense_sqp import minimised
from paretoik.nlp.filter_interior_point import approached
from paretoik.robot import dynamics, kinematics
from paretoik.robot.arm import Arm
from paretoik.self_motion.postures import reach_error, sample_postures, wrap_difference
from paretoik.task.curves import Line
from paretoik.task.motion_task import MotionTask
from paretoik.task.motion_task_validation import motion_task
from paretoik.task.objectives import joint_travel
from paretoik.task.path import Path

KEPT, FEWEST, OFTEN = 24, 6, 3  # postures climbed from at most and at least; often enough to have reached the most
ALIKE = 1e-6  # share by which what was reached may differ and be the same
ROUNDS = 4  # of trying what was found for one direction in others
ENOUGH, BATCHES = 64, 8  # postures that can be held, and times that samples are drawn for them at most
FEW = 400  # postures that an error is told of
TOGETHER = 2000  # postures that are looked at at once, for the memory it takes
SIZE = 0.1  # m: times motors' fastest, about the speed of a tool
UNABLE = 1e6  # share of what no slider can hold
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
    what = actuators.SPEED if quantity == "velocity" else actuators.HOLD
    if not planar_maxima.write_maxima((table, actuation.table, position, what), directions, values, q):
        raise _out_of_reach(table, position)
    if (values < 0).any():
        raise _refused(arm, actuation, several_postures(arm, position, min(samples, FEW), rng), position)
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
    """Return the best postures of an arm of any kind: the best of many, climbed from.

    What is found for one direction is tried for all others, and those that it serves better are climbed to again.
    """
    starts = held_postures(arm, actuation, position, samples, rng)
    climb = _Climb(arm, actuation, position, directions, quantity, starts)
    waiting = list(range(len(directions)))
    for turn in range(ROUNDS):
        for k in waiting:
            climb.search(k) if turn == 0 else climb.up(k, climb.q[climb.best[k]], near=True)
        waiting = climb.served_better()
    return climb.q[climb.best]


class _Climb:
    """Postures that can be held, found so far, and their ``values`` (postures, directions)."""

    def __init__(
        self,
        arm: Arm,
        actuation: Actuation,
        position: np.ndarray,
        directions: np.ndarray,
        quantity: Quantity,
        starts: np.ndarray,
    ) -> None:
        self.arm, self.actuation, self.position = arm, actuation, position
        self.directions, self.quantity = directions, quantity
        self.asked = Capability(arm=arm, actuation=actuation, quantity=quantity, count=1)
        parts = np.array_split(starts, -(-len(starts) // TOGETHER))
        self.q = starts
        self.values = np.concatenate([values_at(arm, actuation, directions, quantity, part) for part in parts])
        self.reached = np.zeros(len(directions))

    @property
    def best(self) -> Int[np.ndarray, " directions"]:
        """Which posture is the best of all along each direction."""
        found: np.ndarray = self.values.argmax(axis=0)
        return found

    def search(self, k: int) -> None:
        """Climb along a direction from its best postures until the most was reached often, or enough were tried."""
        reached = list[float]()
        for start in _apart(self.arm, self.q[np.argsort(-self.values[:, k], kind="stable")]):
            reached.append(self.up(k, start))
            if len(reached) >= FEWEST and np.sum(np.array(reached) >= max(reached) * (1 - ALIKE)) >= OFTEN:
                break

    def up(self, k: int, start: np.ndarray, *, near: bool = False) -> float:
        """Climb along a direction from a posture, keep where that ends, and return what it is worth, 0 for nothing."""
        size = float(self.values[:, k].max())
        if not 0 < size < np.inf:
            return 0.0
        q = climbed(self.asked, self.position, self.directions[k], size, start, near=near)
        if q is None:
            return 0.0
        worth = values_at(self.arm, self.actuation, self.directions, self.quantity, q[None])
        if np.isnan(worth).any():
            return 0.0
        self.q, self.values = np.concatenate([self.q, q[None]]), np.concatenate([self.values, worth])
        self.reached[k] = max(self.reached[k], float(worth[0, k]))
        return float(worth[0, k])

    def served_better(self) -> list[int]:
        """Return the directions along which a posture that was climbed to for another one is the best."""
        found: list[int] = np.flatnonzero(self.values.max(axis=0) > self.reached * (1 + ALIKE)).tolist()
        return found


def climbed(
    asked: Capability,
    position: Float[np.ndarray, " task"],
    direction: Float[np.ndarray, " task"],
    size: float,
    start: Float[np.ndarray, " dof"],
    *,
    near: bool = False,
) -> Float[np.ndarray, " dof"] | None:
    """Return the posture, a local maximum along a direction, that a start leads to; None where its limits don't hold.

    ``size`` [m/s, N] is about how much there is. ``near`` a maximum quadratic programs stay with it, which interior
    points may leave.
    """
    program, cost = asked.program(position, direction[None], size), np.zeros(asked.unknowns)
    cost[asked.begins["values"]] = -1.0
    try:
        end = None if near else approached(program, cost, asked.begun(start))
        if end is None:
            end = minimised(program, cost, asked.begun(start))
        elif not end.converged:
            end = minimised(program, cost, end.z if end.violation <= HELD else asked.begun(start))
    except (EvaluationFailed, SolverFailed):  # rods that do not reach
        return None
    return asked.parts(end.z, size)["q"] if end.violation <= HELD else None


def held_postures(
    arm: Arm,
    actuation: Actuation,
    position: Float[np.ndarray, " task"],
    samples: int,
    rng: np.random.Generator,
) -> Float[np.ndarray, "found dof"]:
    """Return postures that reach a position, within limits, in which motors can hold the arm.

    Where none of the samples can be held, the least overloaded lead to some. Raises OutOfReach, and Infeasible, naming
    joint, torque and limit of the least overloaded.
    """
    kept, q, held = within_rods(arm, actuation), np.empty((0, arm.dof)), np.empty((0, arm.dof))
    for _ in range(BATCHES):
        more = several_postures(kept, position, samples, rng)
        able = ~np.isnan(joint_speeds(actuation, more, loads(arm, more)).high).any(axis=1)
        able &= (past(arm, more) <= 0).all(axis=1)
        q, held = np.concatenate([q, more]), np.concatenate([held, more[able]])
        if len(held) >= min(ENOUGH, samples):
            break
    if len(held):
        return held
    excess = np.maximum(past(arm, q), 0.0).max(axis=1)
    over = _overload(arm, actuation, q)
    asked = Capability(arm=arm, actuation=actuation, quantity="velocity", count=1)
    size = SIZE * max(float(curve.fastest.max()) for curve in asked.curves)
    upright = np.eye(len(position))[-1]
    ends = [climbed(asked, position, upright, size, one) for one in _apart(arm, q[np.argsort(over + excess)])]
    found = np.array([end for end in ends if end is not None]).reshape(-1, arm.dof)
    held = found[~np.isnan(joint_speeds(actuation, found, loads(arm, found)).high).any(axis=1)]
    if len(held):
        return held
    raise _refused(arm, actuation, q, position)


def _apart(arm: Arm, q: np.ndarray) -> list[np.ndarray]:
    """Return the first few postures that are not near each other."""
    found = [q[0]]
    for one in q[1:]:
        if len(found) == KEPT:
            break
        if np.abs(wrap_difference(np.array(found) - one, arm.periodic)).max(axis=1).min() > APART:
            found.append(one)
    return found


def several_postures(
    arm: Arm, position: Float[np.ndarray, " task"], samples: int, rng: np.random.Generator
) -> Float[np.ndarray, "found dof"]:
    """Return postures that reach a position, each joint in the turn that its limits want; some may be past limits.

    Raises OutOfReach.
    """
    task = held_still(arm, position)
    found = sample_postures(task, samples, rng)
    if not len(found):
        raise _renamed(reach_error(task, rng, 0), position)
    lower, upper = arm.position_limits.T
    for j in np.flatnonzero(arm.periodic):
        column = found[:, j]
        if np.isfinite(lower[j]):
            column += 2 * np.pi * np.maximum(np.ceil((lower[j] - column) / (2 * np.pi)), 0.0)
        if np.isfinite(upper[j]):
            back = column - 2 * np.pi * np.maximum(np.ceil((column - upper[j]) / (2 * np.pi)), 0.0)
            column[back >= lower[j]] = back[back >= lower[j]]
    return found


def past(arm: Arm, q: Joints) -> Joints:
    """Return by how much joints (*batch, dof) are past their limits [rad, m], negative within."""
    lower, upper = arm.position_limits.T
    return np.asarray(np.maximum(q - upper, lower - q))


def within_rods(arm: Arm, actuation: Actuation) -> Arm:
    """Return the arm with joint limits no wider than what rods and sliders can reach, in one turn.

    Raises InvalidInput, naming the joint, where they do not overlap.
    """
    if not isinstance(actuation, DistributedActuation):
        return arm
    lower, upper = arm.position_limits.T
    ends = np.sort(actuation.zero + actuation.bend * actuation.angle_bounds.T, axis=0)
    middle = ends.mean(axis=0)
    below = np.where(np.isfinite(lower), lower, middle - np.pi)
    above = np.where(np.isfinite(upper), upper, middle + np.pi)
    ends = ends + 2 * np.pi * np.round(((below + above) / 2 - middle) / (2 * np.pi))
    low, high = np.maximum(ends[0], lower), np.minimum(ends[1], upper)
    if (low > high).any():
        j = int(np.argmax(low > high))
        raise InvalidInput(
            f"{arm.joint_names[j]}: limits that overlap with what its rod reaches wanted, "
            f"{np.rad2deg(ends[:, j]).round(1).tolist()}°, got {np.rad2deg(arm.position_limits[j]).round(1).tolist()}°"
        )
    return replace(arm, position_limits=np.stack([low, high], axis=1))


def _overload(arm: Arm, actuation: Actuation, q: Joints) -> Float[np.ndarray, " found"]:
    """Return the largest share of what its motor can hold that any joint asks for."""
    torque, (able, _) = loads(arm, q), holding(actuation, q)
    share = np.where(np.isnan(able), UNABLE, np.abs(torque) / np.where(able > 0, able, 1e-300))
    return np.asarray(share.max(axis=1))


def _refused(arm: Arm, actuation: Actuation, q: np.ndarray, position: np.ndarray) -> Infeasible:
    """Return the error of postures none of which can be held within limits."""
    inside = q[(past(arm, q) <= 0).all(axis=1)]
    return _cannot_hold(arm, actuation, inside) if len(inside) else _past_limits(arm, q, position)


def _cannot_hold(arm: Arm, actuation: Actuation, q: np.ndarray) -> Infeasible:
    """Return the error of the posture that is overloaded least."""
    least = int(np.argmin(_overload(arm, actuation, q)))
    found = overloaded(actuation, arm, q[least], loads(arm, q[least]))
    said = f"{found}; that is the best of {len(q)} postures looked at"
    return Infeasible(said, limit=found.limit, violation=found.violation)


def _past_limits(arm: Arm, q: np.ndarray, position: np.ndarray) -> Infeasible:
    """Return the error of the posture that is least past its joints' limits."""
    excess = past(arm, q)
    least = int(np.argmin(excess.max(axis=1)))
    joint = int(np.argmax(excess[least]))
    return Infeasible(
        f"{arm.joint_names[joint]}: a position within its limits wanted, got {excess[least, joint]:.3g} rad or m "
        f"past them in the best of {len(q)} postures that reach {position.tolist()} m",
        limit=f"position of {arm.joint_names[joint]}",
    )


def _out_of_reach(table: tuple[np.ndarray, ...], position: np.ndarray) -> OutOfReach:
    lengths, base = table[0], table[3][:2]
    least = max(0.0, 2 * float(lengths.max()) - float(lengths.sum()))
    return OutOfReach(
        f"position: {position.tolist()} m is {np.linalg.norm(position - base):.10g} m from the first joint, "
        f"the arm reaches from {least:.10g} m to {float(lengths.sum()):.10g} m",
        sample=0,
    )


def _renamed(error: ParetoikError, position: np.ndarray) -> ParetoikError:
    if isinstance(error, OutOfReach):
        return OutOfReach(f"position out of reach: {str(error).split(': ', 1)[1]}", sample=0)
    return SolverFailed(f"position: no posture was found that reaches {position.tolist()} m; more samples may")


def held_still(arm: Arm, position: Float[np.ndarray, " task"]) -> MotionTask:
    """Return the task of a tool that stays where it is."""
    still = Line(position, np.zeros_like(position), None, np.zeros(3))
    path = Path(np.array([0.0, 0.5, 1.0]), np.tile(position, (3, 1)), None, still)
    return motion_task(arm, path, objectives=[joint_travel], redundant=False)
