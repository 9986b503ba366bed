"""The paper's search: 66 first postures, n² candidates of each, ranked, the best refined from level to level.

Candidates are retracted onto the path; on the circle their drift is removed evenly. The minimiser is the library's
interior point, with exact derivatives, instead of Matlab's SQP: the study compares which starts are taken. Source:
Tringali & Cocuzza 2020, sections 3.1.2 to 3.2.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.nlp.program import Solutions
from paretoik.runs.distribution import Executor
from paretoik.task.motion_task import MotionTask
from paretoik.task.random_starts import rollout_starts
from paretoik.task.retraction import relative_errors, retract_nearest, row_space_basis
from paretoik.task.self_motion import branch_labels
from paretoik.trajectory.levels import objective_scales, refine_levels
from paretoik.trajectory.transcription import motion_program
from problems import tringali_2021
from studies.processes import run_each
from studies.reporting import Row, tell
from studies.tringali_2020.simulations import THEIRS, Simulation, paper

TABLE = "Section 3.1, the search as published"


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """Numbers of the published search. Two of them are not in the paper.

    ``posture`` [rad], from which the others are made, is that of the authors' next paper, whose tool begins at the same
    place. With a ``deviation`` of 3 rad/s the postures cover the whole self-motion, as the set "should be
    representative of the whole".
    """

    configurations: int = 66
    runs: int = 48  # section 3.2; section 3.1.2 has 24
    penalties: tuple[float, ...] = (0.01, 0.1)  # k_JL of Eq. 14, and ten times that
    samples: tuple[int, ...] = (13, 26, 51)  # of the coarse levels; 0.08 s does not divide 1 s: these are 1/12 s
    posture: tuple[float, ...] = tringali_2021.START
    deviation: float = 3.0


OPTIONS = SearchOptions()


class PublishedSearch(NamedTuple):
    """The optima from the best ``bends`` of ``candidates`` with a ``penalty``, and the seconds."""

    penalty: float
    candidates: int
    bends: Counter[str]
    solutions: Solutions
    values: Float[np.ndarray, " optima"]
    seconds: float


def initial_postures(
    task: MotionTask, rng: np.random.Generator, options: SearchOptions = OPTIONS
) -> Float[np.ndarray, "configurations dof"]:
    """Return postures at the path's beginning after random velocities along the self-motion (Eq. 17)."""
    q, interval = np.tile(options.posture, (options.configurations, 1)), float(task.times[1])
    for _ in task.times:  # as many velocities as path points
        rows = row_space_basis(relative_errors(task.arm, task.tasks, q, task.targets[0])[1])
        move = interval * options.deviation * rng.normal(size=q.shape)
        move -= np.einsum("pdk,pek,pe->pd", rows, rows, move)  # (I − J⁺J) q̇ dt
        q = retract_nearest(task.arm, task.tasks, q + move, task.targets[0]).q
    return q


def candidates(
    task: MotionTask, postures: Float[np.ndarray, "configurations dof"], seed: int
) -> Float[np.ndarray, "found time dof"]:
    """Return the motions of n² weighted pseudoinverses from every posture (Eqs. 9, 10, 12, 13), all with one set of W.

    Those that meet a singularity are left out.
    """
    count = (len(task.times) * task.arm.dof) ** 2
    motions = list[np.ndarray]()
    for posture in postures:
        with suppress(pk.Infeasible):  # no candidate of a posture reaches the end
            motions.append(rollout_starts(replace(task, start=posture), count, np.random.default_rng(seed)))
    return np.concatenate(motions)


def rank(task: MotionTask, q: Float[np.ndarray, "motions time dof"], penalty: float) -> Float[np.ndarray, " motions"]:
    """Return the objective, plus the distance from the middle of position limits, if any (Eq. 14)."""
    (objective,) = task.objectives
    cost = np.asarray(objective.sign * objective(task.motion(q)))
    if "position" in task.bounds:
        lower, upper = np.moveaxis(task.bounds["position"], -1, 0)
        share = (q - (lower + upper) / 2) / (upper - lower)
        cost = cost + penalty * np.sum(share**2, axis=(1, 2)) / (2 * task.arm.dof)
    return cost


def search_as_published(
    problem: pk.Tracking, q: Float[np.ndarray, "candidates time dof"], penalty: float, options: SearchOptions = OPTIONS
) -> PublishedSearch:
    """Return the optima of the best candidates, by cubic splines from each level to the next (section 3.1.4)."""
    begin, task = time.perf_counter(), problem.task
    levels = [*(task.resample(samples) for samples in options.samples), task]
    best = q[np.argsort(rank(levels[0], q, penalty))[: options.runs]]
    scales = objective_scales(levels[0], best)
    programs = [motion_program(level, scales) for level in levels]
    solutions, _ = refine_levels(programs, best, np.ones(1), np.full(1, np.inf), restore=True)
    converged = solutions.x[solutions.converged]
    return PublishedSearch(
        penalty=penalty,
        candidates=len(q),
        bends=Counter(branch_labels(levels[0].motion(best))),
        solutions=solutions,
        values=task.objectives[0](task.motion(converged)) if len(converged) else np.empty(0),
        seconds=time.perf_counter() - begin,
    )


def published_rows(
    simulations: Sequence[Simulation],
    *,
    seed: int = 0,
    options: SearchOptions = OPTIONS,
    executor: Executor | None = None,
) -> list[Row]:
    """Return the optima of each simulation's plan that the published search finds, and its seconds.

    On an executor every simulation makes its own candidates: sending them takes as long.
    """
    groups = [simulations] if executor is None else [[one] for one in simulations]
    calls = {
        tuple(one.name for one in group): partial(_published_rows, group, seed=seed, options=options)
        for group in groups
    }
    return [row for rows in run_each(executor, calls).values() for row in rows]


def _published_rows(simulations: Sequence[Simulation], *, seed: int, options: SearchOptions) -> list[Row]:
    rows, drawn = [], dict[bool, tuple[np.ndarray, float]]()
    for simulation in simulations:
        task = simulation.problem.task
        if task.cyclic not in drawn:  # all simulations along the line have the same candidates
            tell(f"candidates along the {'circle' if task.cyclic else 'line'}")
            begin, level = time.perf_counter(), task.resample(options.samples[0])
            postures = initial_postures(level, np.random.default_rng(seed), options)
            drawn[task.cyclic] = candidates(level, postures, seed), time.perf_counter() - begin
        q, seconds = drawn[task.cyclic]
        tell(f"the search as published, {simulation.name}")
        penalties = options.penalties if "position" in task.bounds else options.penalties[:1]
        searches = [search_as_published(simulation.problem, q, penalty, options) for penalty in penalties]
        rows += [_reached(simulation, search) for search in searches]
        table = "Table 6" if task.cyclic else "Table 5"
        note = f"candidates and {options.runs} runs, derivatives exact; {THEIRS}"
        reference = paper()[table, simulation.name, "time"]
        title = f"{TABLE}, {simulation.masses} masses"
        rows.append(
            Row(title, simulation.name, "time", "s", seconds + searches[0].seconds, reference=reference, note=note)
        )
    return rows


def _reached(simulation: Simulation, search: PublishedSearch) -> Row:
    best = simulation.plan.best.objective
    bends = ", ".join(f"{name} ({count})" for name, count in search.bends.most_common())
    if len(search.values):
        end = f"best {search.values[0]:.5f}, {100 * (search.values[0] / best - 1):+.3f} % relative to the plan's"
    else:
        end = (
            "none: where the best candidates lead limits cannot all hold, by "
            f"{search.solutions.violation.min():.2f} of a range at least"
        )
    penalised = f", k_JL = {search.penalty:g}" if "position" in simulation.problem.task.bounds else ""
    title, column = f"{TABLE}, {simulation.masses} masses", f"optima reached{penalised}"
    note = f"{end}; bends of the best ranked of {search.candidates} candidates: {bends}"
    ours, planned = len(search.values), len(simulation.plan.optima)
    return Row(title, simulation.name, column, "", ours, reference=planned, source="planned", note=note)
