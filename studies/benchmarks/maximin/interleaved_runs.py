"""Running every method on every problem, interleaved, one process per core."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from studies.benchmarks.maximin.cases import POPULATION, Case
from studies.benchmarks.maximin.methods import methods_of
from studies.benchmarks.maximin.single_run import Run, run_once
from studies.benchmarks.maximin.stored_runs import load_run, save_run, stored_run
from studies.processes import processes, rotated, run_seeds

LIMIT = 600.0  # seconds after which a run, which takes about ten, counts as empty


Runs: TypeAlias = dict[tuple[str, str], list[Run]]  # of every seed by problem and method


def run_all(chosen: Sequence[Case], seeds: int, folder: Path | None = None, *, cluster: str | None = None) -> Runs:
    """Run every method on every case, seeds outermost, the order of methods rotating; read runs in ``folder``."""
    shape = {case.name: (case.generations, case.n_obj) for case in chosen}

    def arguments(seed: int) -> dict[tuple[str, str], list[Any]]:
        return {
            (case.name, name): [case.name, name, seed, case.generations]
            for case in chosen
            for name in rotated(methods_of(case), seed)
        }

    def file(key: tuple[str, str], seed: int) -> Path | None:
        return None if folder is None else stored_run(folder, *key, seed, shape[key[0]][0])

    def load(key: tuple[str, str], seed: int) -> Run | None:
        place = file(key, seed)
        return None if place is None else load_run(place)

    def save(key: tuple[str, str], seed: int, result: Run) -> None:
        place = file(key, seed)
        if place is not None:
            save_run(place, result)

    def empty(key: tuple[str, str]) -> Run:
        return Run(np.empty((0, shape[key[0]][1])), LIMIT)

    with processes(cluster) as executor:
        return run_seeds(executor, run_once, arguments, seeds, limit=LIMIT, empty=empty, load=load, save=save)


def evaluations(case: Case) -> int:
    """Return the evaluations of every method on a case."""
    return POPULATION[case.n_obj] * case.generations
