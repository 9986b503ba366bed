"""Levels of samples: refine local optima from the coarsest level upwards (Tringali & Cocuzza 2020, section 3.1.4)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.arrays import JointPaths
from paretoik.errors import Infeasible, ParetoikError
from paretoik.nlp.minimise import minimise, minimise_violation
from paretoik.nlp.program import FEASIBLE, INTERRUPTED, InteriorPointOptions, Solutions, Solver, concatenate
from paretoik.pareto.scalarisation import evaluate_points
from paretoik.runs.interruption import time_is_up
from paretoik.stop_flag import Interrupted
from paretoik.task.motion import Motion
from paretoik.task.motion_task import SAMPLES, MotionTask, require_values
from paretoik.trajectory.motion_terms import joint_distance
from paretoik.trajectory.transcription import MotionProgram, motion_program

# Progress of a plan after each level of samples.


@dataclass(frozen=True, kw_only=True, eq=False)
class LevelProgress:
    """A finished level of samples."""

    task: MotionTask  # task on the level
    starts: Float[np.ndarray, "starts samples dof"]  # motions that the level started from
    ends: Float[np.ndarray, "starts samples dof"]  # motions that the starts led to
    converged: Bool[np.ndarray, " starts"]  # whether the solver found each end optimal
    # distinct optima, best first; if none is feasible, the least-violating motions
    optima: Float[np.ndarray, "optima samples dof"]
    feasible: bool

    @property
    def samples(self) -> int:
        """Number of samples of the level."""
        return len(self.task.times)

    def describe_violation(self, task: MotionTask) -> str:
        """Return in words the limits that the least-violating motion violates; "" if none."""
        if self.feasible or not len(self.optima):
            return ""
        motion = self.task.motion(self.optima[0])
        return _in_words(self.task.describe_violation(motion, np.searchsorted(task.times, self.task.times)))


ObserveLevel: TypeAlias = Callable[[LevelProgress], object]


@contextmanager
def explained_interruption(
    task: MotionTask, rollouts: JointPaths, observe: ObserveLevel | None
) -> Iterator[ObserveLevel]:
    """Explain a signal that ends the search in the body.

    The exception gets the violated limits and the least-violating motion, the first of ``rollouts`` if no level is
    done. The body gets a function to call after each level; it also calls ``observe``.
    """
    seen = list[LevelProgress]()

    def show(level: LevelProgress) -> None:
        seen.append(level)
        if observe is not None:
            observe(level)

    try:
        yield show
    except Interrupted as stop:
        if stop.reason:  # a call of a user's function ended
            raise
        with suppress(ParetoikError):  # a user's constraint may fail at the motion
            start = task.motion(rollouts[0])
            stop.reason = seen[-1].describe_violation(task) if seen else _in_words(task.describe_violation(start))
            if stop.reason:
                stop.motion = at_samples(task, seen[-1].task.motion(seen[-1].optima[0])) if seen else start
        raise


def at_samples(task: MotionTask, motion: Motion) -> Motion:
    """Return a coarser level's motion at the task's samples, or as it is if it leaves the path there."""
    if motion.q.shape[-2] == len(task.times):
        return motion
    try:
        return task.motion(motion.at(task.times))
    except Infeasible:
        return motion


def _in_words(violation: str) -> str:
    return violation and f"no motion within the limits so far; of the least-violating one, {violation}"


# Levels of samples, from coarse to fine.


Result = TypeVar("Result")
Further = Callable[[Solutions], tuple[np.ndarray, Sequence[InteriorPointOptions]]]
FurtherAt = Callable[[MotionProgram, np.ndarray, Solutions | None], Further | None]
Disturb = Callable[[MotionProgram, Solutions], Solutions]


@dataclass(frozen=True, kw_only=True)
class LevelOptions:
    """Settings of refinement; solver settings are ``cold`` on the first level, ``warm`` on the others."""

    coarsest: int = 26  # least number of samples: with half as many, the best torque optimum does not exist
    distinct: float = 0.01  # rad or arm lengths, RMS: two optima that are nearer are one
    scale_share: float = 0.1  # least scale of an objective, as a share of the lower quartile of its sizes at starts
    disturbed: int = 101  # largest number of samples of the perturbed level; finer ones have the same best optimum
    max_optima: int = 32  # largest number of optima refined on a finer level, which may change their order
    restored: int = 8  # number of optima whose violation is minimised; on the first level also twice as many starts
    cold: tuple[InteriorPointOptions, ...] = (  # alternating settings: each finds basins that the others miss
        InteriorPointOptions(barrier=0.1, radius=0.4, iterations=300),
        InteriorPointOptions(barrier=0.01, radius=0.1, iterations=300),
        InteriorPointOptions(barrier=1e-3, radius=0.05, iterations=300),
    )
    warm: InteriorPointOptions = InteriorPointOptions(barrier=1e-4, radius=0.02)
    restoration: tuple[InteriorPointOptions, ...] = (  # alternating settings, if only the violation is minimised
        InteriorPointOptions(barrier=0.1, radius=0.4, iterations=100),
        InteriorPointOptions(barrier=0.01, radius=0.1, iterations=100),
    )
    holding: InteriorPointOptions = InteriorPointOptions(barrier=1e-4, penalty=100.0, radius=0.02)  # after restoration


OPTIONS = LevelOptions()


def level_samples(samples: int) -> list[int]:
    """Return the numbers of samples of all levels, coarse to fine."""
    counts = [samples]
    while (counts[0] - 1) // 2 + 1 >= OPTIONS.coarsest:
        counts.insert(0, (counts[0] - 1) // 2 + 1)
    return counts


def first_levels(samples: int) -> list[int]:
    """Return the levels to try as the first level, in order."""
    last = len(level_samples(samples)) - 1
    return sorted({0, min(1, last), last})


def coarsest_level(task: MotionTask, first: int = 0) -> MotionTask:
    """Return the task on its coarsest level, or on the level ``first``."""
    return task.subsample(level_samples(len(task.times))[first])


def level_programs(task: MotionTask, scales: Float[np.ndarray, " n_obj"], first: int = 0) -> list[MotionProgram]:
    """Return the programs of all levels from ``first`` to the task's own."""
    coarser = [task.subsample(samples) for samples in level_samples(len(task.times))[first:-1]]
    return [motion_program(level, scales) for level in (*coarser, task)]


def objective_scales(task: MotionTask, q: Float[np.ndarray, "starts samples dof"]) -> Float[np.ndarray, " n_obj"]:
    """Return each objective's least magnitude at the coarse starts.

    It is the unit of barriers and tolerances. It is at least a share of the lower quartile, as one value may be near 0.
    """
    level = task.subsample(q.shape[1])
    sizes = [size[np.isfinite(size)] for size in np.abs(require_values(level, level.motion(q)).T)]
    return np.array([max(size.min(), OPTIONS.scale_share * np.quantile(size, 0.25)) or 1.0 for size in sizes])


def refine_levels(
    programs: Sequence[MotionProgram],
    q: Float[np.ndarray, "starts samples dof"],
    weights: Float[np.ndarray, " n_obj"],
    upper: Float[np.ndarray, " n_obj"],
    observe: ObserveLevel | None = None,
    *,
    solver: Solver = "auto",
    restore: bool = False,
    further: FurtherAt | None = None,
    disturb: Disturb | None = None,
    max_optima: int = OPTIONS.max_optima,
) -> tuple[Solutions, tuple[tuple[int, int], ...]]:
    """Return the distinct optima of weights · F with F ≤ upper.

    The best come first. The second value has the numbers of samples and of optima of each level.

    programs: programs of ``level_programs``
    q: starts of the first level
    observe: function called after each level
    restore: whether to minimise the violation and solve again if no motion satisfies the limits; if this fails on the
        first level, its least-violating motions are returned
    further: function of a level's program, starts, and optima of the level before (None on the first level); it returns
        a function that is called with the solutions so far and returns more starts and their settings, at last none
    disturb: function that perturbs optima on one level; it returns them with the new ones that it finds
    max_optima: largest number of optima of a level that are refined on the next

    After a signal the motions found so far are returned, at the samples of the last level.
    Raises Infeasible if all optima of a level leave the path between its samples; Interrupted if a signal comes before
    there is an optimum.
    """
    levels = list[tuple[int, int]]()
    bounded = len(programs[0].upper) - len(weights)
    weights, upper = np.pad(weights, (0, bounded)), np.pad(upper, (0, bounded), constant_values=np.inf)
    coarser: tuple[MotionProgram, Solutions] | None = None
    disturbed = [program for program in programs if len(program.task.times) <= OPTIONS.disturbed][-1:] or programs[:1]
    for program, finer in zip(programs, [*programs[1:], None], strict=True):
        task, first = program.task, program is programs[0]
        exact = finer is None or (disturb is not None and program is disturbed[0])
        barriers = [each if exact else coarse(each) for each in (OPTIONS.cold if first else (OPTIONS.warm,))]
        try:
            # the minima of all starts
            more = None if further is None else further(program, q, None if coarser is None else coarser[1])
            solutions, q = _solve_level(program, q, weights, upper, solver, barriers, more)
            ends = solutions
            restored = restore and (first or not finer) and not solutions.converged.any()
            if restored and not solutions.violation.max() <= FEASIBLE:  # minimise only the violation
                rows = distinct_rows(task, solutions, solutions.objectives @ weights, limit=OPTIONS.restored)
                begin = np.concatenate([solutions.x[rows], q[: 2 * OPTIONS.restored * first]])
                solutions = minimise_violation(program, begin, upper, OPTIONS.restoration)
                if (feasible := solutions.violation <= FEASIBLE).any():
                    held = program, solutions.x[feasible], weights[None], upper[None]
                    solutions = minimise(*held, OPTIONS.holding, solver=solver)
        except Interrupted as stop:
            return _unfinished(programs[-1], weights, (program, stop.partial), coarser), tuple(levels)
        # the distinct minima, and those found from perturbed ones
        limit = max_optima if finer else len(solutions)
        solutions = solutions[distinct_rows(task, solutions, solutions.objectives @ weights, limit=limit)]
        if disturb is not None and program is disturbed[0]:
            with suppress(Interrupted):
                solutions = disturb(program, solutions)[:limit]
        levels.append((len(task.times), len(solutions)))
        if observe is not None:
            observe(level_progress(task, q, ends, solutions))
        if restore and first and not solutions.converged.any():
            break
        if finer:  # the starts of the next level
            q, coarser = resample(task, solutions.x, finer.task), (program, solutions)
    return solutions, tuple(levels)


def level_progress(task: MotionTask, starts: np.ndarray, ends: Solutions, optima: Solutions) -> LevelProgress:
    """Return a plan's progress after a level."""
    return LevelProgress(
        task=task,
        starts=starts,
        ends=ends.x,
        converged=ends.converged,
        optima=optima.x,
        feasible=bool((optima.violation <= FEASIBLE).any()),
    )


def _solve_level(
    program: MotionProgram,
    q: np.ndarray,
    weights: np.ndarray,
    upper: np.ndarray,
    solver: Solver,
    barriers: Sequence[InteriorPointOptions],
    further: Further | None,
) -> tuple[Solutions, np.ndarray]:
    """Return the solutions of starts and ``further`` ones, and all starts.

    The starts alternate between the settings ``barriers``, or those of ``further``; all end at the same barrier.
    """

    def search(starts: np.ndarray, options: Sequence[InteriorPointOptions]) -> Solutions:
        each = [options[i % len(options)] for i in range(len(starts))]
        return minimise(program, starts, weights[None], upper[None], each, solver=solver)

    solutions, first = search(q, barriers), barriers[0]
    try:
        while further is not None:
            more, others = further(solutions)
            if not len(more):
                break
            q = np.concatenate([q, more])
            others = [each._replace(last_barrier=first.last_barrier, tolerance=first.tolerance) for each in others]
            solutions = concatenate((solutions, search(more, others or barriers)))
    except Interrupted as stop:
        raise Interrupted(concatenate((solutions, *filter(None, (stop.partial,))))) from None
    return solutions, q


def _unfinished(
    last: MotionProgram,
    weights: np.ndarray,
    *levels: tuple[MotionProgram, Solutions | None] | None,
) -> Solutions:
    """Return the optima so far, at the last level's samples.

    They are those of the first of ``levels`` that has some. Raises Interrupted if none has.
    """
    for program, solutions in filter(None, levels):
        if solutions is None or not solutions.converged.any():
            continue
        merit = solutions.objectives @ weights
        rows = distinct_rows(program.task, solutions, merit, limit=OPTIONS.max_optima)
        if program is last:
            return solutions[rows]
        with suppress(Infeasible):
            ends = evaluate_points(last, resample(program.task, solutions.x[rows], last.task))
            order = np.lexsort((ends.objectives @ weights, np.round(ends.violation, 6)))
            return replace(ends, status=np.full(len(ends), INTERRUPTED))[order]
    raise Interrupted


def distinct_rows(
    task: MotionTask, solutions: Solutions, merit: Float[np.ndarray, " points"], *, limit: int
) -> Int[np.ndarray, " rows"]:
    """Return one row per distinct optimum, or per least-violating solution if none converged."""
    order = np.lexsort((merit, np.round(solutions.violation, 6)))
    if solutions.converged.any():
        order = np.argsort(np.where(solutions.converged, merit, np.inf), kind="stable")[: solutions.converged.sum()]
    rows: list[int] = []
    for i in order:
        if len(rows) == limit:
            break
        if not rows or joint_distance(task, solutions.x[i], solutions.x[rows]).min() > OPTIONS.distinct:
            rows.append(int(i))
    return np.array(rows)


def coarse(options: InteriorPointOptions) -> InteriorPointOptions:
    """Return settings that end at the first barrier of the finer level."""
    return options._replace(last_barrier=OPTIONS.warm.barrier, tolerance=OPTIONS.warm.barrier)


def on_more_samples(
    result: Result, errors: Callable[[Result], Float[np.ndarray, " inexact"]], refine: Callable[[Result], Result | None]
) -> Result:
    """Return a plan or front on more samples, if values are inexact.

    errors: function that returns the relative errors of the inexact values
    refine: function that returns the result with a sample added in every interval, or None if too much would be lost

    Refinement is repeated a few times if it leaves fewer inexact values, or halves their median error. If it fails, or
    if a signal or the time limit ends it, the result before is returned.
    """
    count, median = np.inf, np.inf
    for _ in range(SAMPLES.doublings):
        finer = None
        with suppress(ParetoikError, Interrupted):
            present = errors(result)
            helped = len(present) < count or (len(present) and np.median(present) <= SAMPLES.helped * median)
            if len(present) and helped and not time_is_up():
                count, median = len(present), float(np.median(present))
                finer = refine(result)
        if finer is None or time_is_up():
            break
        result = finer
    return result


def resample(
    task: MotionTask, q: Float[np.ndarray, "motions samples dof"], finer: MotionTask
) -> Float[np.ndarray, "resampled time dof"]:
    """Return motions at finer samples, without those that leave the path."""
    motions = task.motion(q)
    with suppress(Infeasible):
        return motions.at(finer.times)
    resampled = []
    for motion in motions:
        try:
            resampled.append(motion.at(finer.times))
        except Infeasible as error:
            last = error
    if not resampled:
        raise Infeasible(
            f"no motion found on {len(task.times)} samples follows the path between them: {last}; use more samples",
            motion=task.motion(q[0]),
        )
    return np.stack(resampled)
