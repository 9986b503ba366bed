"""Running every method on every case, interleaved, under both budgets; each core a process."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache
from multiprocessing import get_context

import numpy as np

from studies.benchmarks.fronts.cases import CASES, POPULATION, Budget, Kind, Run, problem_of
from studies.benchmarks.fronts.methods import CELLS, OURS, PLAIN, PYGMO, PYMOO, cell_run, ours, pygmo_run, pymoo_run
from studies.benchmarks.fronts.sweeps import OURS as EPSILON
from studies.benchmarks.fronts.sweeps import SOLVERS, epsilon_run

KINDS: tuple[Kind, ...] = ("evaluations", "CPU time")
CORES = 2
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def methods_of(case: str) -> list[str]:
    """Return the names of all that can run on a case, ours first."""
    return [OURS, PLAIN, EPSILON, *CELLS, *PYMOO, *PYGMO, *(SOLVERS if CASES[case].tringali else ())]


def run(case: str, name: str, seed: int, budget: Budget, evaluations: int) -> Run:
    """Run one method once, after it was warmed; by names so that it can happen in another process."""
    _warmed(case, name)
    return _run(case, name, seed, budget, evaluations)


@lru_cache(maxsize=256)
def _warmed(case: str, name: str) -> None:
    """Compile and load what a method needs, in this process, before it is timed."""
    _run(case, name, 0, Budget(kind="evaluations", amount=12 * POPULATION), 12 * POPULATION)


def _run(case: str, name: str, seed: int, budget: Budget, evaluations: int) -> Run:
    problem = problem_of(case)
    if name in (OURS, PLAIN):
        return ours(problem, seed, budget, evaluations // POPULATION, refine=name == OURS)
    if name in CELLS:
        return cell_run(CELLS[name], problem, seed, budget)
    if name in PYMOO:
        return pymoo_run(name, problem, seed, budget)
    if name in PYGMO:
        return pygmo_run(name, problem, seed, budget)
    return epsilon_run(name, case, problem, seed, budget)


def run_all(
    chosen: Sequence[str], kinds: Sequence[Kind], seeds: int, evaluations: int | None
) -> dict[tuple[str, Kind], dict[str, list[Run]]]:
    """Run everything, seeds outermost and the order of methods turning, a process a core."""
    for name in THREADS:
        os.environ.setdefault(name, "1")
    found: dict[tuple[str, Kind], dict[str, list[Run]]] = {}
    with ProcessPoolExecutor(CORES, mp_context=get_context("spawn")) as pool:
        sizes = {case: evaluations or CASES[case].evaluations for case in chosen}
        budgets = {case: _budgets(pool, case, sizes[case], kinds) for case in chosen}
        for seed in range(seeds):
            waiting: list[tuple[str, Kind, str, Future[Run]]] = []
            for case in chosen:
                names = methods_of(case)
                turned = names[seed % len(names) :] + names[: seed % len(names)]
                for name in turned:
                    for kind in kinds:
                        work = pool.submit(run, case, name, seed, budgets[case][kind], sizes[case])
                        waiting.append((case, kind, name, work))
            for case, kind, name, work in waiting:
                try:
                    done = work.result()
                except BrokenProcessPool:
                    raise SystemExit(f"{name} or one beside it crashed on {case}, seed {seed}") from None
                every = found.setdefault((case, kind), {each: [] for each in methods_of(case)})
                every[name].append(done)
            print(f"seed {seed + 1} of {seeds}: done", file=sys.stderr, flush=True)
    return found


def _budgets(pool: ProcessPoolExecutor, case: str, evaluations: int, kinds: Sequence[Kind]) -> dict[Kind, Budget]:
    same = Budget(kind="evaluations", amount=evaluations)
    found: dict[Kind, Budget] = {"evaluations": same}
    if "CPU time" in kinds:
        taken = [pool.submit(run, case, "NSGA-II", seed, same, evaluations).result().seconds for seed in range(3)]
        found["CPU time"] = Budget(kind="CPU time", amount=float(np.median(taken)))
        print(f"{case}: {evaluations} evaluations, {found['CPU time'].amount:.2f} s", file=sys.stderr, flush=True)
    return found
