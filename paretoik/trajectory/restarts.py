"""Restart policies: which starts to add to those of a plan, given the solutions so far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import Solver
from paretoik.nlp.solutions import Solutions, concatenate
from paretoik.self_motion.motion_starts import perturbed_starts, travelling_starts
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.initial_motions import grid_starts
from paretoik.trajectory.levels import OPTIONS as LEVELS
from paretoik.trajectory.levels import distinct_rows
from paretoik.trajectory.program import MotionProgram, joint_distance


@dataclass(frozen=True, kw_only=True)
class RestartOptions:
    """When more starts are tried.

    With one degree of redundancy: an optimum that at most ``rare`` starts reached is rare, and others are likely that
    none has reached; with ``many`` optima likely too. At most ``rounds`` batches are added until none is rare. With
    more degrees (basin hopping) the best ``hop_centers`` are perturbed, at most ``hops`` times, until ``patience``
    rounds in turn brought nothing better. At the end the best ``disturbed`` are minimised from high barriers again, at
    most as often. A value better by less than the share ``gain`` is no better.
    """

    rare: int = 2
    many: int = 6
    rounds: int = 4
    hop_centers: int = 4
    patience: int = 2
    hops: int = 12
    disturbed: int = 3
    gain: float = 1e-6


OPTIONS = RestartOptions()


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
