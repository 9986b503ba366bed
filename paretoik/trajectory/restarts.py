"""Restart policy: which starts to add, batch by batch, until hardly an optimum better than all is likely unseen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import Solver
from paretoik.nlp.solutions import Solutions, concatenate
from paretoik.self_motion.branches import branch_labels
from paretoik.self_motion.motion_starts import perturbed_starts, travelling_starts
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.levels import OPTIONS as LEVELS
from paretoik.trajectory.levels import distinct_rows
from paretoik.trajectory.plan_starts import grid_starts, sample_starts
from paretoik.trajectory.program import MotionProgram, joint_distance

Batch = tuple[Float[np.ndarray, "starts samples dof"], Sequence[InteriorPointOptions]]


@dataclass(frozen=True, kw_only=True)
class RestartOptions:
    """When starts are added, and which.

    ``expected`` is the number of better optima that the next batch may be expected to find, below which no independent
    starts are added; in at most so many ``rounds``. Of the best optima so many ``centers`` are perturbed, each so often
    as ``copies`` says, by ``perturbation`` [rad or m, RMS, least and largest], until so many batches in turn as
    ``patience`` says brought nothing better; with one degree of redundancy only where optima are ``many``. They are
    minimised from ``barrier``: a high one leaves basins. Optima within ``distance`` (rad or m, RMS) whose values differ
    by a share of at most ``value`` count as one. A branch that so many starts led nowhere as ``doomed`` says is left
    out. ``gain`` is the share of a value by which another is better. At the end the best are perturbed at the task's
    own samples in at most ``final_rounds``: what is best there is not what is best on coarser levels.
    """

    expected: float = 0.02
    rounds: int = 10
    centers: int = 4
    copies: int = 5
    perturbation: tuple[float, float] = (0.2, 2.0)
    patience: int = 2
    many: int = 6
    barrier: InteriorPointOptions = InteriorPointOptions(barrier=1e-3, radius=0.05)
    distance: float = 0.1
    value: float = 1e-3
    doomed: int = 4
    gain: float = 1e-6
    final_rounds: int = 6


OPTIONS = RestartOptions()


class RestartPolicy:
    """Which starts to add to those of the coarsest level.

    Independent ones as long as they are likely to find something better: the share of starts that are alone at an
    optimum estimates how likely the next one finds another (Good 1953), and of W + 1 optima each is as likely the best
    (compare Boender & Rinnooy Kan 1987). The best ones perturbed, as long as the best gets better (basin hopping, Wales
    & Doye 1997). With one degree of redundancy once the best paths through a grid, where optima are rare or many.
    """

    def __init__(self, level: MotionTask, q: np.ndarray, count: int, rng: np.random.Generator) -> None:
        self.level, self.count, self.rng = level, count, rng
        self.rounds, self.failures, self.best, self.several = 0, 0, np.inf, False
        self.grid_tried = level.redundancy > 1
        self.independent = np.ones(len(q), dtype=bool)  # of all starts so far: neither perturbed nor of a grid
        self.labels = branch_labels(level.motion(q))

    @property
    def exhausted(self) -> bool:
        """Whether there are likely more optima than were found."""
        return self.level.redundancy > 1 or self.several

    def __call__(self, solutions: Solutions) -> Batch:
        """Return further starts, and the options that they are minimised with in turn; none where enough were tried."""
        if not solutions.converged.any():
            return self._batch([] if self.grid_tried else [self._grid()], [])
        best = float(solutions.objectives[solutions.converged, 0].min())
        better = self.best == np.inf or best < self.best - OPTIONS.gain * abs(self.best)
        self.failures, self.best = 0 if better else self.failures + 1, min(best, self.best)
        optima, hits = self._optima(solutions)
        alone, starts = int(np.sum(hits == 1)), int(self.independent.sum())
        if not self.grid_tried and (len(optima) >= OPTIONS.many or (alone and self.rounds)):
            paths = self._grid()
            if len(paths):
                return self._batch([paths], [])
        independent, perturbed = list[np.ndarray](), list[np.ndarray]()
        if self.rounds < OPTIONS.rounds:
            if self.count * alone / starts / (len(optima) + 1) > OPTIONS.expected:
                independent.append(self._without_doomed(self._sample(), solutions))
            self.several = self.level.redundancy > 1 or len(optima) >= OPTIONS.many
            if self.several and self.failures <= OPTIONS.patience:
                perturbed.append(perturb(self.level, solutions.x[optima[: OPTIONS.centers]], self.rng))
        self.rounds += 1
        return self._batch(perturbed, independent)

    def _batch(self, dependent: Sequence[np.ndarray], independent: Sequence[np.ndarray]) -> Batch:
        parts = [*dependent, *independent]
        flags = [np.zeros(len(q), dtype=bool) for q in dependent] + [np.ones(len(q), dtype=bool) for q in independent]
        self.independent = np.concatenate([self.independent, *flags])
        q = np.concatenate([np.empty((0, len(self.level.times), self.level.arm.dof)), *parts])
        self.labels = self.labels + (branch_labels(self.level.motion(q)) if len(q) else [])
        return q, (OPTIONS.barrier,) if len(dependent) and self.rounds else ()

    def _optima(self, solutions: Solutions) -> tuple[Int[np.ndarray, " optima"], Int[np.ndarray, " optima"]]:
        """Return a row of every optimum, best first, and how many independent starts led to it."""
        values = np.where(solutions.converged, solutions.objectives[:, 0], np.inf)
        remaining, rows, hits = solutions.converged.copy(), list[int](), list[int]()
        for i in np.argsort(values, kind="stable")[: solutions.converged.sum()]:
            if not remaining[i]:
                continue
            near = np.flatnonzero(remaining & (values <= values[i] + OPTIONS.value * abs(values[i])))
            same = near[joint_distance(self.level, solutions.x[i], solutions.x[near]) <= OPTIONS.distance]
            remaining[same] = False
            rows.append(int(i))
            hits.append(int(self.independent[same].sum()))
        return np.array(rows), np.array(hits)

    def _sample(self) -> Float[np.ndarray, "starts samples dof"]:
        """Return independent starts: such as at first, and in every other round those alone that travel."""
        if self.rounds % 2:
            return sample_starts(self.level, self.count, self.rng)
        return travelling_starts(self.level, 2 * self.count, self.rng)[: self.count]

    def _without_doomed(self, q: np.ndarray, solutions: Solutions) -> Float[np.ndarray, "starts samples dof"]:
        """Return the starts whose branch has not led nowhere again and again."""
        labels, failed = np.array(self.labels), ~solutions.converged
        doomed = [
            name
            for name in np.unique(labels[failed])
            if (labels == name).sum() >= OPTIONS.doomed and failed[labels == name].all()
        ]
        keep: Bool[np.ndarray, " starts"] = ~np.isin(branch_labels(self.level.motion(q)), doomed)
        return q[keep]

    def _grid(self) -> Float[np.ndarray, "paths samples dof"]:
        self.grid_tried = True
        return grid_starts(self.level, self.level.arm.dof)


def perturb(
    task: MotionTask, q: Float[np.ndarray, "motions time dof"], rng: np.random.Generator
) -> Float[np.ndarray, "starts time dof"]:
    """Return motions perturbed several times each, little and much."""
    copies = np.repeat(q, OPTIONS.copies, axis=0)
    least, largest = np.log(OPTIONS.perturbation)
    return perturbed_starts(task, copies, rng, size=np.exp(rng.uniform(least, largest, len(copies))))


def disturb_best(
    program: MotionProgram, solutions: Solutions, rng: np.random.Generator, solver: Solver = "auto"
) -> Solutions:
    """Return optima and those that the best lead to, perturbed or from high barriers, while the best gets better.

    Where valleys are many, neighbouring ones are as often better as not.
    """
    weights, failures = np.eye(1, len(program.upper)), 0
    for _ in range(OPTIONS.final_rounds):
        before, best = float(solutions.objectives[0, 0]), solutions.x[: OPTIONS.centers]
        batches = [(best, barrier) for barrier in LEVELS.cold] + [(perturb(program.task, best, rng), OPTIONS.barrier)]
        ends = [minimise(program, x, weights, options=barrier, solver=solver) for x, barrier in batches]
        both = concatenate((solutions, *ends))
        solutions = both[distinct_rows(program.task, both, both.objectives[:, 0], limit=len(both))]
        better = solutions.objectives[0, 0] < before - OPTIONS.gain * abs(before)
        failures = 0 if better else failures + 1
        if failures >= OPTIONS.patience:
            break
    return solutions
