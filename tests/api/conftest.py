from __future__ import annotations

import pytest

import paretoik as pk
from paretoik.api.solve import solve
from tests.api.problems import QUICK, tracking


@pytest.fixture(scope="session")
def problem() -> pk.Tracking:
    return tracking(velocity=6.0)


@pytest.fixture(scope="session")
def front(problem) -> pk.Front:
    return solve(problem, **QUICK, seed=1)


@pytest.fixture(scope="session")
def run(problem, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "run"
    return folder, solve(problem, **QUICK, seed=1, out=folder)
