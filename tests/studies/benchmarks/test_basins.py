"""The benchmark of basins: its problems, and the counts of tries."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from paretoik.task.starts import rollout_starts
from studies.benchmarks.basins.cases import all_cases
from studies.benchmarks.basins.racing import race
from studies.benchmarks.basins.tables import table_rows
from studies.benchmarks.fronts.programs import joint_program, pack, unpack


def test_there_are_sixty_problems_of_different_names():
    cases = all_cases(0)
    assert len({case.name for case in cases}) == len(cases) == 60


@pytest.mark.parametrize("arm", ["planar 4R", "rail", "UR10"])
def test_a_problem_is_drawn_alike_every_time(arm):
    case = next(case for case in all_cases(3) if case.arm == arm)
    first, second = case.problem().task, case.problem().task
    assert np.array_equal(first.targets, second.targets)
    assert first.redundancy >= 1


@pytest.mark.parametrize(("arm", "cyclic"), [("planar 4R", False), ("rail", True), ("random 7R", False)])
def test_a_peer_minimises_the_same_peak(arm, cyclic):
    cases = [case for case in all_cases(0) if case.objective.form == "peak"]
    case = replace(next(case for case in cases if case.arm == arm), cyclic=cyclic, objective=pk.peak_torque)
    task = case.problem().task
    (q,) = rollout_starts(task, 4, np.random.default_rng(0))[:1]
    peer = joint_program(task)
    assert np.array_equal(unpack(task, pack(task, q)), q)
    functions = peer.solvers[False].get_function("nlp_g")
    below, peak = pack(task, q), float(pk.peak_torque(task.motion(q)))
    for top, holds in ((peak * (1 + 1e-6), True), (peak * (1 - 1e-6), False)):
        below[-1] = top
        g = np.asarray(functions(below, np.ones(2))).ravel()
        assert (g >= peer.sides["lbg"] - 1e-9).all() == holds


@pytest.mark.slow
def test_a_problem_is_raced():
    case = next(case for case in all_cases(0) if case.arm == "rail")
    assert {row.column for row in table_rows([race(case, seeds=1)])} >= {
        "best found",
        "time to best, IPOPT",
        "time to best, FATROP",
    }
