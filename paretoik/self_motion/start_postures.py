"""Postures that reach a sample of a task, from random starts, and why none does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.errors import Infeasible, OutOfReach
from paretoik.robot.arm import Arm
from paretoik.robot.scales import characteristic_length, joint_scales
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import ON_PATH_TOLERANCE, relative_errors, row_scales, solve_small_systems
from paretoik.task.retraction import OPTIONS as RETRACTION


@dataclass(frozen=True, kw_only=True)
class InverseKinematicsOptions:
    """Settings of damped least squares from random starts."""

    iterations: int = 40
    longest_step: float = 0.5  # rad, or the arm's length: of a joint
    damping: float = 1e-2  # share of the squared error
    first_damping: float = 4e-3  # added to it in the first iterations
    damped_iterations: int = 5
    quick_starts: int = 32
    thorough_starts: int = 256  # with five times the iterations, before a sample is called out of reach
    other_units: float = 10.0  # arm's lengths: a path that far out of reach is probably not in metres


OPTIONS = InverseKinematicsOptions()


def sample_postures(
    task: MotionTask, count: int, rng: np.random.Generator, *, sample: int = 0
) -> Float[np.ndarray, "found dof"]:
    """Return up to ``count`` postures that reach a sample, from random starts all over the joint ranges.

    Damped least squares (Nakamura & Hanafusa 1986), then Newton; those that don't arrive are left out.
    """
    q, error = _solve_from_random_starts(task, np.full(count, sample), rng)
    return q[np.abs(error).max(axis=1) <= ON_PATH_TOLERANCE]


def _solve_from_random_starts(
    task: MotionTask,
    samples: Int[np.ndarray, " count"],
    rng: np.random.Generator,
    *,
    iterations: int = OPTIONS.iterations,
) -> tuple[Float[np.ndarray, "count dof"], Float[np.ndarray, "count rows"]]:
    """Return for each of ``samples`` a posture near it, from a random start, and the relative task errors there."""
    q = rng.uniform(*_sampling_range(task), size=(len(samples), task.arm.dof))
    targets = task.targets[samples]
    active = np.arange(len(samples))
    for step in range(iterations):
        error, jacobian = relative_errors(task.arm, task.tasks, q[active], targets[active])
        size = np.linalg.norm(error, axis=1)
        damping = OPTIONS.damping * size**2 + (OPTIONS.first_damping if step < OPTIONS.damped_iterations else 1e-12)
        if step >= OPTIONS.iterations:
            damping = size  # out of reach, perhaps: with less damping it would oscillate about the nearest point
        square = jacobian @ np.swapaxes(jacobian, -1, -2) + damping[:, None, None] * np.eye(task.rows)
        step_taken = (np.swapaxes(jacobian, -1, -2) @ solve_small_systems(square, error)[0][..., None])[..., 0]
        step_taken /= np.maximum(1.0, np.abs(step_taken).max(axis=1, keepdims=True) / OPTIONS.longest_step)
        q[active] += step_taken * joint_scales(task.arm)
        active = active[size > RETRACTION.tolerance]
        if len(active) == 0:
            break
    turning = task.arm.periodic & ~np.isfinite(task.arm.position_limits).all(axis=1)
    q[:, turning] = (q[:, turning] + np.pi) % (2 * np.pi) - np.pi
    return q, relative_errors(task.arm, task.tasks, q, targets)[0]


def _sampling_range(task: MotionTask) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = task.arm.position_limits.T
    width = np.where(task.arm.periodic, 2 * np.pi, 2 * joint_scales(task.arm))
    low = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper - width, -width / 2))
    return low, np.where(np.isfinite(upper), upper, low + width)


def reach_error(task: MotionTask, rng: np.random.Generator, near: int) -> OutOfReach | Infeasible:
    """Return the error that says why no motion gets past sample ``near``."""
    _, error = _solve_from_random_starts(task, np.repeat(np.arange(len(task.times)), OPTIONS.quick_starts), rng)
    unreached = np.abs(error).max(axis=1).reshape(-1, OPTIONS.quick_starts).min(axis=1) > ON_PATH_TOLERANCE
    for sample in np.flatnonzero(unreached).tolist():  # by few starts; more are tried before it counts as out of reach
        _, error = _solve_from_random_starts(
            task, np.full(OPTIONS.thorough_starts, sample), rng, iterations=5 * OPTIONS.iterations
        )
        if np.abs(error).max(axis=1).min() > ON_PATH_TOLERANCE:
            nearest = error[int(np.argmin(np.sum(error**2, axis=1)))] * row_scales(task.arm, task.tasks)
            where = f"sample {sample} ({task.times[sample]:.3g} s)"
            return OutOfReach(f"path leaves reach at {where}: {_describe_error(task, sample, nearest)}", sample=sample)
    if task.cyclic:
        return Infeasible("no cyclic motion was found: every candidate that follows the path ends in another posture")
    q = sample_postures(task, 64, rng, sample=near)
    condition = float(np.linalg.cond(relative_errors(task.arm, task.tasks, q, task.targets[near])[1]).min())
    return Infeasible(
        f"every sample can be reached, but no continuous motion passes sample {near} ({task.times[near]:.3g} s): a "
        f"singularity, a gap between branches or samples too far apart (least condition number of the Jacobian there: "
        f"{condition:.3g})"
    )


def _describe_error(task: MotionTask, sample: int, error: Float[np.ndarray, " rows"]) -> str:
    """Return in words how far the nearest posture found is from a sample, for the task that is missed most."""
    errors, row, column = [], 0, 0
    for part in task.tasks:
        size = 2 if part.axes in ("xy", "xy+angle") else 3
        target, residual = task.targets[sample, column : column + size], error[row : row + part.rows]
        errors.append((float(np.linalg.norm(residual)), target, residual[:size], residual[size:]))
        row, column = row + part.rows, column + part.target_size
    _, target, off, turn = max(errors, key=lambda entry: entry[0])
    rotation = f", there turned {np.linalg.norm(turn):.3g} rad away" if len(turn) else ""
    distance, length = float(np.linalg.norm(off)), characteristic_length(task.arm)
    units = (
        f"; the arm is {length:.3g} m long: is the path in metres?" if distance > OPTIONS.other_units * length else ""
    )
    return (
        f"{(np.round(target, 6) + 0.0).tolist()} m is {distance:.3g} m from the nearest point found, "
        f"{(np.round(target - off, 6) + 0.0).tolist()} m{rotation}{units}"
    )


def order_by_neighbour(arm: Arm, q: Float[np.ndarray, "postures dof"]) -> Float[np.ndarray, "postures dof"]:
    """Return postures in an order in which each comes after its nearest neighbour among those before it."""
    remaining = list(q)
    ordered = [remaining.pop(0)]
    while remaining:
        distance = posture_distance(arm, np.array(remaining), ordered[-1])
        ordered.append(remaining.pop(int(np.argmin(distance))))
    return np.array(ordered)


def posture_distance(
    arm: Arm, q: Float[np.ndarray, "*#batch dof"], other: Float[np.ndarray, "*#batch dof"]
) -> Float[np.ndarray, ...]:
    """Return the joint distance [rad, the arm's length] between postures, angles modulo 2π."""
    difference = wrap_difference(q - other, arm.periodic) / joint_scales(arm)
    return np.asarray(np.linalg.norm(difference, axis=-1))


def wrap_difference(difference: np.ndarray, periodic: np.ndarray) -> np.ndarray:
    """Return joint distances with whole turns of periodic joints taken off."""
    return np.where(periodic, difference - 2 * np.pi * np.round(difference / (2 * np.pi)), difference)
