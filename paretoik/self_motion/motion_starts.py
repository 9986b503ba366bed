"""Motions on the path to start from: roll-outs, some that travel along the self-motion, perturbed, recombined ones."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from paretoik.arrays import JointPaths
from paretoik.errors import Infeasible
from paretoik.robot.scales import joint_scales
from paretoik.self_motion.start_postures import reach_error, sample_postures
from paretoik.stop_flag import check_interruption
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import relative_errors, retract, row_space_basis, solve_small_systems


@dataclass(frozen=True, kw_only=True)
class StartOptions:
    """How far starts move, in rad, slides in lengths of the arm."""

    travel: float = 9.0  # all joints together along the self-motion, at most
    travel_width: tuple[float, float] = (0.3, 1.0)  # shares of the path into which half of the travel falls
    perturbation: float = 1.0  # RMS change of joints where the path leaves them free
    crossing_half: tuple[float, float] = (0.05, 0.4)  # half the share of the path that is another's, recombined
    crossing_width: tuple[float, float] = (0.05, 0.4)  # share of the path in which one changes over to the other
    longest_jump: float = 0.7  # of a joint from one sample to the next
    finer: tuple[int, ...] = (2, 4)  # times as many samples, tried in turn where a joint would jump between two


OPTIONS = StartOptions()


def rollout_starts(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found time dof"]:
    """Return up to ``count`` motions on the path, by roll-outs of weighted pseudoinverses.

    Each starts at another posture (or all at the given one) and weighs the joints by its own random symmetric matrix
    with eigenvalues in (0, 1); the whole is then retracted to the path. Source: Tringali & Cocuzza 2020,
    section 3.1.2.

    Where samples are too far apart for that, they are taken closer on the way.

    Raises OutOfReach, naming the sample, where no posture reaches the path; Infeasible where postures exist everywhere
    but no continuous motion was found.
    """
    try:
        return _roll_out(task, count, rng)
    except Infeasible:
        if not np.allclose(np.diff(task.times), task.times[1], rtol=1e-9):
            raise
        for finer in OPTIONS.finer:
            with suppress(Infeasible):
                return _roll_out(task.resample(finer * (len(task.times) - 1) + 1), count, rng)[:, ::finer]
        raise


def _roll_out(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found time dof"]:
    start = _sample_first_postures(task, count, rng)
    if len(start) == 0:
        raise reach_error(task, rng, 0)
    q, last_sample = _integrate(task, start, rng, np.zeros((len(start), len(task.times) - 1)))
    if not len(q):
        raise reach_error(task, rng, last_sample)
    q, on_path = _retract_to_path(task, _remove_drift(task, q) if task.cyclic else q)
    complete = on_path.all(axis=1)
    if not complete.any():
        raise reach_error(task, rng, int(np.argmin(on_path, axis=1).max()))
    return q[complete]


def travelling_starts(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found time dof"]:
    """Return up to ``count`` motions on the path that travel along the self-motion meanwhile.

    Roll-outs alone move little: they do not pass through the postures between one branch and another.
    Each travels so far, and mostly at such a time, as chance has it; cyclic motions there and back.
    Source: Tringali & Cocuzza 2020, Eq. 17, along the path instead of before it.
    """
    steps = len(task.times) - 1
    share, shape = (np.arange(steps) + 0.5) / steps, (count, 1)
    distance = OPTIONS.travel * rng.uniform(0.0, 1.0, shape) ** 2
    if task.cyclic:
        pace = distance * np.pi / (2 * steps) * np.cos(2 * np.pi * (share - rng.uniform(0.0, 1.0, shape)))
    else:
        profile = np.exp(
            -(((share - rng.uniform(0.0, 1.0, shape)) / rng.uniform(*OPTIONS.travel_width, shape)) ** 2) / 2
        )
        pace = distance * profile / profile.sum(axis=1, keepdims=True)
    start = _sample_first_postures(task, count, rng)
    q, _ = _integrate(task, start, rng, pace[: len(start)])
    q, on_path = _retract_to_path(task, _remove_drift(task, q) if task.cyclic else q)
    if task.start is not None:
        q[:, 0] = task.start
    return q[on_path.all(axis=1)]


def perturbed_starts(
    task: MotionTask,
    q: JointPaths,
    rng: np.random.Generator,
    *,
    size: float | Float[np.ndarray, " motions"] = OPTIONS.perturbation,
) -> Float[np.ndarray, "found time dof"]:
    """Return motions on the path near others, all joints displaced at random by ``size`` [rad or arm's length, RMS].

    Most at both ends (in cyclic motions at opposite points), less in between, along the null space of the tasks'
    Jacobian; then they are retracted. Motions that leave the path, or jump further than they did, are left out.
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
    retracted, on_path = _retract_to_path(task, q + displacement * joint_scales(task.arm), np.abs(np.diff(q, axis=1)))
    if task.start is not None:
        retracted[:, 0] = task.start
    return retracted[on_path.all(axis=1)]


def recombined_starts(
    task: MotionTask, q: JointPaths, others: JointPaths, rng: np.random.Generator
) -> Float[np.ndarray, "found time dof"]:
    """Return motions on the path like those of ``q``, except that for a while they are like ``others``, in pairs.

    They change over at random times, interpolated joint by joint and retracted. Those that leave the path meanwhile, or
    jump further than both did, are left out: no self-motion leads straight across.
    """
    share, shape = task.times / task.times[-1], (len(q), 1)
    half, width = rng.uniform(*OPTIONS.crossing_half, shape), rng.uniform(*OPTIONS.crossing_width, shape)
    distance = np.abs(share - rng.uniform(size=shape))
    distance = np.minimum(distance, 1.0 - distance) if task.cyclic else distance
    progress = np.clip((half - distance) / width + 0.5, 0.0, 1.0)
    turns = 2 * np.pi * np.round((others - q).mean(axis=1, keepdims=True) / (2 * np.pi))
    unlimited = task.arm.periodic & ~np.isfinite(task.arm.position_limits).any(axis=1)
    difference = others - q - np.where(unlimited, turns, 0.0)
    steps = np.maximum(np.abs(np.diff(q, axis=1)), np.abs(np.diff(others, axis=1)))
    crossing = q + (progress**2 * (3 - 2 * progress))[..., None] * difference
    retracted, on_path = _retract_to_path(task, crossing, steps)
    if task.start is not None:
        retracted[:, 0] = task.start
    return retracted[on_path.all(axis=1)]


def _sample_first_postures(task: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "found dof"]:
    return sample_postures(task, count, rng) if task.start is None else np.tile(task.start, (count, 1))


def _integrate(
    task: MotionTask,
    start: Float[np.ndarray, "count dof"],
    rng: np.random.Generator,
    pace: Float[np.ndarray, "count steps"],
) -> tuple[Float[np.ndarray, "found time dof"], int]:
    """Return motions near the path, and the sample that the last of them reached.

    One Newton step a sample, each making good the error of the one before, and ``pace`` [rad, the arm's length] along
    the self-motion.
    """
    inverses = _sample_inverse_weights(len(start), task.arm.dof, rng)
    heading = rng.normal(size=start.shape)
    q = np.empty((len(start), len(task.times), task.arm.dof))
    q[:, 0] = start
    alive = np.ones(len(start), dtype=bool)
    for i in range(1, len(task.times)):
        check_interruption()
        here = q[alive, i - 1]
        error, jacobian = relative_errors(task.arm, task.tasks, here, task.targets[i])
        spread = inverses[alive] @ np.swapaxes(jacobian, -1, -2)
        with np.errstate(all="ignore"):  # at a singularity steps grow without bound, and the jump ends the roll-out
            move = (spread @ solve_small_systems(jacobian @ spread, error)[0][..., None])[..., 0]
        if pace.any():
            heading[alive] = _project_to_self_motion(row_space_basis(jacobian), heading[alive])
            move += pace[alive, i - 1, None] * heading[alive]
        q[alive, i] = here + move * joint_scales(task.arm)
        alive[alive] = np.abs(move).max(axis=1) <= OPTIONS.longest_jump
        if not alive.any():
            return q[:0], i
    return q[alive], len(task.times) - 1


def _project_to_self_motion(rows: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """Return unit directions of self-motion (count, dof) nearest to headings; ``rows`` move the tool."""
    tangent = heading - np.einsum("pdk,pek,pe->pd", rows, rows, heading)
    return tangent / np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)


def _sample_inverse_weights(count: int, dof: int, rng: np.random.Generator) -> Float[np.ndarray, "count dof dof"]:
    basis = np.linalg.qr(rng.normal(size=(count, dof, dof)))[0]
    eigenvalues = rng.uniform(0.02, 1.0, size=(count, dof))
    return (basis / eigenvalues[:, None, :]) @ np.swapaxes(basis, -1, -2)


def _remove_drift(task: MotionTask, q: JointPaths) -> JointPaths:
    """Return motions that end in the posture they start from, their drift taken out evenly over time."""
    drift = q[:, -1:] - q[:, :1]
    drift = np.where(task.arm.periodic, (drift + np.pi) % (2 * np.pi) - np.pi, drift)
    return q - (task.times / task.times[-1])[None, :, None] * drift


def _retract_to_path(
    task: MotionTask, q: JointPaths, steps: np.ndarray | float = 0.0
) -> tuple[JointPaths, Bool[np.ndarray, "*batch time"]]:
    """Return motions retracted to the path, and which of their samples are on it without a jump beyond ``steps``."""
    scales = joint_scales(task.arm)
    jacobian = relative_errors(task.arm, task.tasks, q, task.targets)[1]
    directions = scales * jacobian / np.maximum(np.linalg.norm(jacobian, axis=-1, keepdims=True), 1e-12)
    retracted = retract(task.arm, task.tasks, q, task.targets, directions.swapaxes(-1, -2))
    q_on_path, on_path = retracted.q, retracted.on_path
    if task.cyclic:
        q_on_path[:, -1] = q_on_path[:, 0]
    jumps = (np.abs(np.diff(q_on_path, axis=1)) - steps) / scales
    on_path[:, 1:] &= jumps.max(axis=2) <= OPTIONS.longest_jump
    return q_on_path, on_path
