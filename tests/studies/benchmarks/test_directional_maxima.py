"""Directional maxima and pymoo: every method runs and is judged, and refined points satisfy the bound."""

from __future__ import annotations

import numpy as np
import pytest

from studies.benchmarks.directional_maxima import (
    CERTIFIED,
    OURS,
    PEERS,
    REFINED,
    certified_rows,
    judge,
    problem_of,
    run,
)


@pytest.mark.slow
def test_every_method_is_judged_and_refined_fronts_are_within_the_bound():
    case = "joint motors: speeds, power"
    problem = problem_of(case)
    runs = {(case, name): [run(case, name, seed) for seed in range(2)] for name in (OURS, REFINED, *PEERS)}
    rows = judge(runs, [case])
    assert {row.source for row in rows} == set(PEERS)
    assert len(rows) == 3 * (len(PEERS) + 1)
    shown = {
        row.column: row.ours for row in certified_rows(case, problem, runs[case, REFINED]) if row.table == CERTIFIED
    }
    assert shown["points that are certified minima"] > 90
    assert 0.9 < shown["greatest value beside its directional maximum, least of all seeds"] <= 1 + 1e-6
    assert np.median([len(one.F) for one in runs[case, OURS]]) > 10
