"""Counts of random moves."""

from __future__ import annotations

import numpy as np
import pytest

from studies.benchmarks.navigation.cases import Case, Goals
from studies.benchmarks.navigation.moves import random_aim
from studies.benchmarks.navigation.options import OPTIONS
from studies.benchmarks.navigation.tally import Tally, rows_of
from tests.front.test_navigation import front


def test_a_random_move_goes_no_further_than_the_best_of_the_front():
    one, rng = front(), np.random.default_rng(0)
    widths = np.ptp(one.ranges, axis=1)
    for _ in range(100):
        row, aim = random_aim(one, 3, rng)
        k = aim.wish.improve
        assert OPTIONS.shortest <= aim.wish.by <= OPTIONS.longest
        assert one.minimised[row, k] - aim.wish.by * widths[k] >= one.minimised[:, k].min() - 1e-12
        assert aim.wish.payers[0] != k
        assert aim.weights.sum() == pytest.approx(1.0)


def test_losses_come_first():
    tally = Tally(certified=[True, False], best=[True, True], step=[0.02], whole=[0.2])
    tally.peer_seconds = {"IPOPT warm": [0.01], "FATROP cold": [0.1]}
    tally.peer_solved = {"IPOPT warm": [True], "FATROP cold": [False]}
    rows = rows_of("case", Case(make=lambda: None, goals=Goals(step=10.0, certified=60.0, best=100.0)), tally)
    assert [(row.row, row.column) for row in rows[:5]] == [
        ("certified", "of 2 moves"),
        ("a step", "median"),
        ("a step", "beside IPOPT warm"),
        ("converged", "beside IPOPT warm"),
        ("best known", "of 2 moves"),
    ]
    numbers = {(row.row, row.column): row.ours for row in rows}
    assert numbers["certified", "of 2 moves"] == 50.0
    assert numbers["a step", "median"] == pytest.approx(20.0)
