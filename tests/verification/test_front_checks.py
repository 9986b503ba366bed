"""Criticality by differences: true at optima with kinks and peaks, false next to them."""

from __future__ import annotations

import copy
import dataclasses
from importlib import import_module

import numpy as np
import pytest

import paretoik as pk
from paretoik.robot.kinematics import jacobian
from paretoik.task.motion_task import SAMPLES
from paretoik.verification.run_contents import read_contents
from paretoik.verification.verify_run import verify_run
from studies.benchmarks.reliability.good_runs import ARM

LINE = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=9)
SUBJECT = "criticality by differences"


@pk.objective(unit="rad", form="integral")
def wrist_travel(motion):
    return np.abs(motion.dq[..., -1]) + 0.1 * motion.kinetic_energy


@pk.objective(unit="rad/s²", form="peak")
def largest_acceleration(motion):
    return np.max(np.abs(motion.ddq), axis=-1)


def tracking(objective, **options):
    return pk.Tracking(ARM, LINE, objectives=[objective], coefficients=4, bases=2, **options)


PROBLEMS = {
    "absolute values": lambda: tracking(pk.mechanical_energy),
    "a peak": lambda: tracking(pk.peak_torque),
    "a user's absolute values": lambda: tracking(wrist_travel),
    "a user's peak": lambda: tracking(largest_acceleration, limits=pk.Limits(velocity=3.0)),
}


SLOW = ("absolute values", "a peak")  # torques take long to compile


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in PROBLEMS]
)
def test_an_optimum_with_kinks_is_critical_and_a_motion_next_to_it_is_not(name, tmp_path, monkeypatch):
    monkeypatch.setattr(
        import_module("paretoik.trajectory.levels"), "SAMPLES", dataclasses.replace(SAMPLES, doublings=0)
    )
    problem = PROBLEMS[name]()
    pk.plan(problem, starts=2, out=tmp_path / "run", observe=False)
    good = read_contents(tmp_path / "run")
    rows = [row for row in verify_run(good, problem).rows if row.subject == SUBJECT]
    assert [row.verdict for row in rows] == ["passed"] * len(good.ids)
    bent = copy.deepcopy(good)
    q, targets = bent.motions["q"][0], problem.task.targets[:, :2]
    q += 0.02 * np.sin(np.linspace(0.0, np.pi, len(q)))[:, None] * [1.0, -1.0, 0.5]
    for _ in range(8):
        miss = targets - ARM.pose(q).position[..., :2]
        q += np.einsum("tji,ti->tj", np.linalg.pinv(jacobian(ARM, q)[:, :2]), miss)
    loose = dataclasses.replace(problem.task, bounds={})
    row = next(row for row in verify_run(bent, with_task(problem, loose)).rows if row.subject == SUBJECT)
    assert row.verdict == "failed"


def with_task(problem, task):
    other = copy.copy(problem)
    other.task = task
    return other
