"""Running every method on every case, interleaved, under both budgets; each core a process."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from concurrent.futures import Future
from functools import lru_cache
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeAlias, TypeVar

import numpy as np
from pebble import ProcessExpired, ProcessPool

from studies.benchmarks.fronts.cases import CASES, POPULATION, Budget, Kind, Run, problem_of
from studies.benchmarks.fronts.methods import CELLS, OURS, PLAIN, PYGMO, PYMOO, cell_run, ours, pygmo_run, pymoo_run
from studies.benchmarks.fronts.sweeps import OURS as EPSILON
from studies.benchmarks.fronts.sweeps import SOLVERS, Form, epsilon_run, form_of

Found: TypeAlias = dict[tuple[str, Kind], dict[str, list[Run]]]  # runs of every seed by method, case and budget
Result = TypeVar("Result")

KINDS: tuple[Kind, ...] = ("evaluations", "CPU time")
CORES = os.cpu_count() or 1
LIMIT = 600.0  # seconds after which a run, which takes some ten, counts as one that found nothing
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def methods_of(case: str) -> list[str]:
    """Return the names of all that can run on a case, ours first."""
    peers = [name for name in SOLVERS if CASES[case].tringali or SOLVERS[name] == "ipopt"]
    return [OURS, PLAIN, EPSILON, *CELLS, *PYMOO, *PYGMO, *peers]


def run(case: str, name: str, seed: int, budget: Budget, evaluations: int, form: Form | None = None) -> Run:
    """Run one method once, after what it is made of was warmed; by names so that it can happen in another process."""
    gradients = name == OURS or (name in CELLS and CELLS[name].refined)
    _warm_up(case, name if name in (EPSILON, *SOLVERS) else OURS if gradients else PYMOO[0], form)
    return _run(case, name, seed, budget, evaluations, form)


@lru_cache(maxsize=256)
def _warm_up(case: str, name: str, form: Form | None) -> None:
    """Compile and load what a method and those like it need, in this process, before they are timed."""
    _run(case, name, 0, Budget(kind="evaluations", amount=3 * POPULATION), 3 * POPULATION, form)


def _run(case: str, name: str, seed: int, budget: Budget, evaluations: int, form: Form | None) -> Run:
    problem = problem_of(case)
    if name in (OURS, PLAIN):
        return ours(problem, seed, budget, evaluations // POPULATION, refine=name == OURS)
    if name in CELLS:
        return cell_run(CELLS[name], problem, seed, budget)
    if name in PYMOO:
        return pymoo_run(name, problem, seed, budget)
    if name in PYGMO:
        return pygmo_run(name, problem, seed, budget)
    return epsilon_run(problem, seed, budget, form)


def run_all(
    chosen: Sequence[str], kinds: Sequence[Kind], seeds: int, evaluations: int | None = None, *, compiling: bool = True
) -> Found:
    """Run everything, seeds outermost and the order of methods turning, a process a core.

    Interrupted, it returns the seeds that are done; nobody would wait hours to see nothing.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")
    found: Found = {}
    with TemporaryDirectory() as folder, ProcessPool(CORES, context=get_context("spawn")) as pool:
        sizes = {case: evaluations or CASES[case].evaluations for case in chosen}
        forms = _forms(pool, chosen, Path(folder) if compiling else None)
        budgets = {case: _budgets(pool, case, sizes[case], kinds) for case in chosen}
        try:
            for seed in range(seeds):
                for key, runs in _seed(pool, chosen, seed, budgets, sizes, forms).items():
                    for name, one in runs.items():
                        found.setdefault(key, {}).setdefault(name, []).append(one)
                _tell(f"seed {seed + 1} of {seeds}: done")
        except KeyboardInterrupt:
            pool.stop()  # type: ignore[no-untyped-call]
            _tell(f"interrupted in seed {seed + 1} of {seeds}: the seeds before it are judged")
    return found


def _seed(
    pool: ProcessPool,
    chosen: Sequence[str],
    seed: int,
    budgets: dict[str, dict[Kind, Budget]],
    sizes: dict[str, int],
    forms: dict[tuple[str, str], Form],
) -> dict[tuple[str, Kind], dict[str, Run]]:
    """Run every method once on every case under every budget."""
    waiting: list[tuple[str, Kind, str, Future[Run]]] = []
    for case in chosen:
        names = methods_of(case)
        for name, kind in product(names[seed % len(names) :] + names[: seed % len(names)], budgets[case]):
            asked = [case, name, seed, budgets[case][kind], sizes[case], forms.get((case, name))]
            work: Future[Run] = pool.schedule(run, args=asked, timeout=LIMIT)
            waiting.append((case, kind, name, work))
    runs: dict[tuple[str, Kind], dict[str, Run]] = {(case, kind): {} for case in chosen for kind in budgets[case]}
    for case, kind, name, done in waiting:
        runs[case, kind][name] = _ended(done, case, f"{name} on {case}, equal {kind}, seed {seed}")
    return runs


def _forms(pool: ProcessPool, chosen: Sequence[str], folder: Path | None) -> dict[tuple[str, str], Form]:
    asked = {
        (case, name): pool.schedule(form_of, args=[name, case, folder])
        for case in chosen
        for name in methods_of(case)
        if name in SOLVERS
    }
    found = {which: _done(work, f"building {which[1]} for {which[0]}") for which, work in asked.items()}
    _tell("peers: built")
    return found


def _ended(work: Future[Run], case: str, what: str) -> Run:
    """Return a run; an empty one where it crashed or did not end."""
    try:
        return work.result()
    except (TimeoutError, ProcessExpired) as fault:
        why = f"did not end within {LIMIT:g} s" if isinstance(fault, TimeoutError) else "crashed"
        _tell(f"{what} {why}: counted as empty")
        F = np.empty((0, problem_of(case).n_obj))
        return Run(F=F, failed=0, evaluations=0, iterations=0, seconds=0.0)


def _done(work: Future[Result], what: str) -> Result:
    try:
        return work.result()
    except ProcessExpired:
        raise SystemExit(f"{what} crashed") from None


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _budgets(pool: ProcessPool, case: str, evaluations: int, kinds: Sequence[Kind]) -> dict[Kind, Budget]:
    same = Budget(kind="evaluations", amount=evaluations)
    found: dict[Kind, Budget] = {"evaluations": same}
    if "CPU time" in kinds:
        works = [pool.schedule(run, args=[case, PYMOO[0], seed, same, evaluations]) for seed in range(3)]
        taken = [_done(work, f"{PYMOO[0]} on {case}").seconds for work in works]
        found["CPU time"] = Budget(kind="CPU time", amount=float(np.median(taken)))
        _tell(f"{case}: {evaluations} evaluations, {found['CPU time'].amount:.2f} s")
    return found
