"""Robot kernels and Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.robot.arms import tringali_3r
from paretoik.robot.dynamics import inverse_dynamics
from studies.benchmarks import kinematics


def test_the_peer_is_given_the_same_arm():
    pinocchio = pytest.importorskip("pinocchio", reason="the peer, Pinocchio, comes with the extra bench")
    for arm in (tringali_3r(), kinematics.panda()):
        model = kinematics.pinocchio_model(arm)
        data = model.createData()
        q, dq, ddq = np.random.default_rng(1).normal(size=(3, 4, arm.dof))
        torques = [pinocchio.rnea(model, data, *sample) for sample in zip(q, dq, ddq, strict=True)]
        np.testing.assert_allclose(inverse_dynamics(arm, q, dq, ddq), torques, rtol=1e-10, atol=1e-12)


def test_each_function_counts_with_its_shortest_time_and_they_take_turns(monkeypatch):
    clock, calls = [0.0], []
    taken = {"ours": iter([3.0, 1.0, 2.0]), "peer": iter([5.0, 7.0, 4.0])}

    def runner(name):
        def function():
            calls.append(name)
            clock[0] += next(taken[name])

        return function

    monkeypatch.setattr(kinematics.time, "perf_counter", lambda: clock[0])
    assert kinematics.best_times([runner("ours"), runner("peer")], 3) == [1.0, 4.0]
    assert calls == ["ours", "peer"] * 3


@pytest.mark.parametrize(("goal", "note"), [(np.inf, "goal met"), (0.0, "goal missed")])
def test_a_time_says_whether_it_met_its_goal(monkeypatch, goal, note):
    monkeypatch.setattr(kinematics, "MOTIONS", 2)
    row = kinematics.motion_row("planar 3R", tringali_3r(), goal, 1)
    assert (row.unit, row.reference, row.note) == ("ms", goal, note)
    assert row.ours > 0


def test_both_problems_have_the_motions_that_their_table_speaks_of(monkeypatch):
    problem = kinematics.energy_torque()
    assert len(problem.task.times) == kinematics.SAMPLES
    evaluated = []
    monkeypatch.setattr(problem, "evaluate", evaluated.append)
    row = kinematics.gene_row("energy_torque", problem, 2)
    assert [genes.shape for genes in evaluated] == [(kinematics.MOTIONS, problem.n_var)] * 2
    assert row.note == "kinetic_energy, torque_norm"
