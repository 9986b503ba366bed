"""Motions between motions of one task: joint positions in between, led back onto the path."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Points
from paretoik.task.evaluation import evaluate_motions
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import Retraction, retract_nearest


def values_between(
    task: MotionTask, q: Float[np.ndarray, "motions time dof"], shares: Float[np.ndarray, " shares"]
) -> Float[np.ndarray, "gaps shares n_obj"]:
    """Return the objectives, minimised, at shares of the way from each motion to the next; inf where none is possible.

    Joints go the shortest way, whole turns of periodic ones left out.
    """
    motions = _motions_between(task, q, shares)
    with np.errstate(all="ignore"):  # what is not on the path may do anything
        F, limits, _ = evaluate_motions(task, task.motion(motions.q))
    F[~motions.on_path.all(axis=1)] = np.inf
    return possible_values(F, limits).reshape(len(q) - 1, len(shares), F.shape[-1])


def points_between(
    task: MotionTask | None, x: Points, shares: Float[np.ndarray, " shares"]
) -> list[Float[np.ndarray, " between *point"]]:
    """Return the points at shares of the way from each point to the next, those of motions that are on their path."""
    if task is None:
        between = x[:-1, None] + shares.reshape(-1, *[1] * (x.ndim - 1)) * np.diff(x, axis=0)[:, None]
        return list(between)
    motions = _motions_between(task, x, shares)
    rows = motions.on_path.all(axis=1).reshape(len(x) - 1, len(shares))
    every = motions.q.reshape(*rows.shape, *x.shape[1:])
    return [each[good] for each, good in zip(every, rows, strict=True)]


def _motions_between(task: MotionTask, q: np.ndarray, shares: np.ndarray) -> Retraction:
    """Return the motions (gaps · shares, time, dof) at shares of the way from each to the next, led onto the path."""
    step = np.diff(q, axis=0)
    turns = np.round(step.mean(axis=1, keepdims=True) / (2 * np.pi))
    step = step - np.where(task.arm.periodic, 2 * np.pi * turns, 0.0)
    between = q[:-1, None] + shares[:, None, None] * step[:, None]
    return retract_nearest(task.arm, task.tasks, between.reshape(-1, *q.shape[1:]), task.targets)


def possible_values(
    F: Float[np.ndarray, "points n_obj"], violation: Float[np.ndarray, "points limits"]
) -> Float[np.ndarray, "points n_obj"]:
    """Return objectives, inf where they have no value or a limit is exceeded by more than its whole range."""
    possible = np.isfinite(F).all(axis=1) & ~(violation > 1.0).any(axis=1)
    return np.where(possible[:, None], F, np.inf)
