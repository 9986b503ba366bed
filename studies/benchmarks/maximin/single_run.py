"""One run of one method on one problem."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from functools import cache

import numpy as np
from pymoo.optimize import minimize

from paretoik.arrays import Objectives
from studies.benchmarks.maximin.cases import Case, cases, problem_of
from studies.benchmarks.maximin.methods import algorithm, first_genes
from studies.benchmarks.significance import union

WARM_UP = {2: "ZDT1", 3: "DTLZ2-3", 5: "DTLZ2-5"}  # by objectives: problems on which every peer can run


@dataclass(frozen=True)
class Run:
    """The result of a run: its final non-dominated objectives (points, n_obj) and its CPU seconds."""

    F: Objectives
    seconds: float


def run_once(case_name: str, name: str, seed: int, generations: int) -> Run:
    """Run one method once, after a warm-up; by names so that it can run in another process."""
    case = cases()[case_name]
    for each in (WARM_UP[case.n_obj], case_name):
        _warm_up(each, name)
    return _run(case, name, seed, generations)


@cache
def _warm_up(case_name: str, name: str) -> None:
    """Compile and load everything that a method and a problem need, in this process, before they are timed."""
    _run(cases()[case_name], name, 0, 3)


def _run(case: Case, name: str, seed: int, generations: int) -> Run:
    problem = problem_of(case.name)
    first = first_genes(problem, case, seed)
    method = algorithm(name, case, problem, first)
    started = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the peers' own warnings about divisions
        result = minimize(problem, method, ("n_eval", len(first) * generations), seed=seed)
    seconds = time.process_time() - started
    F = np.empty((0, case.n_obj)) if result.F is None else np.atleast_2d(result.F)
    F = F[np.isfinite(F).all(axis=1)]
    if case.box is not None:
        F = F[np.less_equal(F, case.box[1]).all(axis=1)]
    return Run(union([F]), seconds)
