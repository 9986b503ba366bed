"""The benchmark of limits between samples: motions are judged by at(t), and tightening has a cost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from studies.benchmarks.between.__main__ import GOAL, compare, table_rows
from studies.benchmarks.between.cases import Case, motion_at, worst_violation

LIMITS = pk.Limits(acceleration=14.0, velocity=3.5)
PATH = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=51)


def case():
    problem = pk.Tracking(pk.arms.tringali_3r(), PATH, objectives=[pk.kinetic_energy])
    best = pk.plan(problem, starts=6).best
    return Case(
        name="line",
        arm=pk.arms.tringali_3r(),
        path=PATH,
        objective=pk.kinetic_energy,
        cyclic=False,
        limits=LIMITS,
        q=best.motion.q,
        scale=best.objective,
    )


def test_splines_keep_between_samples_what_differences_exceed_and_losses_come_first():
    compared = compare(case())
    assert compared.tightened.violation <= GOAL < 0.01 < compared.central.violation
    assert compared.tightened.violation == pytest.approx(compared.reported, abs=2e-5)
    assert "acceleration" in compared.central.where
    assert 0 <= compared.cost < 0.2
    lost = compared._replace(name="lost", tightened=compared.tightened._replace(violation=0.5))
    rows = table_rows([compared, lost])
    assert rows[0].ours == 1
    assert [row.row for row in rows if row.column == "tightened"] == ["lost", "line"]


def test_motions_are_judged_only_by_their_positions():
    problem = case().problem("spline")
    motion = problem.decode(problem.sample_starts(1, np.random.default_rng(0)))[0]
    times = np.linspace(0.02, 0.98, 49)
    ahead, behind = (motion_at(motion, times, step) for step in (1e-4, -1e-4))
    np.testing.assert_allclose(ahead.q, motion.at(times), atol=1e-12)
    np.testing.assert_allclose(ahead.dq, behind.dq, atol=1e-5)
    np.testing.assert_allclose(ahead.ddq, behind.ddq, rtol=1e-3, atol=2e-2)
    free = replace(motion, tasks=())
    np.testing.assert_allclose(motion_at(free, times, 1e-4).ddq, motion.spline.at(times)[2], atol=1e-4)
    worst, where = worst_violation(problem.task, motion)
    assert worst > 0
    assert "acceleration" in where or "velocity" in where
