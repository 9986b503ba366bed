"""Many starts, few optima: coarse first, the best of every kind carried on to the motion's own samples.

Source: Tringali & Cocuzza 2020, section 3.1: candidates by weighted pseudoinverses from many postures (3.1.2), ranked
by cost and joint limits (3.1.3), optimised on coarse samples and refined by cubic splines (3.1.4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.errors import EvaluationFailed, Infeasible
from paretoik.redundancy.branches import labels
from paretoik.redundancy.self_motion import candidates
from paretoik.refinement.compiled.interior_point import Rules
from paretoik.refinement.polish import REASONS, Polished, polish, within_limits
from paretoik.refinement.program import MotionProgram, motion_program
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask

COARSEST = 26  # samples: with half as many, the best torque optimum does not exist
APART = 0.01  # rad (RMS): optima nearer than this are one
HOLDS = 1e-8  # of limits: what is violated by less is not violated
SAME = 1e-6  # relative: what is better by less is no better
KEPT = 8  # optima carried on to a finer level
POOL = 4  # roll-outs a start, of which the most promising are taken
SHAKEN = 3  # optima, and times at most, that are pushed off again where redundancy is more than one
COLD = (
    Rules(barrier=0.1, radius=0.4),
    Rules(barrier=0.01, radius=0.1),
)  # in turn: each finds basins that the other walks past
EASING = Rules(radius=0.1, iterations=40)
HOLDING = Rules(barrier=1e-4, penalty=100.0, radius=0.02)  # limits are not left again for a better objective
WARM = Rules(barrier=1e-4, radius=0.02)  # coarser levels go no further than where finer ones begin


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """A locally optimal motion, what it is worth in the objective's own sign, and how its joints are bent."""

    motion: Motion
    objective: float
    label: str
    status: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """Distinct local optima, best first; ``levels`` says how many samples each level had and how many optima."""

    optima: tuple[Optimum, ...]
    levels: tuple[tuple[int, int], ...]

    @property
    def best(self) -> Optimum:
        """The best optimum found."""
        return self.optima[0]


def planned(
    task: MotionTask,
    *,
    starts: int,
    seed: int,
    given: Float[np.ndarray, "motions time dof"] | None = None,
    observe: Callable[[int, int, int], object] | None = None,
) -> Plan:
    """Return the distinct local optima of a task with one objective that many starts lead to.

    ``given`` motions on the path are starts too. ``observe`` is called after each level with its number of samples, of
    starts and of optima.

    Raises InvalidInput where the objective or a limit has no derivative, OutOfReach or Infeasible where there is no
    motion; Infeasible with the least-violating motion where none keeps the limits; EvaluationFailed where limits hold
    but no start converged.
    """
    assert len(task.objectives) == 1, "one objective at a time is planned for"
    q = coarse_starts(task, starts=starts, seed=seed, given=given)
    programs = ladder(task, sizes(task, q))
    found, levels = descended(programs, q, np.ones(1), np.full(1, np.inf), observe, ease=True)
    if task.redundancy > 1 and programs[-1].smooth and found.converged.any():
        found = _shaken(programs[-1], found)
    return Plan(optima=_optima(task, found), levels=levels)


def coarse_starts(
    task: MotionTask, *, starts: int, seed: int, given: Float[np.ndarray, "motions time dof"] | None = None
) -> Float[np.ndarray, "starts samples dof"]:
    """Return motions of the coarsest level to start from: given ones, and the most promising of many roll-outs.

    There are so many ``starts`` for every degree of redundancy.
    """
    level = task.subsampled(level_samples(len(task.times))[0])
    q = _promising(level, starts * max(task.redundancy, 1), np.random.default_rng(seed))
    return q if given is None else np.concatenate([given[:, np.searchsorted(task.times, level.times)], q])


def sizes(task: MotionTask, q: Float[np.ndarray, "starts samples dof"]) -> Float[np.ndarray, " n_obj"]:
    """Return what every objective is worth at the better ones of coarse starts: tolerances are shares of it."""
    motions = task.subsampled(q.shape[1]).motion(q)
    return np.array([max(float(np.quantile(np.abs(o(motions)), 0.25)), 1e-12) for o in task.objectives])


def ladder(task: MotionTask, divisors: Float[np.ndarray, " n_obj"]) -> list[MotionProgram]:
    """Return the programs of all levels of samples, coarse to fine, the task's own last."""
    coarser = [task.subsampled(samples) for samples in level_samples(len(task.times))[:-1]]
    return [motion_program(level, divisors) for level in (*coarser, task)]


def descended(
    programs: Sequence[MotionProgram],
    q: Float[np.ndarray, "starts samples dof"],
    factors: Float[np.ndarray, " n_obj"],
    caps: Float[np.ndarray, " n_obj"],
    observe: Callable[[int, int, int], object] | None = None,
    *,
    ease: bool = False,
) -> tuple[Polished, tuple[tuple[int, int], ...]]:
    """Return the distinct optima of Σ factors · objectives below caps, and samples and optima of each level.

    ``programs`` are those of a ``ladder``, ``q`` starts of the first. Where limits are violated at the end, ``ease``
    has a look at whether they can hold at all.
    """
    levels, rules = list[tuple[int, int]](), [COLD[i % len(COLD)] for i in range(len(q))]
    rest = len(programs[0].totals) - len(factors)
    weights, below = np.pad(factors, (0, rest)), np.pad(caps, (0, rest), constant_values=np.inf)
    for program, finer in zip(programs, [*programs[1:], None], strict=True):
        task, first = program.task, program is programs[0]
        passing = [rule._replace(last_barrier=WARM.barrier, tolerance=WARM.barrier) for rule in rules]
        found = polish(program, q, weights[None], below[None], rules=passing if finer else rules)
        if ease and (first or not finer) and not found.converged.any() and found.violation.max() > HOLDS:
            least = _distinct(task, found, found.totals @ weights, most=KEPT)
            found = _eased(program, np.concatenate([found.q[least], q[: 2 * KEPT * first]]), weights, below)
        found = found[_distinct(task, found, found.totals @ weights, most=KEPT if finer else len(found))]
        levels.append((len(task.times), len(found)))
        if observe is not None:
            observe(len(task.times), len(q), len(found))
        if finer:
            q, rules = task.motion(found.q).at(finer.task.times), [WARM] * len(found)
    return found, tuple(levels)


def _shaken(program: MotionProgram, found: Polished) -> Polished:
    """Return optima and those that they lead to when a barrier pushes them off again, as long as the best gets better.

    In two and more directions of self-motion optima of coarse samples say little of finer ones: many valleys are found,
    and those beside them are better as often as not.
    """
    weights = np.zeros((1, len(program.totals)))
    weights[0, 0] = 1.0
    for _ in range(SHAKEN):
        before = found.totals[0, 0]
        every = [found, *(polish(program, found.q[:SHAKEN], weights, rules=rule) for rule in COLD)]
        joined = Polished(**{name: np.concatenate([getattr(one, name) for one in every]) for name in vars(found)})
        found = joined[_distinct(program.task, joined, joined.totals[:, 0], most=len(joined))]
        if not found.totals[0, 0] < before * (1 - SAME):
            break
    return found


def _eased(program: MotionProgram, q: np.ndarray, weights: np.ndarray, below: np.ndarray) -> Polished:
    """Return what becomes of motions that violate limits when first nothing else counts."""
    eased = within_limits(program, q, below, EASING)
    holds = eased.violation <= HOLDS
    if not holds.any():
        return eased
    return polish(program, eased.q[holds], weights[None], below[None], rules=HOLDING)


def level_samples(samples: int) -> list[int]:
    """Return the numbers of samples of all levels, coarse to fine."""
    counts = [samples]
    while (counts[0] - 1) // 2 + 1 >= COARSEST:
        counts.insert(0, (counts[0] - 1) // 2 + 1)
    return counts


def distance(task: MotionTask, q: np.ndarray, other: np.ndarray) -> Float[np.ndarray, "*batch"]:
    """Return the RMS over time of the joint distance [rad, m] between motions (..., time, dof), angles modulo 2π."""
    apart = q - other
    apart = np.where(task.arm.periodic, (apart + np.pi) % (2 * np.pi) - np.pi, apart)
    return np.asarray(np.sqrt(np.mean(np.sum(apart**2, axis=-1), axis=-1)))


def _promising(task: MotionTask, starts: int, rng: np.random.Generator) -> Float[np.ndarray, "starts time dof"]:
    """Return the roll-outs to start from: in every branch the best by cost and joint limits, the branches in turn."""
    q = candidates(task, POOL * starts, rng)
    motions = task.motion(q)
    values = np.stack([o(motions) * o.sign for o in task.objectives])
    cost = np.sum(values / np.maximum(np.abs(values).mean(axis=1, keepdims=True), 1e-300), axis=0)
    over = np.maximum(task.violations(motions), 0).sum(axis=1) if task.limit_names else np.zeros(len(q))
    order = np.lexsort((cost, np.round(over, 2)))
    branch = np.array(labels(task.motion(q[order])))
    turn = np.empty(len(order), dtype=int)
    for name in np.unique(branch):
        members = np.flatnonzero(branch == name)
        turn[members] = np.arange(len(members))
    return q[order[np.argsort(turn, kind="stable")[:starts]]]


def _distinct(task: MotionTask, found: Polished, cost: np.ndarray, *, most: int) -> Int[np.ndarray, " kept"]:
    """Return which to keep, best first: one of every optimum; without any, those that violate the limits least."""
    order = np.lexsort((cost, np.round(found.violation, 6)))
    if found.converged.any():
        order = np.argsort(np.where(found.converged, cost, np.inf), kind="stable")[: found.converged.sum()]
    kept: list[int] = []
    for i in order:
        if len(kept) < most and (not kept or distance(task, found.q[i], found.q[kept]).min() > APART):
            kept.append(int(i))
    return np.array(kept)


def _optima(task: MotionTask, found: Polished) -> tuple[Optimum, ...]:
    motions = task.motion(found.q)
    if not found.converged.any() and found.violation.max() <= HOLDS:
        raise EvaluationFailed(f"no start led to an optimum; the best ended with: {REASONS[int(found.status[0])]}")
    if not found.converged.any():
        said = task.binding(motions[0]) or REASONS[int(found.status[0])]
        raise Infeasible(
            f"no motion within the limits was found; of the least-violating one, {said}",
            motion=motions[0],
            limit=task.limit_names[int(np.argmax(task.violations(motions[0])))] if task.limit_names else "",
            violation=float(task.violations(motions[0]).max(initial=0.0)),
        )
    objective = task.objectives[0]
    return tuple(
        Optimum(motion=motion, objective=float(value), label=label, status=REASONS[int(status)])
        for motion, value, label, status in zip(motions, objective(motions), labels(motions), found.status, strict=True)
    )
