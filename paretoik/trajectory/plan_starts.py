"""Starts of a plan: sampled motions along the path, and restarts until a better optimum is unlikely.

Sources: Tringali & Cocuzza 2020, sections 3.1.2 and 3.1.3, for samples; Wales & Doye 1997 for basin hopping.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.arrays import JointPaths
from paretoik.errors import Infeasible, InvalidInput
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import InteriorPointOptions, Solutions, Solver, concatenate
from paretoik.task.motion_task import MotionTask, evaluate_motions
from paretoik.task.objectives import Objective, objective
from paretoik.task.random_starts import perturbed_starts, recombined_starts, rollout_starts, travelling_starts
from paretoik.task.self_motion import branch_labels
from paretoik.trajectory.grid_oracle import grid_oracle
from paretoik.trajectory.levels import OPTIONS as LEVELS
from paretoik.trajectory.levels import Further, coarse, coarsest_level, distinct_rows
from paretoik.trajectory.motion_terms import joint_distance
from paretoik.trajectory.transcription import MotionProgram


@dataclass(frozen=True, kw_only=True)
class StartOptions:
    """Settings of starts, of adding starts, and of basin hopping.

    In basin hopping the best optima are perturbed, recombined and minimised again.
    """

    rollouts: int = 4  # number of motions tried for each roll-out
    travelling: int = 3  # number of motions tried for each start that travels along the self-motion
    spacing: float = 0.15  # distance of a grid's nodes, in rad or arm lengths
    classes: int = 8  # largest number of paths of a grid
    starts: int = 48  # default number of starts per degree of redundancy
    portions: int = 4  # number of portions in which these starts are minimised, while better unseen optima are likely
    # expected number of better optima in the next batch, below which no independent starts are added
    expected: float = 0.05
    rounds: int = 6  # largest number of batches of independent starts
    many: int = 6  # number of optima from which basin hopping is used, with one degree of redundancy
    # probability of a new optimum above which basin hopping is used, with more degrees of redundancy
    unseen: float = 0.02
    doomed: int = 4  # number of failed starts after which a branch is left out
    # largest relative change of the best value from the first level to the next; if it changes more, starts are sampled
    # on the next level too
    misled: float = 0.25
    negligible: float = 1e-3  # share of the usual value at starts; replaces a smaller best value in ``misled``
    centers: int = 4  # number of best optima that are perturbed; twice as many are recombined with others
    copies: int = 4  # number of perturbed copies of each best optimum
    crossings: int = 2  # number of recombinations of each best optimum
    tries: int = 8  # number of tries for each recombination; the best is taken
    perturbation: tuple[float, float] = (0.2, 2.0)  # smallest and largest perturbation [rad or arm lengths, RMS]
    patience: int = 2  # number of consecutive batches without improvement after which the search ends
    gain: float = 1e-6  # smallest improvement that counts, as a share of the value
    # solver settings of the minimisation; a higher first barrier would leave basins
    barrier: InteriorPointOptions = InteriorPointOptions(barrier=1e-3, radius=0.05, iterations=300)
    distance: float = 0.1  # largest distance (rad or arm lengths, RMS) of optima that count as one
    value: float = 1e-3  # largest difference of values of optima that count as one, as a share of the value
    # largest number of batches on a finer level, where other optima may be the best; if the coarsest level had no
    # improvement, one batch without improvement ends it
    final_rounds: int = 20


OPTIONS = StartOptions()
Batch = tuple[Float[np.ndarray, "starts samples dof"], Sequence[InteriorPointOptions]]


@objective(unit="rad²/s", form="integral")
def squared_velocity(motion: Any) -> Any:
    """Return Σᵢ q̇ᵢ²."""
    return np.sum(motion.dq**2, axis=-1)


def initial_motions(
    task: MotionTask, *, starts: int, seed: int, first: int = 0
) -> Float[np.ndarray, "starts samples dof"]:
    """Return ``starts`` motions per degree of redundancy on a coarse level.

    Half of the motions are roll-outs. The others travel along the self-motion, which roll-outs rarely do. All are the
    most promising of many.
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
    """Return at most ``count`` motions that travel along the self-motion."""
    return _most_promising(level, travelling_starts(level, OPTIONS.travelling * count, rng), count)


def grid_starts(level: MotionTask) -> Float[np.ndarray, "paths samples dof"]:
    """Return the best path of every class through a coarse grid.

    The result is empty if the grid would take long. If the objective depends on accelerations, as torques do, other
    objectives replace it: least motion and, under gravity, the objective at acceleration 0.
    """
    substitutes: list[tuple[Objective, ...]] = [(squared_velocity,)]
    if level.arm.gravity.any():
        substitutes.insert(0, tuple(_without_acceleration(each) for each in level.objectives))
    paths = [np.empty((0, len(level.times), level.arm.dof))]
    for objectives in (level.objectives, *substitutes):
        task = replace(level, objectives=objectives, differences="backward", ends_at_rest=False)  # a grid needs these
        with suppress(InvalidInput, Infeasible):  # there is no grid for the task, or no path through a coarse one
            paths.append(grid_oracle(task, resolution=OPTIONS.spacing, classes=OPTIONS.classes, quick=True).q)
            if objectives is level.objectives:
                break
    return np.concatenate(paths)


def _without_acceleration(one: Objective) -> Objective:
    """Return the objective evaluated at acceleration 0."""

    def function(motion: Any) -> Any:
        slow = replace(motion)  # a copy without computed quantities
        vars(slow).update(dq=motion.dq, ddq=np.zeros_like(motion.q), jerk=np.zeros_like(motion.q))
        return one.function(slow)

    return replace(one, function=function)


def _most_promising(task: MotionTask, q: JointPaths, limit: int) -> Float[np.ndarray, "chosen time dof"]:
    """Return at most ``limit`` motions, the best of all branches alternately."""
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


# Basin hopping.


def disturb(
    task: MotionTask, q: Float[np.ndarray, "optima time dof"], rng: np.random.Generator
) -> Float[np.ndarray, "starts time dof"]:
    """Return the first optima with small and large perturbations, and recombined pairs.

    A recombined motion follows one of the first optima and, for a while, another optimum. If two optima come near each
    other, a change costs little and may join the better parts of both. The best of many tries are returned.
    """
    copies = np.repeat(q[: OPTIONS.centers], OPTIONS.copies, axis=0)
    least, largest = np.log(OPTIONS.perturbation)
    perturbed = perturbed_starts(task, copies, rng, size=np.exp(rng.uniform(least, largest, len(copies))))
    if len(q) < 2:
        return perturbed
    count = OPTIONS.crossings * min(len(q), 2 * OPTIONS.centers)
    first = rng.integers(0, min(len(q), 2 * OPTIONS.centers), OPTIONS.tries * count)
    second = (first + rng.integers(1, len(q), len(first))) % len(q)  # any other optimum
    x = recombined_starts(task, q[first], q[second], rng)
    if not len(x):
        return np.concatenate([perturbed, x])
    motions = task.motion(x)
    violation = np.maximum(task.violations(motions), 0).sum(axis=1) if task.limit_names else np.zeros(len(x))
    chosen = x[:0]
    for i in np.lexsort((task.objectives[0].sign * task.objectives[0](motions), np.round(violation, 1))):
        others = np.concatenate([q, chosen])
        if len(chosen) < count and joint_distance(task, x[i], others).min() > OPTIONS.distance:
            chosen = np.concatenate([chosen, x[i : i + 1]])
    return np.concatenate([perturbed, chosen])


def disturb_best(
    program: MotionProgram,
    solutions: Solutions,
    rng: np.random.Generator,
    solver: Solver = "auto",
    *,
    patience: int = OPTIONS.patience,
) -> Solutions:
    """Return optima, and new ones found from the best while the best value improves.

    The best are perturbed, or minimised with high barriers. Starts are minimised as on a coarse level, and only new
    optima are refined. The search ends after ``patience`` consecutive batches without improvement.
    """
    task, failures, centers = program.task, 0, solutions.x[:0]
    for _ in range(OPTIONS.final_rounds):
        before, best = float(solutions.objectives[0, 0]), solutions.x[: OPTIONS.centers]
        # starts: the best optima that were no centers yet, with high barriers, and perturbed optima
        far = [not len(centers) or joint_distance(task, x, centers).min() > LEVELS.distinct for x in best]
        others = best[np.array(far)]
        centers = np.concatenate([centers, others])
        batches = [(others, barrier) for barrier in LEVELS.cold]
        batches.append((disturb(task, solutions.x, rng), OPTIONS.barrier))
        x, options = np.concatenate([x for x, _ in batches]), [coarse(each) for x, each in batches for _ in x]
        if not len(x):
            break
        rough = minimise(program, x, np.eye(1, len(program.upper)), options=options, solver=solver)
        rough = rough[distinct_rows(task, rough, rough.objectives[:, 0], limit=len(rough))]
        # new optima are refined; known ones are near a solution with about the same value
        values, known = solutions.objectives[:, 0], list[bool]()
        for one, value in zip(rough.x, rough.objectives[:, 0], strict=True):
            near = np.abs(values - value) <= OPTIONS.value * np.abs(values)
            known.append(bool(np.any(near & (joint_distance(task, one, solutions.x) <= OPTIONS.distance))))
        rough = rough[rough.converged & ~np.array(known, dtype=bool)]
        if len(rough):
            ends = minimise(program, rough.x, np.eye(1, len(program.upper)), options=LEVELS.warm, solver=solver)
            both = concatenate((solutions, ends))
            solutions = both[distinct_rows(task, both, both.objectives[:, 0], limit=len(both))]
        better = solutions.objectives[0, 0] < before - OPTIONS.gain * abs(before)
        failures = 0 if better else failures + 1
        if failures >= patience:
            break
    return solutions


# The restart policy.


class RestartPolicy:
    """Starts that are added to those of the coarsest level.

    - Waiting starts, one portion at a time, while a better unseen optimum is likely: the numbers of optima and of
      starts give the probability of a new optimum (Boender & Rinnooy Kan 1987).
    - Independent starts while they are likely to find a better optimum. The share of starts that are the only ones at
      their optimum estimates the probability of a new optimum (Good 1953). A new optimum is a rare one, with a single
      start. All ranks among the rare optima, and among all optima up to the best rare one, are assumed to be equally
      likely.
    - The best optima, perturbed and recombined, while the best improves (basin hopping, Wales & Doye 1997).
    - The best paths through a grid, once, with one degree of redundancy, if optima are rare or many.
    """

    def __init__(
        self,
        level: MotionTask,
        q: np.ndarray,
        count: int,
        rng: np.random.Generator,
        waiting: Sequence[Float[np.ndarray, "starts samples dof"]] = (),
        *,
        independent: bool = True,
    ) -> None:
        self.level, self.count, self.rng, self.waiting = level, count, rng, list(waiting)
        self.rounds, self.failures, self.best = 0, 0, np.inf
        self.several = self.improved = False  # whether unseen optima are likely; whether restarts found better ones
        self.grid_tried = level.redundancy > 1 or not independent
        self.independent = np.full(len(q), independent)  # per start: not perturbed, nor from a grid or coarser level
        self.starts, self.labels = [q], list[str]()

    def __call__(self, solutions: Solutions) -> Batch:
        """Return further starts, if any, and the options that they alternate between."""
        if self.waiting and solutions.converged.any() and self.independent.any():
            # a start finds a new optimum with the probability ``_unseen``; it is the best of w + 1 with 1 / (w + 1)
            hits, count = self._optima(solutions)[1], sum(map(len, self.waiting))
            waiting = count * _unseen(hits) / (np.count_nonzero(hits) + 1)
            if max(waiting, _expected_better(hits, self.count, int(self.independent.sum()))) <= OPTIONS.expected:
                self.waiting = []
        portion = self.waiting.pop(0) if self.waiting else np.empty(0)
        if len(portion):
            return self._batch([], [portion])
        if not solutions.converged.any():
            return self._batch([] if self.grid_tried else [self._grid()], [])
        best = float(solutions.objectives[solutions.converged, 0].min())
        better = self.best == np.inf or best < self.best - OPTIONS.gain * abs(self.best)
        self.improved = self.improved or (better and self.best < np.inf)
        self.failures, self.best = 0 if better else self.failures + 1, min(best, self.best)
        optima, hits = self._optima(solutions)
        if not self.grid_tried and (len(optima) >= OPTIONS.many or (self.rounds and np.any(hits == 1))):
            paths = self._grid()
            if len(paths):
                return self._batch([paths], [])
        independent, perturbed = list[np.ndarray](), list[np.ndarray]()
        if self.rounds < OPTIONS.rounds:
            if _expected_better(hits, self.count, int(self.independent.sum())) > OPTIONS.expected:
                sample = sample_starts if self.rounds % 2 else sample_travelling  # all kinds in every other round
                independent.append(self._without_doomed(sample(self.level, self.count, self.rng), solutions))
            many = len(optima) >= OPTIONS.many
            self.several = _unseen(hits) > OPTIONS.unseen if self.level.redundancy > 1 else many
            if self.several and self.failures <= OPTIONS.patience:
                perturbed.append(disturb(self.level, solutions.x[optima], self.rng))
        self.rounds += 1
        return self._batch(perturbed, independent)

    def _batch(self, dependent: Sequence[np.ndarray], independent: Sequence[np.ndarray]) -> Batch:
        parts = [*dependent, *independent]
        flags = [np.zeros(len(q), dtype=bool) for q in dependent] + [np.ones(len(q), dtype=bool) for q in independent]
        self.independent = np.concatenate([self.independent, *flags])
        q = np.concatenate([np.empty((0, len(self.level.times), self.level.arm.dof)), *parts])
        self.starts.append(q)
        return q, (OPTIONS.barrier,) if len(dependent) and self.rounds else LEVELS.cold

    def _optima(self, solutions: Solutions) -> tuple[Int[np.ndarray, " optima"], Int[np.ndarray, " optima"]]:
        """Return a row of every optimum, best first, and its number of independent starts."""
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

    def _without_doomed(self, q: np.ndarray, solutions: Solutions) -> Float[np.ndarray, "starts samples dof"]:
        """Return the starts except those of branches that failed repeatedly."""
        if solutions.converged.all() or not len(q):
            return q
        for unlabelled in filter(len, self.starts):
            self.labels += branch_labels(self.level.motion(unlabelled))
        self.starts = []
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
        return grid_starts(self.level)


class LevelRestarts:
    """The restarts of a plan, level by level, for ``refine_levels``.

    On the first level starts are added to waiting ``portions``. If the first level misled, ``starts`` starts per degree
    of redundancy are sampled on the next. On one level the best optima are perturbed, for longer if restarts found
    better ones.
    """

    def __init__(
        self,
        portions: Sequence[Float[np.ndarray, "starts samples dof"]],
        starts: int,
        rng: np.random.Generator,
        solver: Solver,
    ) -> None:
        self.portions, self.starts, self.rng, self.solver = portions, starts, rng, solver
        self.batch = -(-starts // 2)  # number of starts that a policy adds at once
        self.policies = list[RestartPolicy]()  # policy of the first level; if that misled, also of the next
        self.compared = False  # whether the first level was compared with the next

    def further(self, program: MotionProgram, q: np.ndarray, coarser: Solutions | None) -> Further | None:
        """Return the function that adds starts on a level, or None."""
        level = program.task
        if coarser is None:
            self.policies.append(RestartPolicy(level, q, self.batch, self.rng, self.portions))
            return self.policies[0]

        def further_on_next(solutions: Solutions) -> Batch:
            """Return further starts on the second level, if the first misled."""
            if not self.compared:
                self.compared = True
                if is_misled(coarser, solutions):
                    with suppress(Infeasible):  # the optima of the first level are enough
                        more = first_portions(sample_starts(level, self.starts * max(level.redundancy, 1), self.rng))
                        self.policies.append(RestartPolicy(level, q, self.batch, self.rng, more, independent=False))
            return self.policies[1](solutions) if len(self.policies) > 1 else (q[:0], ())

        return None if self.compared else further_on_next

    def disturb(self, program: MotionProgram, solutions: Solutions) -> Solutions:
        """Return optima and, if they are many, new ones found from the best."""
        if not solutions.converged.any() or not any(policy.several for policy in self.policies):
            return solutions
        patience = OPTIONS.patience if any(policy.improved for policy in self.policies) else 1
        return disturb_best(program, solutions, self.rng, self.solver, patience=patience)


def first_portions(
    q: Float[np.ndarray, "starts samples dof"],
) -> list[Float[np.ndarray, "portion samples dof"]]:
    """Return portions of starts, each with some of every kind and barrier."""
    turn = np.arange(len(q)) // len(LEVELS.cold) % OPTIONS.portions
    return [q[turn == i] for i in range(OPTIONS.portions)]


def is_misled(coarse: Solutions, fine: Solutions) -> bool:
    """Return whether the best values of two levels differ much."""
    if not (coarse.converged.any() and fine.converged.any()):
        return False
    before, now = (float(each.objectives[each.converged, 0].min()) for each in (coarse, fine))
    return abs(now - before) > OPTIONS.misled * max(abs(now), OPTIONS.negligible)


def _expected_better(hits: Int[np.ndarray, " optima"], count: int, starts: int) -> float:
    """Return the expected number of better optima (Good 1953)."""
    alone = int(np.sum(hits == 1))
    rank = int(np.argmax(hits <= 1)) + 1 if alone else len(hits)  # rank of the best rare optimum
    return count * alone / starts / (alone + 1) / rank


def _unseen(hits: Int[np.ndarray, " optima"]) -> float:
    """Return the probability that the next start finds a new optimum.

    ``hits`` are the numbers of starts of each optimum.
    Source: Boender & Rinnooy Kan 1987, Bayesian stopping rules for multistart global optimization methods.
    """
    optima, starts = int(np.count_nonzero(hits)), int(hits.sum())
    return min(1.0, optima * (optima + 1) / max(starts * (starts - 1), 1))
