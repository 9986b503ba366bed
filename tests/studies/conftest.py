"""Shared parts of the tests of studies."""

from __future__ import annotations

import pytest

from paretoik.runs.processes import compute
from studies import processes


class Here:
    """An executor that computes in this process."""

    def __init__(self, workers):
        self.workers = workers

    def close(self):
        pass

    def replies(self, function, shared, items, *, seconds):
        for place, item in enumerate(items):
            yield place, compute(function, shared, item)


@pytest.fixture
def here(monkeypatch):
    """Run in this process the work that studies send to others."""
    monkeypatch.setattr(processes, "WorkerProcesses", Here)
