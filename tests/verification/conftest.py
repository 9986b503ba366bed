from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.verification.good_runs import KINDS


@pytest.fixture(scope="session")
def good_run(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[Path, Any]]:
    """Return a function that gives the folder and the problem of a good run of a kind."""
    made: dict[str, tuple[Path, Any]] = {}

    def get(kind: str) -> tuple[Path, Any]:
        if kind not in made:
            make_problem, run = KINDS[kind]
            problem, folder = make_problem(), tmp_path_factory.mktemp("runs") / kind.replace(" ", "_")
            run(problem, folder)
            made[kind] = folder, problem
        return made[kind]

    return get
