"""The certified energy-torque front against the peers' sweeps of ε-constraints with no less hypervolume.

A sweep finds both ends by coarse starts that are refined to all samples, as ours does. Then it goes down and up evenly
spaced ceilings on the torque norm, each from its neighbour's motions (warm) and, if that is not enough, from the single
objectives' optima (cold). Sweeps grow until one has as much hypervolume as ours; only its own time counts.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import moocore
import numpy as np

import paretoik as pk
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.levels import OPTIONS
from paretoik.trajectory.plan_starts import initial_motions
from studies.benchmarks.peers.solvers import COMPILER, LABELS, Solved, Solver
from studies.benchmarks.planner.questions import CORES, ENERGY, TORQUE, Cores, Question, tracking
from studies.benchmarks.planner.simulations import BEGINNINGS, COARSE, GOALS, WARMS, Effort, distinct
from studies.benchmarks.reference_front import REFERENCE_POINT
from studies.reporting import Row, tell, timed, versus

PROBLEM, TABLE = "energy_torque", "front"
POINTS, QUICK_POINTS = 20, 8
ENOUGH = 1 - 1e-4  # of our hypervolume: a barrier's width
COLD, WARM = BEGINNINGS[1], WARMS[1]
GROWING = (1.0, 1.15, 1.35, 1.6, 1.9, 2.3)  # levels, as a multiple of our points


class Tenacity(NamedTuple):
    """A sweep's work at a level: neighbour's motions followed, optima of single objectives tried, ways swept."""

    followed: int
    pool: int
    ways: int


LEAN, THOROUGH, ALL = Tenacity(1, 0, 1), Tenacity(2, 2, 2), Tenacity(4, 8, 2)


class Swept(NamedTuple):
    """A front (points, 2), its hypervolume, its seconds on all cores and the processors'; a sweep's counts."""

    F: np.ndarray
    volume: float
    seconds: float
    cpu: float
    levels: int = 0
    tenacity: Tenacity = LEAN


class Questions(NamedTuple):
    """A sweep's questions: each objective alone at coarse samples and at all, and energy below a torque ceiling."""

    coarse: tuple[Question, Question]
    fine: tuple[Question, Question]
    capped: Question


def questions(solver: Solver) -> Questions:
    """Return a solver's questions."""
    energy, torque = (Question(solver=solver, problem=PROBLEM, main=main) for main in (ENERGY, TORQUE))
    coarse = replace(energy, samples=COARSE), replace(torque, samples=COARSE)
    return Questions(coarse, (energy, torque), replace(energy, main=None))


def libraries(cores: Cores, plain: Questions, folder: Path) -> Questions:
    """Return the questions, compiled."""
    compiled = [one for one, _ in cores.compiled([*plain.coarse, *plain.fine, plain.capped], folder)]
    return Questions((compiled[0], compiled[1]), (compiled[2], compiled[3]), compiled[4])


def sweeps(cores: Cores, folder: Path, effort: Effort, *, quick: bool) -> list[Row]:
    """Return the rows of the front: first how much of a sweep each peer needs, then ours and theirs alternating."""
    points = QUICK_POINTS if quick else POINTS
    problem = tracking(PROBLEM)
    starts = initial_motions(problem.task, starts=effort.starts, seed=effort.seed)
    tell("front: ours")
    pk.epsilon_front(problem, points=3, starts=2)  # compiles
    volume = _ours(problem, points, effort).volume
    forms = dict[str, Questions]()
    for solver, label in list(LABELS.items())[: 1 if quick else None]:
        plain = questions(solver)
        forms |= {label: plain} if not (COMPILER and quick) else {}
        forms |= {f"{label} compiled": libraries(cores, plain, folder)} if COMPILER else {}
    needed = dict[str, Swept]()
    for form, ask in forms.items():
        tell(f"front: {form}")
        tries = _grow_sweeps(cores, ask, problem.task, starts, points, volume)
        enough = [one for one in tries if one.volume >= volume * ENOUGH]  # the quickest, or the one with most
        needed[form] = min(enough, key=lambda one: one.seconds) if enough else max(tries, key=lambda one: one.volume)
    ours, theirs = list[Swept](), {form: list[Swept]() for form in forms}
    for i in range(effort.repeats):
        tell(f"front: side by side, {i + 1} of {effort.repeats}")
        ours.append(_ours(problem, points, effort))
        for form, ask in forms.items():
            ends = _ends(cores, ask, problem.task, starts)
            theirs[form].append(swept(cores, ask, problem.task, ends, needed[form].levels, needed[form].tenacity))
    return [row for form in forms for row in _rows(form, ours, theirs[form])]


def _ours(problem: pk.Tracking, points: int, effort: Effort) -> Swept:
    front, seconds, cpu = timed(
        lambda: pk.epsilon_front(problem, points=points, starts=effort.starts, seed=effort.seed)
    )
    return Swept(front.objectives, _volume(front.objectives), seconds, cpu)


def _rows(form: str, ours: Sequence[Swept], theirs: Sequence[Swept]) -> list[Row]:
    one, other = ours[0], theirs[0]
    how, row = other.tenacity, f"{len(one.F)} certified points"
    seconds, cpu = (
        [float(np.median([getattr(each, name) for each in both])) for both in (ours, theirs)]
        for name in ("seconds", "cpu")
    )
    short = "" if other.volume >= one.volume * ENOUGH else "; it NEVER dominates as much as ours, this is its best"
    note = (
        f"processor time {cpu[0] / cpu[1]:.3g}; theirs {len(other.F)} points: {other.levels} levels, {how.followed} "
        f"branches, {how.pool} cold, {how.ways} way(s){short}"
    )
    goal = GOALS["best"] if form.startswith(LABELS["fatrop"]) else None
    more = f"relative difference {one.volume / other.volume - 1:.1e}, to (0.065, 0.10)"
    column, unit = f"hypervolume, {form}", "N²m²s J s"
    return [
        versus(TABLE, row, f"time, {form}", "s", seconds[0], seconds[1], goal=goal, note=note),
        Row(TABLE, row, column, unit, one.volume, reference=other.volume, source=form, note=more),
    ]


def _grow_sweeps(
    cores: Cores, programs: Questions, task: MotionTask, starts: np.ndarray, points: int, volume: float
) -> list[Swept]:
    """Return sweeps of every tenacity, with more and more levels until they have as much hypervolume as ours."""
    ends = _ends(cores, programs, task, starts)
    tries = []
    for tenacity in (LEAN, THOROUGH, ALL):
        for growing in GROWING:
            tries.append(swept(cores, programs, task, ends, round(points * growing), tenacity))
            if tries[-1].volume >= volume * ENOUGH:
                break
            if len(tries) > 1 and tries[-1].tenacity == tries[-2].tenacity:
                gained = tries[-1].volume - tries[-2].volume
                if gained < 0.2 * (volume - tries[-1].volume):
                    break  # more levels would not help
    return tries


def _ends(
    cores: Cores, programs: Questions, task: MotionTask, starts: np.ndarray
) -> tuple[list[list[Solved]], list[Solved]]:
    """Return the distinct optima of each objective, best first, and the number of solves."""
    found, work = [], list[Solved]()
    level = task.subsample(COARSE)
    for coarse, fine in zip(programs.coarse, programs.fine, strict=True):
        cores.build(coarse, COLD, starts)
        rough = cores.solve(coarse, COLD, starts)
        carried = np.stack([one.q for one in distinct(level, [r for r in rough if r.solved])[: OPTIONS.max_optima]])
        q = np.asarray(level.motion(carried).at(task.times))
        cores.build(fine, WARM, q)
        polished = cores.solve(fine, WARM, q)
        found.append(distinct(task, [one for one in polished if one.solved]))
        work += [*rough, *polished]
    return found, work


def swept(
    cores: Cores,
    programs: Questions,
    task: MotionTask,
    ends: tuple[list[list[Solved]], list[Solved]],
    levels: int,
    tenacity: Tenacity,
) -> Swept:
    """Return a sweep over ``levels`` ceilings, ends included."""
    alone, work = ends[0], list(ends[1])
    F = [_values(task, one) for optima in alone for one in optima[:1]]
    ceilings = np.linspace(F[0][1], F[1][1], levels)[1:-1]
    pool = [one.q for pair in itertools.zip_longest(*alone) for one in pair if one is not None][: tenacity.pool]
    at: list[list[Solved]] = [[] for _ in ceilings]
    for way, order in list(enumerate((range(len(ceilings)), range(len(ceilings))[::-1])))[: tenacity.ways]:
        before = [alone[way][0]]
        for k in order:
            warm = np.stack([one.q for one in before])
            got = cores.solve(programs.capped, WARM, warm, np.full(len(warm), ceilings[k]))
            failed = [q for q, one in zip(warm, got, strict=True) if not one.solved]
            again = np.array(failed + (pool if not at[k] else []))
            if len(again):
                got += cores.solve(programs.capped, COLD, again, np.full(len(again), ceilings[k]))
            work += got
            at[k] = distinct(task, [*at[k], *(one for one in got if one.solved)])[: tenacity.followed]
            before = at[k] or before
    F += [_values(task, one) for optima in at for one in optima[:1]]
    front = np.stack(F)
    front = front[moocore.is_nondominated(front, keep_weakly=False)]
    seconds, cpu = sum(one.seconds for one in work) / CORES, sum(one.cpu for one in work)
    return Swept(front, _volume(front), seconds, cpu, levels, tenacity)


def _values(task: MotionTask, one: Solved) -> np.ndarray:
    motion = task.motion(one.q)
    return np.array([float(objective(motion)) for objective in task.objectives])


def _volume(F: np.ndarray) -> float:
    return float(moocore.hypervolume(F, ref=REFERENCE_POINT))
