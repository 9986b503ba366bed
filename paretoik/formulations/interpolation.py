"""Motions between motions of one task: joint positions in between, led back onto the path."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.formulations.base_motions import evaluate_motions
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import retract_nearest


def values_between(
    task: MotionTask, q: Float[np.ndarray, "motions time dof"], shares: Float[np.ndarray, " shares"]
) -> Float[np.ndarray, "gaps shares n_obj"]:
    """Return the objectives, minimised, at shares of the way from each motion to the next; inf where none is possible.

    Joints go the shortest way, whole turns of periodic ones left out.
    """
    step = np.diff(q, axis=0)
    turns = np.round(step.mean(axis=1, keepdims=True) / (2 * np.pi))
    step = step - np.where(task.arm.periodic, 2 * np.pi * turns, 0.0)
    between = q[:-1, None] + shares[:, None, None] * step[:, None]
    motions = retract_nearest(task.arm, task.tasks, between.reshape(-1, *q.shape[1:]), task.targets)
    with np.errstate(all="ignore"):  # what is not on the path may do anything
        F, limits, _ = evaluate_motions(task, task.motion(motions.q))
    F[~motions.on_path.all(axis=1)] = np.inf
    return possible_values(F, limits).reshape(*between.shape[:2], F.shape[-1])


def possible_values(
    F: Float[np.ndarray, "points n_obj"], violation: Float[np.ndarray, "points limits"]
) -> Float[np.ndarray, "points n_obj"]:
    """Return objectives, inf where they have no value or a limit is exceeded by more than its whole range."""
    possible = np.isfinite(F).all(axis=1) & ~(violation > 1.0).any(axis=1)
    return np.where(possible[:, None], F, np.inf)
