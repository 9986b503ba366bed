"""Start postures and start motions on the path, and reasons for failures."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.arrays import JointPaths
from paretoik.errors import Infeasible, OutOfReach
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import characteristic_length, joint_scales
from paretoik.stop_flag import check_interruption
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import (
    ON_PATH_TOLERANCE,
    relative_errors,
    retract,
    row_scales,
    row_space_basis,
    solve_small_systems,
)
from paretoik.task.retraction import OPTIONS as RETRACTION


@dataclass(frozen=True, kw_only=True)
class InverseKinematicsOptions:
    """Settings of damped least squares from random starts."""

    iterations: int = 40
    longest_step: float = 0.5  # rad, or the arm's length: largest step of a joint
    damping: float = 1e-2  # share of the squared error
    first_damping: float = 4e-3  # damping that is added in the first iterations
    damped_iterations: int = 5  # number of these first iterations
    quick_starts: int = 32  # starts per sample of a first search for samples out of reach
    thorough_starts: int = 256  # starts, with five times the iterations, before a sample counts as out of reach
    other_units: float = 10.0  # arm lengths: if a path is farther out of reach, its unit is probably not m


POSTURE_OPTIONS = InverseKinematicsOptions()


def sample_postures(
    task: MotionTask, count: int, rng: np.random.Generator, *, sample: int = 0
) -> Float[np.ndarray, "found dof"]:
    """Return up to ``count`` postures that reach a sample.

    Starts are random in the joint ranges. The method is damped least squares (Nakamura & Hanafusa 1986), then Newton's.
    Postures that do not converge are left out.
    """
    q, error = _solve_from_random_starts(task, np.full(count, sample), rng)
    return q[np.abs(error).max(axis=1) <= ON_PATH_TOLERANCE]


def _solve_from_random_starts(
    task: MotionTask,
    samples: Int[np.ndarray, " count"],
    rng: np.random.Generator,
    *,
    iterations: int = POSTURE_OPTIONS.iterations,
) -> tuple[Float[np.ndarray, "count dof"], Float[np.ndarray, "count rows"]]:
    """Return a posture near each of ``samples`` from random starts, and its relative task errors."""
    lower, upper = task.arm.position_limits.T
    width = np.where(task.arm.periodic, 2 * np.pi, 2 * joint_scales(task.arm))
    low = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper - width, -width / 2))
    high = np.where(np.isfinite(upper), upper, low + width)
    q = rng.uniform(low, high, size=(len(samples), task.arm.dof))
    targets = task.targets[samples]
    active = np.arange(len(samples))
    for step in range(iterations):
        error, jacobian = relative_errors(task.arm, task.tasks, q[active], targets[active])
        size = np.linalg.norm(error, axis=1)
        least = POSTURE_OPTIONS.first_damping if step < POSTURE_OPTIONS.damped_iterations else 1e-12
        damping = POSTURE_OPTIONS.damping * size**2 + least
        if step >= POSTURE_OPTIONS.iterations:
            damping = size  # may be out of reach: less damping would make iterations oscillate about the nearest point
        square = jacobian @ np.swapaxes(jacobian, -1, -2) + damping[:, None, None] * np.eye(task.rows)
        step_taken = (np.swapaxes(jacobian, -1, -2) @ solve_small_systems(square, error)[0][..., None])[..., 0]
        step_taken /= np.maximum(1.0, np.abs(step_taken).max(axis=1, keepdims=True) / POSTURE_OPTIONS.longest_step)
        q[active] += step_taken * joint_scales(task.arm)
        active = active[size > RETRACTION.tolerance]
        if len(active) == 0:
            break
    turning = task.arm.periodic & ~np.isfinite(task.arm.position_limits).all(axis=1)
    q[:, turning] = (q[:, turning] + np.pi) % (2 * np.pi) - np.pi
    return q, relative_errors(task.arm, task.tasks, q, targets)[0]


def reach_error(task: MotionTask, rng: np.random.Generator, near: int) -> OutOfReach | Infeasible:
    """Return the error that explains why no motion passes sample ``near``."""
    _, error = _solve_from_random_starts(task, np.repeat(np.arange(len(task.times)), POSTURE_OPTIONS.quick_starts), rng)
    unreached = np.abs(error).max(axis=1).reshape(-1, POSTURE_OPTIONS.quick_starts).min(axis=1) > ON_PATH_TOLERANCE
    for sample in np.flatnonzero(unreached).tolist():  # the first starts did not reach it: try more
        _, error = _solve_from_random_starts(
            task, np.full(POSTURE_OPTIONS.thorough_starts, sample), rng, iterations=5 * POSTURE_OPTIONS.iterations
        )
        if np.abs(error).max(axis=1).min() <= ON_PATH_TOLERANCE:
            continue
        nearest = error[int(np.argmin(np.sum(error**2, axis=1)))] * row_scales(task.arm, task.tasks)
        # how far the nearest posture is from the sample, in the task with the largest error
        errors, row, column = [], 0, 0
        for part in task.tasks:
            size = part.position_rows
            target, residual = task.targets[sample, column : column + size], nearest[row : row + part.rows]
            errors.append((float(np.linalg.norm(residual)), target, residual[:size], residual[size:]))
            row, column = row + part.rows, column + part.target_size
        _, target, off, turn = max(errors, key=lambda entry: entry[0])
        rotation = f" and {np.linalg.norm(turn):.3g} rad" if len(turn) else ""
        distance, length = float(np.linalg.norm(off)), characteristic_length(task.arm)
        is_far = distance > POSTURE_OPTIONS.other_units * length
        units = f"; the arm is {length:.3g} m long: is the path in metres?" if is_far else ""
        wanted, reached = ((np.round(place, 6) + 0.0).tolist() for place in (target, target - off))
        return OutOfReach(
            f"path leaves reach at sample {sample} ({task.times[sample]:.3g} s): {wanted} m is {distance:.3g} m"
            f"{rotation} from the nearest {'pose' if rotation else 'point'} found, {reached} m{units}",
            sample=sample,
        )
    if task.cyclic:
        return Infeasible("no cyclic motion was found: every candidate that follows the path ends in another posture")
    q = sample_postures(task, 64, rng, sample=near)
    condition = float(np.linalg.cond(relative_errors(task.arm, task.tasks, q, task.targets[near])[1]).min())
    return Infeasible(
        f"every sample can be reached, but no continuous motion was found through sample {near} "
        f"({task.times[near]:.3g} s): there may be a singularity or a gap between branches, or samples are too far "
        f"apart (smallest condition number of the Jacobian there: {condition:.3g})"
    )


def order_by_neighbour(arm: Arm, q: Float[np.ndarray, "postures dof"]) -> Float[np.ndarray, "postures dof"]:
    """Return postures in an order in which each is followed by the nearest of those that remain."""
    remaining = list(q)
    ordered = [remaining.pop(0)]
    while remaining:
        distance = posture_distance(arm, np.array(remaining), ordered[-1])
        ordered.append(remaining.pop(int(np.argmin(distance))))
    return np.array(ordered)


def posture_distance(
    arm: Arm, q: Float[np.ndarray, "*#batch dof"], other: Float[np.ndarray, "*#batch dof"]
) -> Float[np.ndarray, ...]:
    """Return the distance [rad, the arm's length] between postures. Angles are modulo 2π."""
    difference = wrap_difference(q - other, arm.periodic) / joint_scales(arm)
    return np.asarray(np.linalg.norm(difference, axis=-1))


def wrap_difference(difference: np.ndarray, periodic: np.ndarray) -> np.ndarray:
    """Return joint distances without whole turns of periodic joints."""
    return np.where(periodic, difference - 2 * np.pi * np.round(difference / (2 * np.pi)), difference)


# Start motions on the path: roll-outs, motions along the self-motion, perturbed and recombined motions.


@dataclass(frozen=True, kw_only=True)
class StartOptions:
    """Settings of start motions [rad; arm lengths if prismatic]."""

    travel: float = 9.0  # largest travel of all joints together along the self-motion
    travel_width: tuple[float, float] = (0.3, 1.0)  # share of the path on which half of the travel takes place
    perturbation: float = 1.0  # RMS change of joints in the null space of the path's tasks
    crossing_half: tuple[float, float] = (0.05, 0.4)  # half the share of the path that is taken from the other motion
    crossing_width: tuple[float, float] = (0.05, 0.4)  # share of the path on which one motion blends into the other
    longest_jump: float = 0.7  # largest move of a joint from one sample to the next
    finer: tuple[int, ...] = (2, 4)  # factors of the number of samples, tried if a joint would jump


MOTION_OPTIONS = StartOptions()


def rollout_starts(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found time dof"]:
    """Return up to ``count`` weighted-pseudoinverse roll-outs, retracted onto the path.

    Each starts at its own posture, or at the given start, and has its own random symmetric weights with eigenvalues in
    (0, 1). If samples are too far apart, the path is sampled finer. Source: Tringali & Cocuzza 2020, section 3.1.2.
    Raises OutOfReach, naming the sample, or Infeasible if there is no continuous motion.
    """
    try:
        return _roll_out(task, count, rng)
    except Infeasible:
        if not np.allclose(np.diff(task.times), task.times[1], rtol=1e-9):
            raise
        for finer in MOTION_OPTIONS.finer:
            with suppress(Infeasible):
                return _roll_out(task.resample(finer * (len(task.times) - 1) + 1), count, rng)[:, ::finer]
        raise


def _roll_out(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found time dof"]:
    start = _first_postures(task, count, rng)
    if len(start) == 0:
        raise reach_error(task, rng, 0)
    q, last_sample = _integrate(task, start, rng, np.zeros((len(start), len(task.times) - 1)))
    if not len(q):
        raise reach_error(task, rng, last_sample)
    q, on_path = _retract_to_path(task, q)
    complete = on_path.all(axis=1)
    if not complete.any():
        raise reach_error(task, rng, int(np.argmin(on_path, axis=1).max()))
    return q[complete]


def travelling_starts(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found time dof"]:
    """Return up to ``count`` motions on the path that also travel along the self-motion.

    Length and time of each travel are random; cyclic motions travel there and back. Source: Tringali & Cocuzza 2020,
    Eq. 17, along the path instead of before it.
    """
    steps = len(task.times) - 1
    share, shape = (np.arange(steps) + 0.5) / steps, (count, 1)
    distance = MOTION_OPTIONS.travel * rng.uniform(0.0, 1.0, shape) ** 2
    if task.cyclic:
        pace = distance * np.pi / (2 * steps) * np.cos(2 * np.pi * (share - rng.uniform(0.0, 1.0, shape)))
    else:
        profile = np.exp(
            -(((share - rng.uniform(0.0, 1.0, shape)) / rng.uniform(*MOTION_OPTIONS.travel_width, shape)) ** 2) / 2
        )
        pace = distance * profile / profile.sum(axis=1, keepdims=True)
    start = _first_postures(task, count, rng)
    q, _ = _integrate(task, start, rng, pace[: len(start)])
    return _on_path(task, q)


def perturbed_starts(
    task: MotionTask,
    q: JointPaths,
    rng: np.random.Generator,
    *,
    size: float | Float[np.ndarray, " motions"] = MOTION_OPTIONS.perturbation,
) -> Float[np.ndarray, "found time dof"]:
    """Return motions on the path, perturbed along the null space of the tasks' Jacobian.

    size: RMS of the displacement [rad or arm length], largest at both ends

    Motions that leave the path or jump farther than before are left out.
    """
    share, shape = task.times / task.times[-1], (len(q), 1, task.arm.dof)
    scale = np.broadcast_to(size, len(q))[:, None, None]
    first, last = scale * rng.normal(size=shape), scale * rng.normal(size=shape)
    if task.cyclic:
        wave = np.cos(2 * np.pi * (share - rng.uniform(size=(len(q), 1))))[..., None]
        displacement = first * (1 + wave) / 2 + last * (1 - wave) / 2
    else:
        displacement = first * (1 - share)[:, None] * (task.start is None) + last * share[:, None]
    rows = row_space_basis(relative_errors(task.arm, task.tasks, q, task.targets)[1])
    displacement = displacement - np.einsum("ptdk,ptek,pte->ptd", rows, rows, displacement)
    return _on_path(task, q + displacement * joint_scales(task.arm), np.abs(np.diff(q, axis=1)))


def recombined_starts(
    task: MotionTask, q: JointPaths, others: JointPaths, rng: np.random.Generator
) -> Float[np.ndarray, "found time dof"]:
    """Return motions on the path that follow ``q``, but ``others`` on a random part of the path.

    Motions that leave the path or jump farther than both parents are left out: no self-motion connects their parents.
    """
    share, shape = task.times / task.times[-1], (len(q), 1)
    half, width = rng.uniform(*MOTION_OPTIONS.crossing_half, shape), rng.uniform(*MOTION_OPTIONS.crossing_width, shape)
    distance = np.abs(share - rng.uniform(size=shape))
    distance = np.minimum(distance, 1.0 - distance) if task.cyclic else distance
    progress = np.clip((half - distance) / width + 0.5, 0.0, 1.0)
    turns = 2 * np.pi * np.round((others - q).mean(axis=1, keepdims=True) / (2 * np.pi))
    unlimited = task.arm.periodic & ~np.isfinite(task.arm.position_limits).any(axis=1)
    difference = others - q - np.where(unlimited, turns, 0.0)
    steps = np.maximum(np.abs(np.diff(q, axis=1)), np.abs(np.diff(others, axis=1)))
    return _on_path(task, q + (progress**2 * (3 - 2 * progress))[..., None] * difference, steps)


def _first_postures(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found dof"]:
    return sample_postures(task, count, rng) if task.start is None else np.tile(task.start, (count, 1))


def _integrate(
    task: MotionTask,
    start: Float[np.ndarray, "count dof"],
    rng: np.random.Generator,
    pace: Float[np.ndarray, "count steps"],
) -> tuple[Float[np.ndarray, "found time dof"], int]:
    """Return motions near the path, closed if the task is cyclic, and the last sample reached.

    From sample to sample, a motion makes one Newton step, and a move of ``pace`` [rad, the arm's length] along the
    self-motion.
    """
    basis = np.linalg.qr(rng.normal(size=(len(start), task.arm.dof, task.arm.dof)))[0]
    eigenvalues = rng.uniform(0.02, 1.0, size=start.shape)  # eigenvalues of the random joint weights
    inverses = (basis / eigenvalues[:, None, :]) @ np.swapaxes(basis, -1, -2)
    heading = rng.normal(size=start.shape)
    q = np.empty((len(start), len(task.times), task.arm.dof))
    q[:, 0] = start
    alive = np.ones(len(start), dtype=bool)
    for i in range(1, len(task.times)):
        check_interruption()
        here = q[alive, i - 1]
        error, jacobian = relative_errors(task.arm, task.tasks, here, task.targets[i])
        spread = inverses[alive] @ np.swapaxes(jacobian, -1, -2)
        with np.errstate(all="ignore"):  # infinite steps at a singularity: the jump ends the roll-out
            move = (spread @ solve_small_systems(jacobian @ spread, error)[0][..., None])[..., 0]
        if pace.any():  # headings are projected to the nearest directions of self-motion
            rows = row_space_basis(jacobian)
            tangent = heading[alive] - np.einsum("pdk,pek,pe->pd", rows, rows, heading[alive])
            heading[alive] = tangent / np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
            move += pace[alive, i - 1, None] * heading[alive]
        q[alive, i] = here + move * joint_scales(task.arm)
        alive[alive] = np.abs(move).max(axis=1) <= MOTION_OPTIONS.longest_jump
        if not alive.any():
            return q[:0], i
    q = q[alive]
    if task.cyclic:  # the drift is removed evenly over time
        drift = q[:, -1:] - q[:, :1]
        drift = np.where(task.arm.periodic, (drift + np.pi) % (2 * np.pi) - np.pi, drift)
        q = q - (task.times / task.times[-1])[None, :, None] * drift
    return q, len(task.times) - 1


def _on_path(task: MotionTask, q: JointPaths, steps: np.ndarray | float = 0.0) -> Float[np.ndarray, "found time dof"]:
    """Return the motions that retraction brings completely onto the path, from the task's start."""
    q, on_path = _retract_to_path(task, q, steps)
    if task.start is not None:
        q[:, 0] = task.start
    return q[on_path.all(axis=1)]


def _retract_to_path(
    task: MotionTask, q: JointPaths, steps: np.ndarray | float = 0.0
) -> tuple[JointPaths, Bool[np.ndarray, "*batch time"]]:
    """Return motions retracted to the path, and a mask of their samples on it.

    A sample also counts as off the path if a joint jumps to it: its step from the sample before exceeds the expected
    ``steps`` by more than ``longest_jump``.
    """
    scales = joint_scales(task.arm)
    jacobian = relative_errors(task.arm, task.tasks, q, task.targets)[1]
    directions = scales * jacobian / np.maximum(np.linalg.norm(jacobian, axis=-1, keepdims=True), 1e-12)
    retracted = retract(task.arm, task.tasks, q, task.targets, directions.swapaxes(-1, -2))
    q_on_path, on_path = retracted.q, retracted.on_path
    if task.cyclic:
        q_on_path[:, -1] = q_on_path[:, 0]
    jumps = (np.abs(np.diff(q_on_path, axis=1)) - steps) / scales
    on_path[:, 1:] &= jumps.max(axis=2) <= MOTION_OPTIONS.longest_jump
    return q_on_path, on_path
