"""The benchmark of basins: its problems, and how tries are counted."""

from __future__ import annotations

import numpy as np
import pytest

from studies.benchmarks.basins.cases import all_cases
from studies.benchmarks.basins.racing import Tries, rows_of


def test_there_are_sixty_problems_of_different_names():
    cases = all_cases(0)
    assert len({case.name for case in cases}) == len(cases) == 60


@pytest.mark.parametrize("arm", ["planar 4R", "rail", "UR10"])
def test_a_problem_is_drawn_alike_every_time(arm):
    case = next(case for case in all_cases(3) if case.arm == arm)
    first, second = case.problem().task, case.problem().task
    assert np.array_equal(first.targets, second.targets)
    assert first.redundancy >= 1


def test_the_time_to_the_best_is_that_of_all_tries_over_those_that_ended_there():
    tries = Tries(values=[2.0, 1.0, 1.0, np.inf], seconds=[1.0, 1.0, 2.0, 4.0])
    assert (tries.best, tries.hits(1.0), tries.time_to_best(1.0)) == (1.0, 2, 4.0)
    assert tries.time_to_best(0.5) == np.inf


@pytest.mark.slow
def test_a_problem_is_raced():
    case = next(case for case in all_cases(0) if case.arm == "rail")
    assert {row.column for row in rows_of(case, seeds=1)} == {
        "best found",
        "time to best, IPOPT",
        "time to best, FATROP",
    }
