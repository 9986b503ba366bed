"""Simulations 1 to 5, one arm at a time: the optima of all methods, and their cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import paretoik as pk
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import InteriorPointOptions
from paretoik.task.motion_task import MotionTask
from paretoik.task.random_starts import MOTION_OPTIONS as STARTS
from paretoik.trajectory.levels import OPTIONS, objective_scales
from paretoik.trajectory.motion_terms import joint_distance
from paretoik.trajectory.plan import Plan
from paretoik.trajectory.plan_starts import initial_motions
from paretoik.trajectory.transcription import motion_program
from studies.benchmarks.peers.solvers import COMPILER, LABELS, Settings, Solved
from studies.benchmarks.planner.questions import CORES, Cores, Question, peer, tracking
from studies.reporting import LOSS, Row, timed, versus

NAMES = tuple(f"simulation_{i}" for i in range(1, 6))
COARSE = 26
CAPS = (100, 70, 50, 35, 25)
SAME = 1e-5  # relative: a peer that stops its barrier's width above the best optimum has found it
BELOW = 1e-7  # relative: largest amount by which a peer's best may be below ours
BEGINNINGS = tuple(Settings(barrier=barrier) for barrier in (0.1, 0.01, 0.001))
WARMS = tuple(Settings(barrier=barrier, push=push) for barrier, push in ((1e-3, 1e-2), (1e-4, 1e-4), (1e-5, 1e-6)))
GOALS = {"best": 0.5, "coarse": 1.0, "warm": 2.0}  # of FATROP's time


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is run: starts, repeats for medians, and the seed of the starts."""

    starts: int = 48
    repeats: int = 3
    seed: int = 0


class PeerForm(NamedTuple):
    """A form of a peer: its name, its questions at all samples and at coarse ones, settings of a cold start."""

    name: str
    label: str
    fine: Question
    coarse: Question
    settings: Settings
    compilation: float


class SimulationResult(NamedTuple):
    """Results of one simulation: rows, our time to the best optimum and that of every form."""

    rows: list[Row]
    ours: float
    theirs: dict[str, float]


def forms(cores: Cores, name: str, arms: Sequence[str], effort: Effort, folder: Path) -> dict[str, list[PeerForm]]:
    """Return FATROP and IPOPT by masses, evaluated and compiled, each with the first barrier that serves it best."""
    task = tracking(name).task
    starts = _fine_starts(task, initial_motions(task, starts=effort.starts, seed=effort.seed))
    peer_forms: dict[str, list[PeerForm]] = {arm: [] for arm in arms}
    for solver, label in LABELS.items():
        settings = None
        for arm in arms:
            fine = Question(solver=solver, problem=name, masses=arm)
            kinds = {label: [(fine, 0.0), (replace(fine, samples=COARSE), 0.0)]}
            if COMPILER:
                kinds[f"{label} compiled"] = cores.compiled([question for question, _ in kinds[label]], folder)
            if settings is None:
                quickest = list(kinds.values())[-1][0][0]
                settings = serving({each: cores.solve(quickest, each, starts) for each in BEGINNINGS})
            for form, ((question, seconds), (coarse, _)) in kinds.items():
                peer_forms[arm].append(PeerForm(form, label, question, coarse, settings, seconds))
    return peer_forms


def serving(tries: Mapping[Settings, Sequence[Solved]]) -> Settings:
    """Return the settings of least expected time to the best optimum, with the iteration cap that serves it most.

    The savings by a lower cap follow from the iterations: a fifth more than any hit took is left.
    """
    best = min((one.value for each in tries.values() for one in each if one.solved), default=np.inf)
    costs = {}
    for settings, each in tries.items():
        for cap in CAPS:
            cut = [replace(s, seconds=s.seconds * min(1.0, cap / max(s.iterations, 1))) for s in each]
            cut = [replace(s, solved=s.solved and 1.2 * s.iterations <= cap) for s in cut]
            costs[replace(settings, iterations=cap)] = expected_time(cut, best), sum(s.seconds for s in each)
    return min(costs, key=lambda settings: costs[settings])


def compare_simulation(
    cores: Cores, name: str, masses: str, peers: Sequence[PeerForm], effort: Effort
) -> SimulationResult:
    """Return the rows of one simulation on one arm."""
    problem = tracking(name, masses)
    task, row = problem.task, f"{name}, {masses}"
    pk.plan(problem, starts=2)  # compiles
    q = initial_motions(task, starts=effort.starts, seed=effort.seed)
    starts = _fine_starts(task, q)
    for one in peers:
        cores.build(one.fine, one.settings, starts)
        cores.build(one.coarse, one.settings, q)
    plans, solves = list[tuple[Plan, float, float]](), {one.name: list[list[Solved]]() for one in peers}
    for _ in range(effort.repeats):
        plans.append(timed(lambda: pk.plan(problem, starts=effort.starts, seed=effort.seed)))
        for one in peers:
            solves[one.name].append(cores.solve(one.fine, one.settings, starts))
    plan = plans[0][0]
    seconds, cpu = (float(np.median([taken[i] for taken in plans])) for i in (1, 2))
    values = [s.value for each in solves.values() for s in each[0] if s.solved]
    best = min([plan.best.objective, *values])
    if plan.best.objective > best * (1 + SAME):
        seconds, cpu = np.inf, np.inf
    theirs = {form: float(np.median([expected_time(each, best) for each in tries])) for form, tries in solves.items()}
    rows = []
    for one in peers:
        first = solves[one.name][0]
        hits, solved = _hits(first, best), sum(s.solved for s in first)
        burnt = np.median([sum(s.cpu for s in each) for each in solves[one.name]])
        note = (
            f"processor time {cpu * hits / burnt:.3g}; hit {hits} of {len(first)}, {solved} converged; first barrier "
            f"{one.settings.barrier:g}, {one.settings.iterations} iterations at most"
            + (f"; compiled in {one.compilation:.2g} s" if one.compilation else "")
        )
        rows.append(_time(row, f"to the best optimum, {one.name}", seconds, theirs[one.name], note=note))
    for one in quickest(peers):
        rows += optima(row, task, plan, one.label, solves[one.name][0])
    rows += _coarse(cores, row, task, q, peers, effort.repeats)
    rows += _warm(row, task, plan, peers)
    return SimulationResult(rows, seconds, theirs)


def optima(row: str, task: MotionTask, plan: Plan, label: str, solves: Sequence[Solved]) -> list[Row]:
    """Return the best objectives, and the number of distinct optima."""
    ended = distinct(task, [s for s in solves if s.solved])
    others = [s for s in ended if np.abs(np.diff(s.q, axis=0)).max() <= STARTS.longest_jump]
    if not others:
        return []
    ours, best, found = plan.best.objective, others[0].value, len(plan.optima)
    note = f"{LOSS if ours / best - 1 > BELOW else ''}relative gap {ours / best - 1:.1e}, goal {BELOW:g}"
    rows = [Row("best optimum", row, f"objective, {label}", "", ours, reference=best, source=label, note=note)]
    note = f"{LOSS if found < len(others) else ''}goal: no fewer; " if row.startswith(NAMES[0]) else ""
    if len(ended) > len(others):
        note += f"{len(ended) - len(others)} of theirs left out: a joint jumps by more than {STARTS.longest_jump} rad"
    return [*rows, Row("distinct optima", row, label, "", found, reference=len(others), source=label, note=note)]


def distinct(task: MotionTask, solved: Sequence[Solved]) -> list[Solved]:
    """Return one of every optimum, best first, distinguished as ``plan`` does."""
    chosen: list[Solved] = []
    for one in sorted(solved, key=lambda s: s.value):
        if not chosen or joint_distance(task, one.q, np.stack([other.q for other in chosen])).min() > OPTIONS.distinct:
            chosen.append(one)
    return chosen


def quickest(peers: Sequence[PeerForm]) -> list[PeerForm]:
    """Return the last form of every peer: compiled, if there is a compiler."""
    return list({one.label: one for one in peers}.values())


def sum_rows(arm: str, each: Sequence[SimulationResult]) -> list[Row]:
    """Return the rows of all simulations together."""
    place, ours = f"sum of the five, {arm}", float(sum(one.ours for one in each))
    sums = {form: float(sum(one.theirs[form] for one in each)) for form in each[0].theirs}
    fatrop = LABELS["fatrop"]
    return [
        _time(place, f"to the best optimum, {form}", ours, theirs, GOALS["best"] if form.startswith(fatrop) else None)
        for form, theirs in sums.items()
    ]


def _time(row: str, column: str, ours: float, theirs: float, goal: float | None = None, note: str = "") -> Row:
    return versus("time", row, column, "s", ours, theirs, goal=goal, note=note)


def _fine_starts(task: MotionTask, q: np.ndarray) -> np.ndarray:
    return np.asarray(task.subsample(q.shape[1]).motion(q).at(task.times))


def _hits(solves: Sequence[Solved], best: float) -> int:
    return sum(one.solved and one.value <= best * (1 + SAME) for one in solves)


def expected_time(solves: Sequence[Solved], best: float) -> float:
    """Return the expected seconds of independent starts on all cores to the best optimum."""
    hits = _hits(solves, best)
    return sum(one.seconds for one in solves) / CORES / hits if hits else np.inf


def _coarse(
    cores: Cores, row: str, task: MotionTask, q: np.ndarray, peers: Sequence[PeerForm], repeats: int
) -> list[Row]:
    """Return the seconds of all starts at coarse samples."""
    program, factors = motion_program(task.subsample(COARSE), objective_scales(task, q)), np.ones((1, 1))
    rules = [OPTIONS.cold[i % len(OPTIONS.cold)] for i in range(len(q))]
    taken, solves = list[float](), {one.name: list[list[Solved]]() for one in peers}
    for _ in range(repeats):
        ours, seconds, _ = timed(lambda: minimise(program, q, factors, options=rules))
        taken.append(seconds)
        for one in peers:
            solves[one.name].append(cores.solve(one.coarse, one.settings, q))
    rows, mine = [], float(np.median(taken))
    for form, tries in solves.items():
        theirs = float(np.median([sum(s.seconds for s in each) for each in tries])) / CORES
        note = f"converged {int(ours.converged.sum())} and {sum(s.solved for s in tries[0])}"
        goal = GOALS["coarse"] if form == LABELS["fatrop"] else None
        rows.append(_time(row, f"{len(q)} starts at {COARSE} samples, {form}", mine, theirs, goal, note))
    return rows


def _warm(row: str, task: MotionTask, plan: Plan, peers: Sequence[PeerForm]) -> list[Row]:
    """Return the seconds of one solve from the best motion at half the samples."""
    best = plan.best
    rough = np.asarray(task.subsample((len(task.times) + 1) // 2).motion(best.motion.q[::2]).at(task.times))
    program, factors = motion_program(task, np.array([best.objective])), np.ones((1, 1))
    served = {}
    for one in quickest(peers):
        tries = {settings: [peer(one.fine).solve(rough, settings=settings) for _ in range(3)][-1] for settings in WARMS}
        served[one.label] = min(WARMS, key=lambda s: (_hits([tries[s]], best.objective) == 0, tries[s].seconds))
    rows, warm = [], InteriorPointOptions(barrier=1e-4)
    for one in peers:
        settings, taken = served[one.label], []
        ended = peer(one.fine).solve(rough, settings=settings).value / best.objective - 1
        for _ in range(11):
            _, ours, _ = timed(lambda: minimise(program, rough[None], factors, options=warm))
            taken.append((ours, peer(one.fine).solve(rough, settings=settings).seconds))
        mine, theirs = np.median(taken, axis=0)
        note = f"theirs ends {ended:.1e} above, first barrier {settings.barrier:g}"
        goal = GOALS["warm"] if one.name == LABELS["fatrop"] else None
        rows.append(_time(row, f"one warm solve, {one.name}", float(mine), float(theirs), goal, note))
    return rows
