"""Basin hopping: the best optima disturbed and recombined, and minimised again, while the best gets better.

Source: Wales & Doye 1997; ``restarts`` says when.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from paretoik.nlp.interior_point_options import InteriorPointOptions
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import Solver
from paretoik.nlp.solutions import Solutions, concatenate
from paretoik.self_motion.motion_starts import perturbed_starts, recombined_starts
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.levels import OPTIONS as LEVELS
from paretoik.trajectory.levels import coarse, distinct_rows
from paretoik.trajectory.program import MotionProgram, joint_distance


@dataclass(frozen=True, kw_only=True)
class BasinHoppingOptions:
    """How optima are disturbed, and which of those that this leads to are new.

    Of the best optima so many ``centers`` are perturbed, each so often as ``copies`` says, by ``perturbation`` [rad or
    lengths of the arm, RMS: least, largest]. Twice as many are recombined with others as often as ``crossings`` says
    each: the best of so many ``tries`` for one. It goes on until so many batches in turn as ``patience`` says brought
    nothing better: ``gain`` is the share of a value by which another is better. Motions are minimised from ``barrier``:
    a high one leaves basins. Optima within ``distance`` (rad or lengths of the arm, RMS) whose values differ by a share
    of at most ``value`` count as one.

    The best are disturbed once more on a finer level, in at most ``final_rounds``: what is best there is not what is
    best on the coarsest. Where nothing better came of it on the coarsest, one batch that brings nothing is enough.
    """

    centers: int = 4
    copies: int = 4
    crossings: int = 2
    tries: int = 8
    perturbation: tuple[float, float] = (0.2, 2.0)
    patience: int = 2
    gain: float = 1e-6
    barrier: InteriorPointOptions = InteriorPointOptions(barrier=1e-3, radius=0.05, iterations=300)
    distance: float = 0.1
    value: float = 1e-3
    final_rounds: int = 20


OPTIONS = BasinHoppingOptions()


def disturb(
    task: MotionTask, q: Float[np.ndarray, "optima time dof"], rng: np.random.Generator
) -> Float[np.ndarray, "starts time dof"]:
    """Return the first of some optima perturbed several times each, little and much, and recombined in pairs."""
    copies = np.repeat(q[: OPTIONS.centers], OPTIONS.copies, axis=0)
    least, largest = np.log(OPTIONS.perturbation)
    perturbed = perturbed_starts(task, copies, rng, size=np.exp(rng.uniform(least, largest, len(copies))))
    return np.concatenate([perturbed, _recombine(task, q, rng)]) if len(q) > 1 else perturbed


def _recombine(
    task: MotionTask, q: Float[np.ndarray, "optima time dof"], rng: np.random.Generator
) -> Float[np.ndarray, "starts time dof"]:
    """Return the best of many motions that are like one of the first optima, for a while like another.

    Where optima come near one another they may change over for little, and what is better before may be joined to
    what is better after.
    """
    count = OPTIONS.crossings * min(len(q), 2 * OPTIONS.centers)
    first = rng.integers(0, min(len(q), 2 * OPTIONS.centers), OPTIONS.tries * count)
    second = (first + rng.integers(1, len(q), len(first))) % len(q)  # any other
    x = recombined_starts(task, q[first], q[second], rng)
    if not len(x):
        return x
    motions = task.motion(x)
    violation = np.maximum(task.violations(motions), 0).sum(axis=1) if task.limit_names else np.zeros(len(x))
    order = np.lexsort((task.objectives[0].sign * task.objectives[0](motions), np.round(violation, 1)))
    chosen = x[:0]
    for i in order:
        others = np.concatenate([q, chosen])
        if len(chosen) < count and joint_distance(task, x[i], others).min() > OPTIONS.distance:
            chosen = np.concatenate([chosen, x[i : i + 1]])
    return chosen


def disturb_best(
    program: MotionProgram,
    solutions: Solutions,
    rng: np.random.Generator,
    solver: Solver = "auto",
    *,
    patience: int = OPTIONS.patience,
) -> Solutions:
    """Return optima and those that the best lead to, disturbed or from high barriers, while the best gets better.

    Where valleys are many, neighbouring ones are as often better as not. Starts are minimised as on a coarse level;
    only where they lead to other optima are these refined. It ends after so many batches in turn as ``patience`` says
    that brought nothing better.
    """
    task, failures, centers = program.task, 0, solutions.x[:0]
    for _ in range(OPTIONS.final_rounds):
        before, best = float(solutions.objectives[0, 0]), solutions.x[: OPTIONS.centers]
        others = best[_far(task, best, centers)]
        centers = np.concatenate([centers, others])
        batches = [(others, barrier) for barrier in LEVELS.cold]
        batches.append((disturb(task, solutions.x, rng), OPTIONS.barrier))
        x, options = np.concatenate([x for x, _ in batches]), [coarse(each) for x, each in batches for _ in x]
        if not len(x):
            break
        rough = minimise(program, x, np.eye(1, len(program.upper)), options=options, solver=solver)
        rough = rough[distinct_rows(task, rough, rough.objectives[:, 0], limit=len(rough))]
        rough = rough[rough.converged & _new(task, rough, solutions)]
        if len(rough):
            ends = minimise(program, rough.x, np.eye(1, len(program.upper)), options=LEVELS.warm, solver=solver)
            both = concatenate((solutions, ends))
            solutions = both[distinct_rows(task, both, both.objectives[:, 0], limit=len(both))]
        better = solutions.objectives[0, 0] < before - OPTIONS.gain * abs(before)
        failures = 0 if better else failures + 1
        if failures >= patience:
            break
    return solutions


def _far(task: MotionTask, q: np.ndarray, others: np.ndarray) -> Bool[np.ndarray, " motions"]:
    """Return which motions are none of the others."""
    return np.array([not len(others) or joint_distance(task, x, others).min() > LEVELS.distinct for x in q])


def _new(task: MotionTask, rough: Solutions, solutions: Solutions) -> Bool[np.ndarray, " motions"]:
    """Return which rough ends are near none of the solutions of about their value."""
    values = solutions.objectives[:, 0]
    return np.array(
        [
            not np.any(
                (np.abs(values - value) <= OPTIONS.value * np.abs(values))
                & (joint_distance(task, x, solutions.x) <= OPTIONS.distance)
            )
            for x, value in zip(rough.x, rough.objectives[:, 0], strict=True)
        ],
        dtype=bool,
    )
