"""What the tests of benchmarks share."""

from __future__ import annotations

from concurrent.futures import Future

import pytest

from studies.benchmarks import processes


class Here:
    """A pool that runs at once, in this process."""

    def __init__(self, *_, **__):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def stop(self):
        pass

    def schedule(self, work, args, timeout=None):
        done = Future()
        done.set_result(work(*args))
        return done


@pytest.fixture
def here(monkeypatch):
    """Run in this process what benchmarks run in others."""
    monkeypatch.setattr(processes, "ProcessPool", Here)
