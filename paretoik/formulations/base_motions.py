"""The motions that ``Tracking`` starts from: the best roll-outs of every branch, others far from them, a user's."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from paretoik.arrays import JointPaths
from paretoik.errors import InvalidInput
from paretoik.self_motion.branches import branch_labels
from paretoik.self_motion.motion_starts import rollout_starts
from paretoik.task.evaluation import evaluate_motions
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.motion_task_validation import START_TOLERANCE
from paretoik.task.retraction import relative_errors, task_errors
from paretoik.task.task import describe_errors
from paretoik.trajectory.program import joint_distance


@dataclass(frozen=True, kw_only=True)
class RolloutOptions:
    """How many roll-outs there are: ``most``, fewer on paths of more than ``samples`` samples, but ``least``."""

    most: int = 256
    least: int = 64
    samples: int = 101


OPTIONS = RolloutOptions()


def sample_rollouts(task: MotionTask, rng: np.random.Generator) -> JointPaths:
    """Return roll-outs, as many as OPTIONS says: those that violate limits less first, then by non-domination."""
    count = OPTIONS.most * OPTIONS.samples // len(task.times)
    q = rollout_starts(task, min(max(count, OPTIONS.least), OPTIONS.most), rng)
    F, limits, _ = evaluate_motions(task, task.motion(q))
    violation = np.maximum(np.nan_to_num(limits, nan=1e3), 0).sum(axis=1).round(6)
    finite = np.where(np.isfinite(F), F, np.nanmax(np.where(np.isfinite(F), F, np.nan), axis=0, initial=0.0))
    rank = np.sum(np.all(finite[None] <= finite[:, None], axis=-1), axis=1)
    return q[np.lexsort((rank, violation))]


def choose_bases(task: MotionTask, rollouts: JointPaths, count: int) -> Float[np.ndarray, "bases time dof"]:
    """Return the best roll-out of every branch, then the farthest of the better halves, at most ``count``."""
    branch = np.array(branch_labels(task.motion(rollouts)))
    members = [np.flatnonzero(branch == name) for name in dict.fromkeys(branch)]
    chosen = [int(rows[0]) for rows in members][:count]
    pool = np.concatenate([rows[: (len(rows) + 1) // 2] for rows in members])
    distances = joint_distance(task, rollouts[pool, None], rollouts[chosen]).min(axis=1)
    while len(chosen) < min(count, len(pool)):
        chosen.append(int(pool[np.argmax(distances)]))
        distances = np.minimum(distances, joint_distance(task, rollouts[pool], rollouts[chosen[-1]]))
    return rollouts[chosen]


def without_added_samples(task: MotionTask, motions: Motion) -> Motion:
    """Return motions at the samples of a task, if they have more; others as they are."""
    times = motions.time.reshape(-1, motions.time.shape[-1])[0]
    index = np.searchsorted(times, task.times).clip(max=len(times) - 1)
    added = len(times) > len(index) and np.array_equal(times[index], task.times)
    return replace(motions, time=task.times, q=motions.q[..., index, :]) if added else motions


def positions_on_path(task: MotionTask, motions: Motion) -> JointPaths:
    """Return the joint positions of a user's motions.

    Raises InvalidInput where they are not of the task's arm and samples, or more than 1e-6 rad or lengths of the arm
    off the path.
    """
    if not isinstance(motions, Motion):
        raise InvalidInput(f"initial: motions wanted, got {type(motions).__name__}")
    motions = without_added_samples(task, motions)
    q = np.array(motions.q if motions.q.ndim == 3 else motions.q[None])
    if motions.arm.joint_names != task.arm.joint_names or q.shape[1] != len(task.times):
        raise InvalidInput(
            f"initial: motions of {task.arm.name} with {len(task.times)} samples wanted, got {motions.arm.name} with "
            f"{q.shape[1]}"
        )
    if np.abs(relative_errors(task.arm, task.tasks, q, task.targets)[0]).max() > START_TOLERANCE:
        largest = np.abs(task_errors(task.arm, task.tasks, q, task.targets)[0]).max(axis=(0, 1))
        distance = describe_errors(task.tasks, largest)
        raise InvalidInput(f"initial: motions on the path wanted, got some that are {distance} off")
    return q
