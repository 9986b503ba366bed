"""Questions to FATROP and IPOPT about problems of Tringali & Cocuzza, and two processes that answer them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import paretoik as pk
from paretoik.task.motion_task import MotionTask
from problems import tringali_2020
from studies.benchmarks.peers.programs import joint_program, staged_program
from studies.benchmarks.peers.solvers import Peer, Settings, Solved, Solver, compiled

SAMPLES, CORES = 101, 2
ENERGY, TORQUE = 0, 1  # objectives of a problem with both


@dataclass(frozen=True, kw_only=True)
class Question:
    """A question to a peer: a problem, its masses and samples; ``library`` if it is compiled.

    ``main`` is the only objective, None for all that the problem has: then the first, the others below ceilings.
    """

    solver: Solver
    problem: str
    samples: int = SAMPLES
    masses: str = "printed"
    main: int | None = None
    library: str = ""


@lru_cache(maxsize=64)  # this also makes what a search needs
def tracking(name: str, masses: str = "printed", samples: int = SAMPLES, *, both: bool = False) -> pk.Tracking:
    """Return a problem of Tringali & Cocuzza for either arm, at any number of samples, or with ``both`` objectives."""
    task = getattr(tringali_2020, name)().task
    path = tringali_2020.round_trip(samples) if task.cyclic else tringali_2020.straight(samples)
    sides: dict[str, Any] = {kind: (bounds[0, :, 0], bounds[0, :, 1]) for kind, bounds in task.bounds.items()}
    arm = pk.arms.tringali_3r(masses)  # type: ignore[arg-type]
    objectives = [pk.kinetic_energy, pk.torque_norm] if both else task.objectives
    return pk.Tracking(
        arm, path, objectives=objectives, limits=pk.Limits(**sides), cyclic=task.cyclic, differences="backward"
    )


def task_of(question: Question) -> MotionTask:
    """Return the task of a question, thinned out if it has fewer samples than the problem."""
    if question.samples < SAMPLES:
        task = tracking(question.problem, question.masses).task.subsample(question.samples)
    else:
        task = tracking(question.problem, question.masses, question.samples).task
    return task if question.main is None else replace(task, objectives=(task.objectives[question.main],))


@lru_cache(maxsize=64)
def peer(question: Question) -> Peer:
    """Return the peer of a question, built once per process."""
    task = task_of(question)
    capped, staged = range(1, len(task.objectives)), question.solver == "fatrop"
    return replace(staged_program(task, capped=capped) if staged else joint_program(task), library=question.library)


def answers(question: Question, settings: Settings, starts: np.ndarray, caps: np.ndarray | None = None) -> list[Solved]:
    """Return the solutions from starts (any, samples, 3), the last objective below ``caps``, if any."""
    ceilings = [None] * len(starts) if caps is None else [np.array([np.inf, cap]) for cap in caps]
    return [peer(question).solve(q, ceilings=each, settings=settings) for q, each in zip(starts, ceilings, strict=True)]


def compile_question(question: Question, folder: Path) -> tuple[Question, float]:
    """Return the question with its functions compiled into a library in ``folder``, and the seconds for that."""
    started = time.perf_counter()
    parts = question.solver, question.problem, question.masses, question.samples, question.main
    library = compiled(peer(question), "_".join(map(str, parts)), folder).library
    return replace(question, library=library), time.perf_counter() - started


class Cores:
    """Both cores: two processes, each with solvers of its own that stay built."""

    def __enter__(self) -> Cores:
        self._workers = [ProcessPoolExecutor(1, mp_context=get_context("spawn")) for _ in range(CORES)]
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._workers:
            worker.shutdown()

    def build(self, question: Question, settings: Settings, starts: np.ndarray) -> None:
        """Build the question's solvers on both, and try one start."""
        for future in [worker.submit(answers, question, settings, starts[:1]) for worker in self._workers]:
            future.result()

    def compiled(self, questions: Sequence[Question], folder: Path) -> list[tuple[Question, float]]:
        """Return questions compiled into libraries, and the seconds of each."""
        futures = [self._workers[i % CORES].submit(compile_question, one, folder) for i, one in enumerate(questions)]
        return [future.result() for future in futures]

    def solve(
        self, question: Question, settings: Settings, starts: np.ndarray, caps: np.ndarray | None = None
    ) -> list[Solved]:
        """Return the solutions from starts, each core its half."""
        shares = [slice(w, None, CORES) for w in range(CORES)]
        futures = [
            worker.submit(answers, question, settings, starts[share], None if caps is None else caps[share])
            for worker, share in zip(self._workers, shares, strict=True)
        ]
        parts = [future.result() for future in futures]
        return [parts[i % CORES][i // CORES] for i in range(len(starts))]
