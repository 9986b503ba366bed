"""The model of a cluster: its predictions for few workers and for many, and the fit of its parameters."""

from __future__ import annotations

import pytest

from studies.benchmarks.scaling.__main__ import Overheads, fit_waiting

COSTS = Overheads(client=0.001, scheduler=0.002, worker=0.003, gap=0.01, startup=0.5)


def test_few_workers_are_all_at_work_and_many_wait_for_the_scheduler():
    assert COSTS.makespan(100, 1.0, 10) == pytest.approx(0.5 + 10 * 1.01)
    assert COSTS.makespan(100_000, 1.0, 5000) == pytest.approx(0.5 + 200.0)


def test_waiting_is_found_again_from_two_runs():
    walls = [COSTS.startup + rounds * (0.25 + COSTS.gap) for rounds in (4, 20)]
    assert fit_waiting([8, 40], walls, 0.25, 2) == pytest.approx((COSTS.gap, COSTS.startup))
