"""Many starts, few optima: coarse first, the best of every kind carried on to the motion's own samples.

Source: Tringali & Cocuzza 2020, section 3.1: candidates by weighted pseudoinverses from many postures (3.1.2), ranked
by cost and joint limits (3.1.3), optimised on coarse samples and refined by cubic splines (3.1.4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.errors import Infeasible, InvalidInput, SolverFailed
from paretoik.nlp.compiled.interior_point import Rules
from paretoik.nlp.solutions import STATUSES, Solutions, concatenate
from paretoik.self_motion.branches import labels
from paretoik.self_motion.starts import candidates, pushed, swept
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import objective
from paretoik.trajectory.grid_oracle import grid_oracle
from paretoik.trajectory.polish import polish, within_limits
from paretoik.trajectory.transcription import MotionProgram, joint_distance, motion_program

COARSEST = 26  # samples: with half as many, the best torque optimum does not exist
APART = 0.01  # rad (RMS): optima nearer than this are one
HOLDS = 1e-8  # of limits: what is violated by less is not violated
SAME = 1e-6  # relative: what is better by less is no better
KEPT = 8  # optima carried on to a finer level
POOL = 4  # roll-outs a start, of which the most promising are taken
RARE = 2  # starts that reached an optimum: when no more did, others may not have been reached at all
MANY = 6  # optima: among so many there are likely others
SPACING = 0.15  # rad or m between the nodes of a grid, which takes as long as many starts
ROUNDS = 4  # of half as many starts again, at most, until no optimum is rare
HOPPING = 4  # optima that are pushed off
PATIENCE, HOPS = 2, 12  # rounds in vain after which that ends, and in all
SHAKEN = 3  # optima, and times at most, that are pushed off again where they are many
COLD = (
    Rules(barrier=0.1, radius=0.4),
    Rules(barrier=0.01, radius=0.1),
)  # in turn: each finds basins that the other walks past
EASING = Rules(radius=0.1, iterations=40)
HOLDING = Rules(barrier=1e-4, penalty=100.0, radius=0.02)  # limits are not left again for a better objective
WARM = Rules(barrier=1e-4, radius=0.02)  # coarser levels go no further than where finer ones begin


@objective(unit="rad²/s", form="integral")
def _least_motion(motion: Any) -> Any:
    return np.sum(motion.dq**2, axis=-1)


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

    Starts are those of ``coarse_starts``. With one degree of redundancy, as long as some optimum was reached from one
    or two only, there are likely others that none has reached yet (Good 1953: the share of starts that are alone at an
    optimum estimates how likely the next one finds another). Then more are added, the best ways through a coarse grid
    of postures among them where optima stay rare or are many. With more degrees of redundancy more are added, and the
    best pushed off at random, as long as better ones come of it. ``given`` motions on the path are starts too.
    ``observe`` is called after each level with its number of samples, of starts and of optima.

    Raises InvalidInput where the objective or a limit has no derivative, OutOfReach or Infeasible where there is no
    motion; Infeasible with the least-violating motion where none keeps the limits; SolverFailed where limits hold
    but no start converged.
    """
    assert len(task.objectives) == 1, "one objective at a time is planned for"
    level, rng, wanted = _coarsest(task), np.random.default_rng(seed), starts * max(task.redundancy, 1)
    q = _starts(level, wanted, rng)
    q = q if given is None else np.concatenate([given[:, np.searchsorted(task.times, level.times)], q])
    programs = ladder(task, sizes(task, q))
    further = _Further(level, q, -(-starts // 2), rng) if programs[-1].is_smooth else None
    found, levels = descended(programs, q, np.ones(1), np.full(1, np.inf), observe, ease=True, further=further)
    if further is not None and found.converged.any() and further.at_its_end:
        found = _shaken(programs[-1], found)
    return Plan(optima=_optima(task, found), levels=levels)


def coarse_starts(task: MotionTask, *, starts: int, seed: int) -> Float[np.ndarray, "starts samples dof"]:
    """Return what is started from over the coarsest level, so many for every degree of redundancy.

    Half are the most promising of many roll-outs, half travel along the self-motion, which roll-outs hardly do.
    """
    return _starts(_coarsest(task), starts * max(task.redundancy, 1), np.random.default_rng(seed))


def _starts(level: MotionTask, wanted: int, rng: np.random.Generator) -> Float[np.ndarray, "starts samples dof"]:
    rolled = candidates(level, POOL * wanted, rng)
    away = swept(level, wanted, rng)[: wanted // 2]
    few = wanted - len(away)
    return np.concatenate([_promising(level, rolled[: POOL * few], few), away])


class _Further:
    """Which starts to add, batch by batch, to those of the coarsest level, seeing what these have led to.

    With one degree of redundancy, as long as some optimum is rare: starts pushed at random and others that travel;
    once, where optima stay rare or are many, or nothing converged, ways through a grid. With more, where valleys
    are many and flat and every start finds another point: others that travel and the best ones pushed at random, as
    long as the best gets better (basin hopping, Wales & Doye 1997).
    """

    def __init__(self, level: MotionTask, q: np.ndarray, wanted: int, rng: np.random.Generator) -> None:
        self.level, self.q, self.wanted, self.rng = level, q, wanted, rng
        self.rounds, self.gridded, self.best, self.in_vain = 0, False, np.inf, 0

    @property
    def at_its_end(self) -> bool:
        """Whether no more are to be had."""
        return self.level.redundancy > 1 or self.rounds >= ROUNDS

    def __call__(self, found: Solutions) -> Float[np.ndarray, "starts samples dof"]:
        """Return further starts, none where it is enough."""
        if self.level.redundancy > 1:
            return self._hops(found)
        if not found.converged.any():
            return found.x[:0] if self.gridded else self._laid()
        every = found.x[found.converged]
        optima = found.x[_distinct(self.level, found, found.objectives[:, 0], most=len(found))]
        reached = [int((joint_distance(self.level, each, every) <= APART).sum()) for each in optima]
        rare = self.rounds < ROUNDS and min(reached) <= RARE
        if not self.gridded and (len(optima) >= MANY or (rare and self.rounds > 0)) and len(ways := self._laid()):
            return ways
        others = found.x[:0]
        while rare and not len(others) and self.rounds < ROUNDS:
            self.rounds += 1
            others = self._others()
        return others

    def _others(self) -> Float[np.ndarray, "starts samples dof"]:
        if self.rounds % 2:
            return pushed(self.level, self.rng.permutation(self.q)[: 2 * self.wanted], self.rng)[: self.wanted]
        return swept(self.level, 2 * self.wanted, self.rng)[: self.wanted]

    def _laid(self) -> Float[np.ndarray, "ways samples dof"]:
        self.gridded = True
        return _ways(self.level, self.q)

    def _hops(self, found: Solutions) -> Float[np.ndarray, "starts samples dof"]:
        if not found.converged.any():
            return found.x[:0]
        best = float(found.objectives[found.converged, 0].min())
        self.in_vain = 0 if _better(best, self.best) else self.in_vain + 1
        self.best, self.rounds = min(best, self.best), self.rounds + 1
        if self.in_vain >= PATIENCE or self.rounds > HOPS:
            return found.x[:0]
        near = found.x[_distinct(self.level, found, found.objectives[:, 0], most=HOPPING)]
        hops = pushed(self.level, np.repeat(near, -(-self.wanted // len(near)), axis=0), self.rng)
        return np.concatenate([hops, swept(self.level, self.wanted, self.rng)])


def _ways(level: MotionTask, q: Float[np.ndarray, "starts samples dof"]) -> Float[np.ndarray, "ways samples dof"]:
    """Return the best ways of every class through a coarse grid; none where that would take long.

    Where the objective asks for accelerations, as torques do, what moves least is taken for the best instead.
    """
    for objectives in (level.objectives, (_least_motion,)):
        with suppress(InvalidInput, Infeasible):  # there is no grid of such a task, or no way through one so coarse
            return grid_oracle(replace(level, objectives=objectives), resolution=SPACING, classes=KEPT, quick=True).q
    return q[:0]


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
    further: Callable[[Solutions], Float[np.ndarray, "starts samples dof"]] | None = None,
) -> tuple[Solutions, tuple[tuple[int, int], ...]]:
    """Return the distinct optima of Σ factors · objectives below caps, and samples and optima of each level.

    ``programs`` are those of a ``ladder``, ``q`` starts of the first; ``further`` returns more of them, seeing what
    these led to, until it returns none. Where limits are violated at the end, ``ease`` has a look at whether they can
    hold at all.
    """
    levels = list[tuple[int, int]]()
    rest = len(programs[0].totals) - len(factors)
    weights, below = np.pad(factors, (0, rest)), np.pad(caps, (0, rest), constant_values=np.inf)
    for program, finer in zip(programs, [*programs[1:], None], strict=True):
        task, first = program.task, program is programs[0]
        kinds = [_passing(rules) if finer else rules for rules in (COLD if first else (WARM,))]
        led = partial(_led, program, kinds, weights, below)
        found = led(q)
        while first and further is not None and len(others := further(found)):
            q = np.concatenate([q, others])
            found = concatenate((found, led(q[len(found) :])))
        if ease and (first or not finer) and not found.converged.any() and found.violation.max() > HOLDS:
            least = _distinct(task, found, found.objectives @ weights, most=KEPT)
            found = _eased(program, np.concatenate([found.x[least], q[: 2 * KEPT * first]]), weights, below)
        found = found[_distinct(task, found, found.objectives @ weights, most=KEPT if finer else len(found))]
        levels.append((len(task.times), len(found)))
        if observe is not None:
            observe(len(task.times), len(q), len(found))
        if finer:
            q = _finer(task, found.x, finer.task)
    return found, tuple(levels)


def _finer(
    task: MotionTask, q: Float[np.ndarray, "motions samples dof"], finer: MotionTask
) -> Float[np.ndarray, "kept time dof"]:
    """Return motions at the samples of a finer level, but for those that leave the path between their own.

    Raises Infeasible where all do.
    """
    kept = []
    for motion in task.motion(q):
        try:
            kept.append(motion.at(finer.times))
        except Infeasible as error:
            last = error
    if not kept:
        raise Infeasible(
            f"no motion found on {len(task.times)} samples follows the path between them: {last}; sample it finer",
            motion=task.motion(q[0]),
        )
    return np.stack(kept)


def _led(
    program: MotionProgram, kinds: Sequence[Rules], weights: np.ndarray, below: np.ndarray, q: np.ndarray
) -> Solutions:
    """Return what starts lead to, by each kind of rules in turn."""
    return polish(program, q, weights[None], below[None], rules=[kinds[i % len(kinds)] for i in range(len(q))])


def _passing(rules: Rules) -> Rules:
    """Return the rules for a level that a finer one follows: it ends where that one begins."""
    return rules._replace(last_barrier=WARM.barrier, tolerance=WARM.barrier)


def _better(value: float, before: float) -> bool:
    return bool(before == np.inf or value < before - SAME * abs(before))


def _shaken(program: MotionProgram, found: Solutions) -> Solutions:
    """Return optima and those that they lead to when a barrier pushes them off again, as long as the best gets better.

    Where valleys are many, as in two and more directions of self-motion, those beside the ones found are as often
    better as not.
    """
    weights = np.zeros((1, len(program.totals)))
    weights[0, 0] = 1.0
    for _ in range(SHAKEN):
        before = found.objectives[0, 0]
        both = concatenate((found, *(polish(program, found.x[:SHAKEN], weights, rules=rule) for rule in COLD)))
        found = both[_distinct(program.task, both, both.objectives[:, 0], most=len(both))]
        if not _better(found.objectives[0, 0], before):
            break
    return found


def _eased(program: MotionProgram, q: np.ndarray, weights: np.ndarray, below: np.ndarray) -> Solutions:
    """Return what becomes of motions that violate limits when first nothing else counts."""
    eased = within_limits(program, q, below, EASING)
    holds = eased.violation <= HOLDS
    if not holds.any():
        return eased
    return polish(program, eased.x[holds], weights[None], below[None], rules=HOLDING)


def level_samples(samples: int) -> list[int]:
    """Return the numbers of samples of all levels, coarse to fine."""
    counts = [samples]
    while (counts[0] - 1) // 2 + 1 >= COARSEST:
        counts.insert(0, (counts[0] - 1) // 2 + 1)
    return counts


def _coarsest(task: MotionTask) -> MotionTask:
    return task.subsampled(level_samples(len(task.times))[0])


def _promising(
    task: MotionTask, q: Float[np.ndarray, "motions time dof"], most: int
) -> Float[np.ndarray, "kept time dof"]:
    """Return the motions to start from: in every branch the best by cost and joint limits, the branches in turn."""
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
    return q[order[np.argsort(turn, kind="stable")[:most]]]


def _distinct(task: MotionTask, found: Solutions, cost: np.ndarray, *, most: int) -> Int[np.ndarray, " kept"]:
    """Return which to keep, best first: one of every optimum; without any, those that violate the limits least."""
    order = np.lexsort((cost, np.round(found.violation, 6)))
    if found.converged.any():
        order = np.argsort(np.where(found.converged, cost, np.inf), kind="stable")[: found.converged.sum()]
    kept: list[int] = []
    for i in order:
        if len(kept) < most and (not kept or joint_distance(task, found.x[i], found.x[kept]).min() > APART):
            kept.append(int(i))
    return np.array(kept)


def _optima(task: MotionTask, found: Solutions) -> tuple[Optimum, ...]:
    motions = task.motion(found.x)
    if not found.converged.any() and found.violation.max() <= HOLDS:
        raise SolverFailed(f"no start led to an optimum; the best ended with: {STATUSES[int(found.status[0])]}")
    if not found.converged.any():
        said = task.binding(motions[0]) or STATUSES[int(found.status[0])]
        raise Infeasible(
            f"no motion within the limits was found; of the least-violating one, {said}",
            motion=motions[0],
            limit=task.limit_names[int(np.argmax(task.violations(motions[0])))] if task.limit_names else "",
            violation=float(task.violations(motions[0]).max(initial=0.0)),
        )
    objective = task.objectives[0]
    return tuple(
        Optimum(motion=motion, objective=float(value), label=label, status=STATUSES[int(status)])
        for motion, value, label, status in zip(motions, objective(motions), labels(motions), found.status, strict=True)
    )
