"""Running every method on every problem, interleaved, a process a core."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from pymoo.optimize import minimize

from paretoik.arrays import Objectives
from studies.benchmarks.maximin.cases import POPULATION, Case, cases, problem_of
from studies.benchmarks.maximin.methods import algorithm, first_genes, methods_of
from studies.benchmarks.processes import processes, rotated, run_seeds
from studies.benchmarks.significance import union

LIMIT = 600.0  # seconds after which a run, which takes some ten, counts as one that found nothing
WARM_UP = {2: "ZDT1", 3: "DTLZ2-3", 5: "DTLZ2-5"}  # by objectives: problems on which every peer can run


@dataclass(frozen=True)
class Run:
    """What one run left: its final non-dominated objectives (points, n_obj) and its CPU seconds."""

    F: Objectives
    seconds: float


Runs: TypeAlias = dict[tuple[str, str], list[Run]]  # of every seed by problem and method


def run(case_name: str, name: str, seed: int, generations: int) -> Run:
    """Run one method once, after it was warmed; by names so that it can happen in another process."""
    case = cases()[case_name]
    for each in (WARM_UP[case.n_obj], case_name):
        _warm_up(each, name)
    return _run(case, name, seed, generations)


@cache
def _warm_up(case_name: str, name: str) -> None:
    """Compile and load what a method and a problem need, in this process, before they are timed."""
    _run(cases()[case_name], name, 0, 3)


def _run(case: Case, name: str, seed: int, generations: int) -> Run:
    problem = problem_of(case.name)
    first = first_genes(problem, case, seed)
    method = algorithm(name, case, problem, first)
    started = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the peers' own, about divisions
        result = minimize(problem, method, ("n_eval", len(first) * generations), seed=seed)
    seconds = time.process_time() - started
    F = np.empty((0, case.n_obj)) if result.F is None else np.atleast_2d(result.F)
    F = F[np.isfinite(F).all(axis=1)]
    if case.box is not None:
        F = F[np.less_equal(F, case.box[1]).all(axis=1)]
    return Run(union([F]), seconds)


def run_all(chosen: Sequence[Case], seeds: int) -> Runs:
    """Run every method on every case, seeds outermost and the order of methods turning."""

    def arguments(seed: int) -> dict[tuple[str, str], list[Any]]:
        return {
            (case.name, name): [case.name, name, seed, case.generations]
            for case in chosen
            for name in rotated(methods_of(case), seed)
        }

    sizes = {case.name: case.n_obj for case in chosen}
    with processes() as pool:
        return run_seeds(
            pool, run, arguments, seeds, limit=LIMIT, empty=lambda key: Run(np.empty((0, sizes[key[0]])), LIMIT)
        )


def evaluations(case: Case) -> int:
    """Return what every method may evaluate on a case."""
    return POPULATION[case.n_obj] * case.generations
