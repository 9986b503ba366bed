"""The benchmark of basins: its problems, and the counts of tries."""

from __future__ import annotations

import numpy as np
import pytest

from studies.benchmarks.basins import all_cases


def test_there_are_sixty_problems_of_different_names():
    cases = all_cases(0)
    assert len({case.name for case in cases}) == len(cases) == 60


@pytest.mark.parametrize("arm", ["planar 4R", "rail", "UR10"])
def test_a_problem_is_drawn_alike_every_time(arm):
    case = next(case for case in all_cases(3) if case.arm == arm)
    first, second = case.problem().task, case.problem().task
    assert np.array_equal(first.targets, second.targets)
    assert first.redundancy >= 1
