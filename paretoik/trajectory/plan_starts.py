"""Motions that a plan starts from, and restart policies: which starts to add, given the solutions so far.

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
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import Solver
from paretoik.nlp.solutions import Solutions, concatenate
from paretoik.self_motion.branches import branch_labels
from paretoik.self_motion.motion_starts import perturbed_starts, rollout_starts, travelling_starts
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import objective
from paretoik.trajectory.grid_oracle import grid_oracle
from paretoik.trajectory.levels import OPTIONS as LEVELS
from paretoik.trajectory.levels import coarsest_level, distinct_rows
from paretoik.trajectory.program import MotionProgram, joint_distance


@dataclass(frozen=True, kw_only=True)
class StartOptions:
    """How many starts there are, and when more are tried: rare optima for one degree of redundancy, else hops."""

    rollouts: int = 4  # that are tried for each start
    spacing: float = 0.15  # rad or m: of a grid's nodes, so that it takes as long as many starts
    classes: int = 8  # of a grid's paths, at most
    rare: int = 2  # starts at most that reached an optimum, so that others are likely that none has reached
    many: int = 6  # optima, so that others are likely too
    rounds: int = 4  # batches at most that are added while an optimum is rare
    hop_centers: int = 4  # best optima that are perturbed in a hop (basin hopping)
    patience: int = 2  # hops in turn that brought nothing better
    hops: int = 12  # at most
    disturbed: int = 3  # best optima that are minimised from high barriers again at the end, and how often at most
    gain: float = 1e-6  # share of a value by which another is better


OPTIONS = StartOptions()


@objective(unit="rad²/s", form="integral")
def _squared_velocity(motion: Any) -> Any:
    return np.sum(motion.dq**2, axis=-1)


def initial_motions(
    task: MotionTask, *, starts: int, seed: int, first: int = 0
) -> Float[np.ndarray, "starts samples dof"]:
    """Return starts over the coarsest level, or the level ``first``, ``starts`` for every degree of redundancy.

    Half are the most promising of many roll-outs, half travel along the self-motion, which roll-outs hardly do.
    """
    count = starts * max(task.redundancy, 1)
    return sample_starts(coarsest_level(task, first), count, np.random.default_rng(seed))


def sample_starts(level: MotionTask, count: int, rng: np.random.Generator) -> Float[np.ndarray, "starts samples dof"]:
    """Return at most so many motions on the path of a level."""
    rollouts = rollout_starts(level, OPTIONS.rollouts * count, rng)
    travelling = travelling_starts(level, count, rng)[: count // 2]
    others = count - len(travelling)
    return np.concatenate([_most_promising(level, rollouts[: OPTIONS.rollouts * others], others), travelling])


def grid_starts(level: MotionTask, dof: int) -> Float[np.ndarray, "paths samples dof"]:
    """Return the best paths of every class through a coarse grid of postures; none where that would take long.

    Where the objective asks for accelerations, as torques do, what moves least is taken for the best instead.
    """
    for objectives in (level.objectives, (_squared_velocity,)):
        with suppress(InvalidInput, Infeasible):  # there is no grid of such a task, or no path through one so coarse
            grid_task = replace(level, objectives=objectives)
            return grid_oracle(grid_task, resolution=OPTIONS.spacing, classes=OPTIONS.classes, quick=True).q
    return np.empty((0, len(level.times), dof))


def _most_promising(task: MotionTask, q: JointPaths, limit: int) -> Float[np.ndarray, "chosen time dof"]:
    """Return the motions to start from: in every branch the best by objectives and limits, the branches in turn."""
    motions = task.motion(q)
    values = np.stack([o(motions) * o.sign for o in task.objectives])
    merit = np.sum(values / np.maximum(np.abs(values).mean(axis=1, keepdims=True), 1e-300), axis=0)
    violation = np.maximum(task.violations(motions), 0).sum(axis=1) if task.limit_names else np.zeros(len(q))
    order = np.lexsort((merit, np.round(violation, 2)))
    branch = np.array(branch_labels(task.motion(q[order])))
    turn = np.empty(len(order), dtype=int)
    for name in np.unique(branch):
        members = np.flatnonzero(branch == name)
        turn[members] = np.arange(len(members))
    return q[order[np.argsort(turn, kind="stable")[:limit]]]


class RestartPolicy:
    """Which starts to add, batch by batch, to those of the coarsest level.

    With one degree of redundancy, as long as some optimum is rare: starts perturbed at random and others that travel;
    once, where optima stay rare or are many, or nothing converged, paths through a grid. With more degrees, where
    valleys are many and flat and every start finds another point: others that travel and the best ones perturbed, as
    long as the best gets better (basin hopping, Wales & Doye 1997).
    """

    def __init__(self, level: MotionTask, q: np.ndarray, count: int, rng: np.random.Generator) -> None:
        self.level, self.q, self.count, self.rng = level, q, count, rng
        self.rounds, self.grid_tried, self.best, self.failures = 0, False, np.inf, 0

    @property
    def exhausted(self) -> bool:
        """Whether there are no more starts."""
        return self.level.redundancy > 1 or self.rounds >= OPTIONS.rounds

    def __call__(self, solutions: Solutions) -> Float[np.ndarray, "starts samples dof"]:
        """Return further starts, or none."""
        if self.level.redundancy > 1:
            return self._hop(solutions)
        if not solutions.converged.any():
            return solutions.x[:0] if self.grid_tried else self._grid()
        converged = solutions.x[solutions.converged]
        rows = distinct_rows(self.level, solutions, solutions.objectives[:, 0], limit=len(solutions))
        hits = [
            int((joint_distance(self.level, optimum, converged) <= LEVELS.distinct).sum())
            for optimum in solutions.x[rows]
        ]
        rare = self.rounds < OPTIONS.rounds and min(hits) <= OPTIONS.rare
        try_grid = len(hits) >= OPTIONS.many or (rare and self.rounds > 0)
        if not self.grid_tried and try_grid and len(paths := self._grid()):
            return paths
        starts = solutions.x[:0]
        while rare and not len(starts) and self.rounds < OPTIONS.rounds:
            self.rounds += 1
            starts = self._sample()
        return starts

    def _sample(self) -> Float[np.ndarray, "starts samples dof"]:
        if self.rounds % 2:
            some = self.rng.permutation(self.q)[: 2 * self.count]
            return perturbed_starts(self.level, some, self.rng)[: self.count]
        return travelling_starts(self.level, 2 * self.count, self.rng)[: self.count]

    def _grid(self) -> Float[np.ndarray, "paths samples dof"]:
        self.grid_tried = True
        return grid_starts(self.level, self.q.shape[2])

    def _hop(self, solutions: Solutions) -> Float[np.ndarray, "starts samples dof"]:
        if not solutions.converged.any():
            return solutions.x[:0]
        best = float(solutions.objectives[solutions.converged, 0].min())
        self.failures = 0 if _is_better(best, self.best) else self.failures + 1
        self.best, self.rounds = min(best, self.best), self.rounds + 1
        if self.failures >= OPTIONS.patience or self.rounds > OPTIONS.hops:
            return solutions.x[:0]
        rows = distinct_rows(self.level, solutions, solutions.objectives[:, 0], limit=OPTIONS.hop_centers)
        repeated = np.repeat(solutions.x[rows], -(-self.count // len(rows)), axis=0)
        hops = perturbed_starts(self.level, repeated, self.rng)
        return np.concatenate([hops, travelling_starts(self.level, self.count, self.rng)])


def disturb_best(program: MotionProgram, solutions: Solutions, solver: Solver = "auto") -> Solutions:
    """Return optima and those that the best reach from a high barrier, while the best gets better.

    Where valleys are many, as in two and more directions of self-motion, neighbouring ones are as often better as not.
    """
    weights = np.zeros((1, len(program.upper)))
    weights[0, 0] = 1.0
    for _ in range(OPTIONS.disturbed):
        before = solutions.objectives[0, 0]
        best = solutions.x[: OPTIONS.disturbed]
        both = concatenate(
            (solutions, *(minimise(program, best, weights, options=each, solver=solver) for each in LEVELS.cold))
        )
        solutions = both[distinct_rows(program.task, both, both.objectives[:, 0], limit=len(both))]
        if not _is_better(solutions.objectives[0, 0], before):
            break
    return solutions


def _is_better(value: float, before: float) -> bool:
    return bool(before == np.inf or value < before - OPTIONS.gain * abs(before))
