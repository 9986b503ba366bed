"""Postures at a position: the best along directions, and those that motors can hold; errors if there are none."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from paretoik.arrays import Joints
from paretoik.capability.actuation import Actuation, DistributedActuation
from paretoik.capability.directional_program import DirectionalProgram
from paretoik.capability.joint_capability import Quantity, joint_speeds, overload_error, torque_capacity, values_at
from paretoik.errors import EvaluationFailed, Infeasible, InvalidInput, OutOfReach, SolverFailed
from paretoik.nlp.dense.dense_program import DenseProgram
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import InteriorPointOptions
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import joint_travel
from paretoik.task.path import sample_curve
from paretoik.task.path_shapes import Line
from paretoik.task.random_starts import reach_error, sample_postures, wrap_difference
from paretoik.task.validation import motion_task

# Local maxima over all postures of any arm: ascent over posture, sliders and speeds from many starts.


@dataclass(frozen=True, kw_only=True)
class AscentOptions:
    """Settings of the ascent from many starts."""

    largest: int = 24  # largest number of starts per direction
    smallest: int = 6  # smallest number of starts per direction
    repeats: int = 3  # number of starts that must reach the best value to end a direction's search
    value_tolerance: float = 1e-6  # relative difference up to which two values are the same
    rounds: int = 4  # number of rounds that try the best posture of one direction in the others
    batch: int = 2000  # number of postures evaluated together, to limit memory
    distance: float = 0.5  # least distance of starts in some joint [rad, m]
    feasible: float = 1e-8  # largest violation of the program at a feasible end point
    interior_point: InteriorPointOptions = InteriorPointOptions(barrier=1e-2, iterations=300)  # from a start
    # near a maximum, or if the interior-point method does not converge
    sqp: InteriorPointOptions = InteriorPointOptions(radius=0.1, iterations=200, tolerance=1e-9)


ASCENT_OPTIONS = AscentOptions()


def maximise_from(
    arm: Arm,
    actuation: Actuation,
    position: Float[np.ndarray, " task"],
    directions: Float[np.ndarray, "directions task"],
    quantity: Quantity,
    starts: Float[np.ndarray, "starts dof"],
) -> Float[np.ndarray, "directions dof"]:
    """Return the best posture of each direction by ascent from ``starts``.

    If the best posture of one direction improves another, the ascent along the other starts again from it.
    """
    program = DirectionalProgram(arm=arm, actuation=actuation, quantities=(quantity,))
    parts = np.array_split(starts, -(-len(starts) // ASCENT_OPTIONS.batch))
    q, values = starts, np.concatenate([values_at(arm, actuation, directions, quantity, part) for part in parts])
    ascended = np.zeros(len(directions))

    def climb(k: int, start: np.ndarray, *, near: bool) -> float:
        """Ascend along direction k and keep the end point; return its value, or 0 without an end point."""
        nonlocal q, values
        size = float(values[:, k].max())
        end = ascend(program, position, directions[k], size, start, near=near) if 0 < size < np.inf else None
        found = np.full((1, 1), np.nan) if end is None else values_at(arm, actuation, directions, quantity, end[None])
        if end is None or np.isnan(found).any():
            return 0.0
        q, values = np.concatenate([q, end[None]]), np.concatenate([values, found])
        ascended[k] = max(ascended[k], float(found[0, k]))
        return float(found[0, k])

    for k in range(len(directions)):  # until the best end point repeats or enough starts were tried
        ends = list[float]()
        for start in distant_postures(arm, q[np.argsort(-values[:, k], kind="stable")]):
            ends.append(climb(k, start, near=False))
            best = np.sum(np.array(ends) >= max(ends) * (1 - ASCENT_OPTIONS.value_tolerance))
            if len(ends) >= ASCENT_OPTIONS.smallest and best >= ASCENT_OPTIONS.repeats:
                break
    for _ in range(ASCENT_OPTIONS.rounds - 1):  # from the best posture of another direction, if that is better
        improved = values.max(axis=0) > ascended * (1 + ASCENT_OPTIONS.value_tolerance)
        for k in np.flatnonzero(improved).tolist():
            climb(k, q[values[:, k].argmax()], near=True)
    return q[values.argmax(axis=0)]


def ascend(
    program: DirectionalProgram,
    position: Float[np.ndarray, " task"],
    direction: Float[np.ndarray, " task"],
    size: float,
    start: Float[np.ndarray, " dof"],
    *,
    near: bool = False,
) -> Float[np.ndarray, " dof"] | None:
    """Return the posture of a local maximum along a direction; None if it violates limits.

    size: approximate expected value [m/s, N]
    near: whether the start is near a maximum; SQP stays near it, the interior-point method may leave it
    """
    cost = np.zeros((1, program.unknowns))
    cost[0, program.slices["values"]] = -1.0
    dense = DenseProgram(rows=program.program(position, direction[None], np.array([size])), costs=cost)
    first, weight = program.initial_point(start)[None], np.ones((1, 1))
    try:
        end = None if near else minimise(dense, first, weight, options=ASCENT_OPTIONS.interior_point)
        if end is None or not end.converged[0]:
            restart = first if end is None or end.violation[0] > ASCENT_OPTIONS.feasible else end.x
            end = minimise(dense, restart, weight, options=ASCENT_OPTIONS.sqp, solver="sqp")
    except (EvaluationFailed, SolverFailed):  # rods may not reach
        return None
    return program.parts(end.x[0], np.array([size]))["q"] if end.violation[0] <= ASCENT_OPTIONS.feasible else None


def distant_postures(arm: Arm, q: np.ndarray) -> list[np.ndarray]:
    """Return up to ``largest`` postures, each far from all those chosen before it."""
    chosen, remaining = list[np.ndarray](), q
    while len(remaining) and len(chosen) < ASCENT_OPTIONS.largest:
        chosen.append(remaining[0])
        distances = np.abs(wrap_difference(remaining - remaining[0], arm.periodic)).max(axis=1)
        remaining = remaining[distances > ASCENT_OPTIONS.distance]
    return chosen


# Samples of postures at a position, and errors if there are none.


@dataclass(frozen=True, kw_only=True)
class PostureSampleOptions:
    """Settings of the search for postures that motors can hold."""

    enough: int = 64  # number of holdable postures at which sampling stops
    batches: int = 8  # largest number of batches of samples
    clear: float = 2.0  # share of capacity: if all samples have a larger load, no posture can be held
    starts: int = 8  # number of least overloaded samples from which overloads are reduced
    tool_radius: float = 0.1  # m: times the motors' highest speed, it gives the magnitude of tool speeds


OPTIONS = PostureSampleOptions()


def sample_holdable_postures(
    arm: Arm, actuation: Actuation, position: Float[np.ndarray, " task"], samples: int, rng: np.random.Generator
) -> Float[np.ndarray, "postures dof"]:
    """Return postures at a position, within limits, in which motors can hold the arm.

    If motors can hold no sample, ascent starts from the least overloaded ones. Raises OutOfReach, or Infeasible, which
    names the joint, torque and limit of the least overloaded posture.
    """
    restricted, q, feasible = restrict_to_rods(arm, actuation), np.empty((0, arm.dof)), np.empty((0, arm.dof))
    for _ in range(OPTIONS.batches):
        batch = sample_postures_at(restricted, position, samples, rng)
        within = (limit_excess(arm, batch) <= 0).all(axis=1)
        q = np.concatenate([q, batch])
        feasible = np.concatenate([feasible, batch[within & can_hold(arm, actuation, batch)]])
        if len(feasible) >= min(OPTIONS.enough, samples):
            break
    if len(feasible):
        return feasible
    excess = np.maximum(limit_excess(arm, q), 0.0).max(axis=1)
    if overload(arm, actuation, q).min() > OPTIONS.clear:
        raise postures_error(arm, actuation, q, position)
    program = DirectionalProgram(arm=arm, actuation=actuation, quantities=("velocity",))
    size = OPTIONS.tool_radius * max(float(curve.fastest.max()) for curve in actuation.curves)
    upright = np.eye(len(position))[-1]
    starts = distant_postures(arm, q[np.argsort(overload(arm, actuation, q) + excess)])
    ends = [ascend(program, position, upright, size, start) for start in starts[: OPTIONS.starts]]
    feasible = np.array([end for end in ends if end is not None]).reshape(-1, arm.dof)
    feasible = feasible[can_hold(arm, actuation, feasible)]
    if len(feasible):
        return feasible
    raise postures_error(arm, actuation, q, position)


def sample_postures_at(
    arm: Arm, position: Float[np.ndarray, " task"], samples: int, rng: np.random.Generator
) -> Float[np.ndarray, "postures dof"]:
    """Return postures that reach a position, shifted by whole turns towards their limits; some may exceed limits.

    Raises OutOfReach; SolverFailed if the position is within reach, but no posture was found.
    """
    task = stationary_task(arm, position)
    q = sample_postures(task, samples, rng)
    if not len(q):
        error = reach_error(task, rng, 0)
        if isinstance(error, OutOfReach):
            raise OutOfReach(f"position out of reach: {str(error).split(': ', 1)[1]}", sample=0)
        raise SolverFailed(f"position: no posture was found that reaches {position.tolist()} m; use more samples")
    lower, upper = arm.position_limits.T
    for j in np.flatnonzero(arm.periodic):
        column = q[:, j]
        if np.isfinite(lower[j]):
            column += 2 * np.pi * np.maximum(np.ceil((lower[j] - column) / (2 * np.pi)), 0.0)
        if np.isfinite(upper[j]):
            back = column - 2 * np.pi * np.maximum(np.ceil((column - upper[j]) / (2 * np.pi)), 0.0)
            column[back >= lower[j]] = back[back >= lower[j]]
    return q


def restrict_to_rods(arm: Arm, actuation: Actuation) -> Arm:
    """Return the arm with joint limits reduced to the angles that its rods reach, within one turn.

    Raises InvalidInput, naming the joint, if limits and reach do not overlap.
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
            f"{arm.joint_names[j]}: limits must overlap with what its rod reaches, "
            f"{np.rad2deg(ends[:, j]).round(1).tolist()}°, got {np.rad2deg(arm.position_limits[j]).round(1).tolist()}°"
        )
    return replace(arm, position_limits=np.stack([low, high], axis=1))


def stationary_task(arm: Arm, position: Float[np.ndarray, " task"]) -> MotionTask:
    """Return the task of a tool that stays at a position."""
    path = sample_curve(Line(position, np.zeros_like(position), None, np.zeros(3)), np.array([0.0, 0.5, 1.0]))
    return motion_task(arm, path, objectives=[joint_travel], differences="backward", redundant=False)


def limit_excess(arm: Arm, q: Joints) -> Joints:
    """Return the excess [rad, m] of joints over limits (*batch, dof), negative if within them."""
    lower, upper = arm.position_limits.T
    return np.asarray(np.maximum(q - upper, lower - q))


def overload(arm: Arm, actuation: Actuation, q: Joints) -> Float[np.ndarray, " postures"]:
    """Return the largest load of any joint, as a share of its capacity; 1e6 if sliders cannot reach the posture."""
    torque, (capacity, _) = gravity_torques(arm, q), torque_capacity(actuation, q)
    share = np.abs(torque) / np.where(capacity > 0, capacity, 1e-300)
    return np.asarray(np.where(np.isnan(capacity), 1e6, share).max(axis=1))


def can_hold(arm: Arm, actuation: Actuation, q: Joints) -> Bool[np.ndarray, " postures"]:
    """Return whether motors can hold the arm in postures (postures, dof)."""
    speeds = joint_speeds(actuation, q, gravity_torques(arm, q))
    return np.asarray(~np.isnan(speeds.high).any(axis=1))


def postures_error(arm: Arm, actuation: Actuation, q: np.ndarray, position: np.ndarray) -> Infeasible:
    """Return the error for the least infeasible posture, if motors can hold none within limits."""
    excess = limit_excess(arm, q)
    inside = q[(excess <= 0).all(axis=1)]
    if len(inside):
        best = inside[np.argmin(overload(arm, actuation, inside))]
        error = overload_error(actuation, arm, best, gravity_torques(arm, best))
        message = f"{error}; that is the best of {len(inside)} postures tried"
        return Infeasible(message, limit=error.limit, violation=error.violation)
    row = int(np.argmin(excess.max(axis=1)))
    joint = int(np.argmax(excess[row]))
    return Infeasible(
        f"{arm.joint_names[joint]} must be within its limits, got {excess[row, joint]:.3g} rad or m "
        f"beyond them in the best of {len(q)} postures that reach {position.tolist()} m",
        limit=f"position of {arm.joint_names[joint]}",
    )
