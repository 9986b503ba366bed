"""Running every method on every case, interleaved, under both budgets; one process per core."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import numpy as np

from paretoik.runs.distribution import Executor
from studies.benchmarks.fronts.cases import CASES, POPULATION, Budget, Kind, Run, problem_of
from studies.benchmarks.fronts.methods import CELLS, OURS, PLAIN, PYGMO, PYMOO, cell_run, ours, pygmo_run, pymoo_run
from studies.benchmarks.fronts.sweeps import OURS as EPSILON
from studies.benchmarks.fronts.sweeps import SOLVERS, Form, epsilon_run, form_of
from studies.processes import processes, rotated, run_each, run_seeds
from studies.reporting import tell

Found: TypeAlias = dict[tuple[str, Kind], dict[str, list[Run]]]  # runs of every seed by method, case and budget

KINDS: tuple[Kind, ...] = ("evaluations", "CPU time")
LIMIT = 600.0  # seconds after which a run, which takes about ten, counts as empty


def methods_of(case: str) -> list[str]:
    """Return the names of all methods that can run on a case, ours first."""
    peers = [name for name in SOLVERS if CASES[case].tringali or SOLVERS[name] == "ipopt"]
    return [OURS, PLAIN, EPSILON, *CELLS, *PYMOO, *PYGMO, *peers]


def run(case: str, name: str, seed: int, budget: Budget, evaluations: int, form: Form | None = None) -> Run:
    """Run one method once, after a warm-up; by names so that it can run in another process."""
    gradients = name == OURS or (name in CELLS and CELLS[name].refined)
    _warm_up(case, name if name in (EPSILON, *SOLVERS) else OURS if gradients else PYMOO[0], form)
    return _run(case, name, seed, budget, evaluations, form)


@lru_cache(maxsize=256)
def _warm_up(case: str, name: str, form: Form | None) -> None:
    """Compile and load everything that a method and similar ones need, in this process, before they are timed."""
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
    chosen: Sequence[str],
    kinds: Sequence[Kind],
    seeds: int,
    evaluations: int | None = None,
    *,
    compiling: bool = True,
    cluster: str | None = None,
) -> Found:
    """Run everything, seeds outermost, the order of methods rotating, one process per core."""
    sizes = {case: evaluations or CASES[case].evaluations for case in chosen}
    with TemporaryDirectory() as folder, processes(cluster) as executor:
        forms = _forms(executor, chosen, Path(folder) if compiling else None)
        budgets = {case: _budgets(executor, case, sizes[case], kinds) for case in chosen}

        def arguments(seed: int) -> dict[tuple[str, str, Kind], list[Any]]:
            return {
                (case, name, kind): [case, name, seed, budget, sizes[case], forms.get((case, name))]
                for case in chosen
                for name in rotated(methods_of(case), seed)
                for kind, budget in budgets[case].items()
            }

        every = run_seeds(executor, run, arguments, seeds, limit=LIMIT, empty=lambda key: empty_run(key[0]))
    results: Found = {}
    for (case, name, kind), runs in every.items():
        results.setdefault((case, kind), {})[name] = runs
    return results


def empty_run(case: str) -> Run:
    """Return a run that found nothing."""
    F = np.empty((0, problem_of(case).n_obj))
    return Run(F=F, failed=0, evaluations=0, iterations=0, seconds=0.0)


def _forms(executor: Executor, chosen: Sequence[str], folder: Path | None) -> dict[tuple[str, str], Form]:
    names = [(case, name) for case in chosen for name in methods_of(case) if name in SOLVERS]
    forms = run_each(executor, {(case, name): partial(form_of, name, case, folder) for case, name in names})
    tell("peers: built")
    return forms


def _budgets(executor: Executor, case: str, evaluations: int, kinds: Sequence[Kind]) -> dict[Kind, Budget]:
    same = Budget(kind="evaluations", amount=evaluations)
    budgets: dict[Kind, Budget] = {"evaluations": same}
    if "CPU time" in kinds:
        name = PYMOO[0]
        runs = {(name, case, f"seed {seed}"): partial(run, case, name, seed, same, evaluations) for seed in range(3)}
        taken = [done.seconds for done in run_each(executor, runs).values()]
        budgets["CPU time"] = Budget(kind="CPU time", amount=float(np.median(taken)))
        tell(f"{case}: {evaluations} evaluations, {budgets['CPU time'].amount:.2f} s")
    return budgets
