from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from studies.benchmarks.reliability.good_runs import make_run


@pytest.fixture(scope="session")
def good_run(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[Path, Any, Any]]:
    """Return a function that returns the folder of a good run of a kind, its problem, and the target to verify with."""
    made: dict[str, tuple[Path, Any, Any]] = {}

    def get(kind: str) -> tuple[Path, Any, Any]:
        if kind not in made:
            folder = tmp_path_factory.mktemp("runs") / kind.replace(" ", "_")
            made[kind] = folder, *make_run(kind, folder)
        return made[kind]

    return get
