"""Running every method on every problem, interleaved, a process a core."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from studies.benchmarks.maximin.cases import POPULATION, Case
from studies.benchmarks.maximin.methods import methods_of
from studies.benchmarks.maximin.single_run import Run, run_once
from studies.benchmarks.maximin.stored_runs import load_run, save_run, stored_run
from studies.benchmarks.processes import processes, rotated, run_seeds

LIMIT = 600.0  # seconds after which a run, which takes some ten, counts as one that found nothing


Runs: TypeAlias = dict[tuple[str, str], list[Run]]  # of every seed by problem and method


def run(case_name: str, name: str, seed: int, generations: int, folder: Path | None) -> Run:
    """Run one method once, or read what ``folder`` has of it; by names so that it can happen in another process."""
    if folder is None:
        return run_once(case_name, name, seed, generations)
    file = stored_run(folder, case_name, name, seed, generations)
    stored = load_run(file)
    if stored is not None:
        return stored
    result = run_once(case_name, name, seed, generations)
    save_run(file, result)
    return result


def run_all(chosen: Sequence[Case], seeds: int, folder: Path | None = None) -> Runs:
    """Run every method on every case, seeds outermost and the order of methods turning; runs in ``folder`` are read."""

    def arguments(seed: int) -> dict[tuple[str, str], list[Any]]:
        return {
            (case.name, name): [case.name, name, seed, case.generations, folder]
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
