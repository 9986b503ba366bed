"""Motions that a plan starts from.

Source: Tringali & Cocuzza 2020, sections 3.1.2 and 3.1.3.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import JointPaths
from paretoik.errors import Infeasible, InvalidInput
from paretoik.task.motion_task import MotionTask, evaluate_motions
from paretoik.task.objectives import Objective, objective
from paretoik.task.random_starts import rollout_starts, travelling_starts
from paretoik.task.self_motion import branch_labels
from paretoik.trajectory.grid_oracle import grid_oracle
from paretoik.trajectory.levels import coarsest_level


@dataclass(frozen=True, kw_only=True)
class StartOptions:
    """Numbers and kinds of starts."""

    rollouts: int = 4  # number of roll-outs tried for each start
    travelling: int = 3  # number of motions tried for each start that travels
    spacing: float = 0.15  # rad or arm lengths: distance of a grid's nodes; the grid takes the time of many starts
    classes: int = 8  # largest number of paths of a grid


OPTIONS = StartOptions()


@objective(unit="rad²/s", form="integral")
def squared_velocity(motion: Any) -> Any:
    """Return Σᵢ q̇ᵢ²."""
    return np.sum(motion.dq**2, axis=-1)


def initial_motions(
    task: MotionTask, *, starts: int, seed: int, first: int = 0
) -> Float[np.ndarray, "starts samples dof"]:
    """Return ``starts`` motions per degree of redundancy on a coarse level.

    It is the coarsest level, or the level ``first``. Half of the motions are roll-outs. The others travel along the
    self-motion, which roll-outs rarely do. All are the most promising of many.
    """
    count = starts * max(task.redundancy, 1)
    return sample_starts(coarsest_level(task, first), count, np.random.default_rng(seed))


def sample_starts(level: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "starts samples dof"]:
    """Return at most ``count`` motions on the path of a level."""
    rollouts = rollout_starts(level, OPTIONS.rollouts * count, rng)
    travelling = sample_travelling(level, count // 2, rng)
    others = count - len(travelling)
    return np.concatenate([_most_promising(level, rollouts[: OPTIONS.rollouts * others], others), travelling])


def sample_travelling(
    level: MotionTask, count: int, rng: np.random.Generator
) -> Float[np.ndarray, "starts samples dof"]:
    """Return at most ``count`` motions that travel along the self-motion.

    They are the most promising of more.
    """
    return _most_promising(level, travelling_starts(level, OPTIONS.travelling * count, rng), count)


def grid_starts(level: MotionTask) -> Float[np.ndarray, "paths samples dof"]:
    """Return the best path of every class through a coarse grid.

    The grid is one of postures. Without result if the grid would take long. If the objective depends on accelerations,
    as with torques, the motions that move least are used instead; under gravity also the motions that are best without
    accelerations.
    """
    with suppress(InvalidInput, Infeasible):  # there is no grid for the task, or no path through a coarse one
        return _grid_paths(level, level.objectives)
    paths = [np.empty((0, len(level.times), level.arm.dof))]
    surrogates: list[tuple[Objective, ...]] = [(squared_velocity,)]
    if level.arm.gravity.any():
        surrogates.insert(0, tuple(_without_acceleration(each) for each in level.objectives))
    for objectives in surrogates:
        with suppress(InvalidInput, Infeasible):
            paths.append(_grid_paths(level, objectives))
    return np.concatenate(paths)


def _grid_paths(level: MotionTask, objectives: tuple[Objective, ...]) -> Float[np.ndarray, "paths samples dof"]:
    task = replace(level, objectives=objectives, differences="backward", ends_at_rest=False)  # a grid needs these
    return grid_oracle(task, resolution=OPTIONS.spacing, classes=OPTIONS.classes, quick=True).q


def _without_acceleration(one: Objective) -> Objective:
    """Return an objective that ignores accelerations.

    Its motions have the same positions and velocities, and acceleration 0.
    """

    def function(motion: Any) -> Any:
        slow = replace(motion)  # a copy without computed quantities
        vars(slow).update(dq=motion.dq, ddq=np.zeros_like(motion.q), jerk=np.zeros_like(motion.q))
        return one.function(slow)

    return replace(one, function=function)


def _most_promising(task: MotionTask, q: JointPaths, limit: int) -> Float[np.ndarray, "chosen time dof"]:
    """Return the most promising motions, as starts.

    They are the best of every branch by objectives and limits; branches alternate.
    """
    if not len(q):
        return q
    F, limits, _ = evaluate_motions(task, task.motion(q))
    finite = np.isfinite(F.T)
    usual = np.where(finite, np.abs(F.T), 0.0).sum(axis=1) / np.maximum(finite.sum(axis=1), 1)
    merit = np.sum(F.T / np.maximum(usual, 1e-300)[:, None], axis=0)  # NaN comes last: a function fails
    violation = np.maximum(limits, 0).sum(axis=1)
    order = np.lexsort((merit, np.round(violation, 2)))
    branch = np.array(branch_labels(task.motion(q[order])))
    turn = np.empty(len(order), dtype=int)
    for name in np.unique(branch):
        members = np.flatnonzero(branch == name)
        turn[members] = np.arange(len(members))
    return q[order[np.argsort(turn, kind="stable")[:limit]]]
