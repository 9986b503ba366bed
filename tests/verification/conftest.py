from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import paretoik as pk
from problems.marcos_2012 import loop
from studies.benchmarks.reliability.good_runs import make_run, tracking

# Smaller runs than those of the study: a search with few points, and a loop with few steps.


def make_small_run(kind: str, folder: Path) -> tuple[Any, Any]:
    """Make a good run in a folder; return its problem, and the subject that its motions are verified against."""
    if kind == "search":
        problem = tracking()
        pk.solve(problem, population=12, generations=2, seed=1, observe=False, out=folder)
    elif kind == "closed loop":
        problem = loop(3, 0.7, blocked=True, steps=9, population=12, generations=4)
        pk.solve(problem, observe=False, out=folder)
    else:
        return make_run(kind, folder)
    return problem, problem


@pytest.fixture(scope="session")
def good_run(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[Path, Any, Any]]:
    """Return a function that returns the folder of a good run of a kind, its problem, and the target to verify with."""
    made: dict[str, tuple[Path, Any, Any]] = {}

    def get(kind: str) -> tuple[Path, Any, Any]:
        if kind not in made:
            folder = tmp_path_factory.mktemp("runs") / kind.replace(" ", "_")
            made[kind] = folder, *make_small_run(kind, folder)
        return made[kind]

    return get
