"""Restarts: more starts, as long as they lead to better optima."""

from __future__ import annotations

from dataclasses import replace

import paretoik as pk
from paretoik.trajectory import plan_starts


def test_hops_find_better_valleys_where_redundancy_is_more_than_one(monkeypatch):
    arm = pk.Arm.planar(lengths=[0.4, 0.3, 0.3, 0.2], masses=[1.0] * 4)
    path = pk.line([1.0, 0.2], [-0.2, 0.5], duration=1.0, samples=51)
    problem = pk.Tracking(arm, path, objectives=[pk.torque_norm], differences="backward")
    hopped = [pk.plan(problem, seed=seed, starts=6).best.objective for seed in range(6)]
    monkeypatch.setattr(plan_starts, "OPTIONS", replace(plan_starts.OPTIONS, patience=0))
    still = [pk.plan(problem, seed=seed, starts=6).best.objective for seed in range(6)]
    assert all(one <= other * (1 + 1e-6) for one, other in zip(hopped, still, strict=True))
    assert any(one < 0.99 * other for one, other in zip(hopped, still, strict=True))
