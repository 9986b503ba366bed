"""Motions between two motions of a task, and checks of motions from files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.errors import InvalidRun
from paretoik.formulations.protocol import ProblemParts, is_loop
from paretoik.front.front import Front
from paretoik.front.points import JointMotions
from paretoik.inputs import shown
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask, evaluate_motions
from paretoik.task.retraction import Retraction, relative_errors, retract_nearest, row_scales
from paretoik.task.task import describe_errors

# Motions between motions of one task: interpolated joint positions, moved back onto the path.


def values_between(
    task: MotionTask, q: Float[np.ndarray, "motions time dof"], shares: Float[np.ndarray, " shares"]
) -> Float[np.ndarray, "gaps shares n_obj"]:
    """Return minimised objectives at shares of the way between motions; inf if impossible.

    Joints take the shortest way; periodic ones make no whole turns.
    """
    motions = _motions_between(task, q, shares)
    with np.errstate(all="ignore"):  # off the path any value may occur
        F, limits, _ = evaluate_motions(task, task.motion(motions.q))
    F[~motions.on_path.all(axis=1)] = np.inf
    return possible_values(F, limits).reshape(len(q) - 1, len(shares), F.shape[-1])


def points_between(
    task: MotionTask | None, x: Points, shares: Float[np.ndarray, " shares"]
) -> list[Float[np.ndarray, " between *point"]]:
    """Return points at shares of the way between consecutive points; motions off their path are left out."""
    if task is None:
        between = x[:-1, None] + shares.reshape(-1, *[1] * (x.ndim - 1)) * np.diff(x, axis=0)[:, None]
        return list(between)
    motions = _motions_between(task, x, shares)
    rows = motions.on_path.all(axis=1).reshape(len(x) - 1, len(shares))
    every = motions.q.reshape(*rows.shape, *x.shape[1:])
    return [each[good] for each, good in zip(every, rows, strict=True)]


def _motions_between(task: MotionTask, q: np.ndarray, shares: np.ndarray) -> Retraction:
    """Return motions (gaps · shares, time, dof) between consecutive ones, retracted to the path.

    ``shares``: shares of the way from each motion to the next
    """
    step = np.diff(q, axis=0)
    turns = np.round(step.mean(axis=1, keepdims=True) / (2 * np.pi))
    step = step - np.where(task.arm.periodic, 2 * np.pi * turns, 0.0)
    between = q[:-1, None] + shares[:, None, None] * step[:, None]
    return retract_nearest(task.arm, task.tasks, between.reshape(-1, *q.shape[1:]), task.targets)


def possible_values(
    F: Float[np.ndarray, "points n_obj"], violation: Float[np.ndarray, "points limits"]
) -> Float[np.ndarray, "points n_obj"]:
    """Return objectives; inf if one is not finite or a limit is exceeded by more than its range."""
    possible = np.isfinite(F).all(axis=1) & ~(violation > 1.0).any(axis=1)
    return np.where(possible[:, None], F, np.inf)


# Motions of a stored run, checked against their task.


STORED_TOLERANCE = 1e-9  # largest distance of a stored motion from its path [arm's length, rad]; for a loop [m]


def restore_motions(problem: Any, front: Front) -> Any:
    """Return a stored front's motions with their arm, from joint positions, otherwise from genes.

    Raises InvalidRun as ``motions_of_task`` does, and if a loop's mean distance from its path (Marcos et al. 2012,
    Eq. 23) differs from the stored one.
    """
    if front.motions is None:
        return None
    parts = ProblemParts(problem)
    motions = None if parts.task is None else motions_of_task(problem, front.motions, front.ids.tolist())
    if motions is None:
        if parts.follows_path is True:
            raise InvalidRun("motions must have the times of the problem's path, got other times")
        decoded = None if front.genes is None else parts.decode(np.array(front.genes))
        return front.motions if decoded is None else decoded
    if is_loop(front):
        error, stated = float(motions.position_error[..., 1:].mean()), front.provenance.get("position_error")
        if not (isinstance(stated, float | int) and abs(error - stated) <= STORED_TOLERANCE * max(error, 1.0)):
            raise InvalidRun(
                f"motions must be at a mean distance of {shown(stated)} m from the path, got {error:.6g} m"
            )
    return motions


def motions_of_task(problem: Any, stored: JointMotions, ids: Sequence[int]) -> Motion | None:
    """Return stored motions with a task's arm, by joint names; None if times differ.

    Raises InvalidRun if joints differ, or if a motion leaves a path that the problem follows exactly.
    """
    task: MotionTask = problem.task
    q, names = np.asarray(stored.q), list(stored.arm.joint_names)
    if sorted(names) != sorted(task.arm.joint_names):
        raise InvalidRun(f"motions must have the joints {', '.join(task.arm.joint_names)}, got {', '.join(names)}")
    task = task.truncate(q.shape[-2])
    if not np.allclose(stored.time, task.times, rtol=1e-9, atol=0):
        return None
    motions = task.motion(q[..., [names.index(name) for name in task.arm.joint_names]])
    if ProblemParts(problem).follows_path is not True:
        return motions
    relative, _ = relative_errors(task.arm, task.tasks, motions.q, task.targets)
    off = np.argwhere(~(np.abs(relative).max(axis=-1, initial=0.0) <= STORED_TOLERANCE))
    if len(off):
        row, sample = (int(i) for i in off[0])
        distance = describe_errors(task.tasks, relative[row, sample] * row_scales(task.arm, task.tasks))
        raise InvalidRun(
            f"motions must be on the path of the problem, got point {ids[row]} {distance} off it at sample {sample} "
            f"({task.times[sample]:.3g} s)"
        )
    return motions
