"""The model of a cluster: its predictions for few workers and for many, and the fit of its parameters."""

from __future__ import annotations

import os

import pytest

from studies.benchmarks.scaling.local_cluster import processor_seconds
from studies.benchmarks.scaling.model import Overheads, fit_waiting

COSTS = Overheads(client=0.001, scheduler=0.002, worker=0.003, gap=0.01, startup=0.5)


def test_few_workers_are_all_at_work_and_many_wait_for_the_scheduler():
    assert COSTS.makespan(100, 1.0, 10) == pytest.approx(0.5 + 10 * 1.01)
    assert COSTS.makespan(100_000, 1.0, 5000) == pytest.approx(0.5 + 200.0)
    assert COSTS.efficiency(100_000, 1.0, 100) > 0.98
    assert COSTS.efficiency(100_000, 1.0, 5000) == pytest.approx(0.1, rel=0.01)


def test_more_workers_than_saturate_the_scheduler_are_no_faster():
    saturated = int(COSTS.saturation(1.0))
    many = [COSTS.makespan(10**6, 1.0, workers) for workers in (saturated // 2, saturated + 20, 2 * saturated)]
    assert many[0] > 1.9 * many[1]
    assert many[1] == many[2]


@pytest.mark.parametrize("workers", [10, 1000])
def test_tasks_of_the_size_that_is_named_use_as_many_workers_as_that(workers):
    size = COSTS.task_size(workers, 0.9)
    assert COSTS.efficiency(10**4 * workers, size, workers) == pytest.approx(0.9, abs=0.01)
    assert COSTS.efficiency(10**4 * workers, size / 2, workers) < 0.85


def test_waiting_is_found_again_from_two_runs():
    walls = [COSTS.startup + rounds * (0.25 + COSTS.gap) for rounds in (4, 20)]
    assert fit_waiting([8, 40], walls, 0.25, 2) == pytest.approx((COSTS.gap, COSTS.startup))


def test_processor_seconds_of_a_process_are_counted():
    before, used = processor_seconds(os.getpid()), os.times()
    while sum(os.times()[:2]) - sum(used[:2]) < 0.3:
        pass
    assert processor_seconds(os.getpid()) - before == pytest.approx(0.3, abs=0.1)
