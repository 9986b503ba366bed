"""The planner beside FATROP."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from problems import tringali_2020
from studies.benchmarks import planner


@pytest.mark.parametrize("name", planner.NAMES)
def test_the_peers_program_is_the_same_problem(name):
    task = getattr(tringali_2020, name)().task.subsampled(planner.COARSE)
    coarse = pk.Tracking(
        task.arm,
        task.tasks[0].path,
        objectives=task.objectives,
        limits=pk.Limits(**{kind: (bounds[0, :, 0], bounds[0, :, 1]) for kind, bounds in task.bounds.items()}),
        cyclic=task.cyclic,
        coefficients=8,
    )
    best = pk.plan(coarse, starts=24).best
    value, solved = planner.peer(task).solve(best.motion.q)
    assert solved
    assert value == pytest.approx(best.objective, rel=2e-6)  # it stops a barrier's width from the limits
    assert value >= best.objective * (1 - 1e-7)


def test_a_hit_is_counted_and_its_time_reported():
    rows = planner.compared("simulation_1", starts=6, seed=0)
    assert {row.column for row in rows} == {
        "objective",
        "to the best optimum",
        "6 starts at 26 samples",
        "one warm solve",
    }
    assert all(row.ours > 0 for row in rows)
    assert np.isfinite([row.paper for row in rows if row.paper is not None]).any()
