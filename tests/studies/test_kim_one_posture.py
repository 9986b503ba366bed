"""The best posture for two directions: IPOPT gains nothing from certified points, and much from others."""

from __future__ import annotations

import numpy as np
import pytest

from problems.kim_2021 import PLACE
from studies.kim_2021.ipopt_programs import posture_program
from studies.kim_2021.maxima import MECHANISMS
from studies.kim_2021.one_posture import CASES, NEAR, one_posture, one_posture_rows


@pytest.fixture(scope="module", params=[(mechanism, case) for mechanism in MECHANISMS for case in CASES])
def found(request):
    return one_posture(*request.param, points=3)


def test_ipopt_gains_nothing_from_certified_points_and_maxima_bound_them(found):
    rows = {row.column: row for row in one_posture_rows(found)}
    assert np.isfinite(found.gained).any()
    assert rows["IPOPT's gain from them, at most"].ours <= 1e-6
    assert rows["certified minima"].ours == len(found.front)
    assert 30 < rows["both at once: of either's maximum at least"].ours <= 100
    assert not any("LOSS" in row.note for row in rows.values())


def test_ipopt_gains_from_points_that_are_not_optimal(found):
    problem = found.front.problem
    mechanism, case = found.name.split(", ")
    ways, quantities = CASES[case]
    program = posture_program(mechanism, quantities, NEAR, bound_relax_factor=0.0, mu_init=1e-4)
    genes = problem.sample_starts(40, np.random.default_rng(0))
    genes = genes[(problem.evaluate(genes, return_values_of=["G"]) <= 0).all(axis=1)][:6]
    values = problem.configuration(genes).values
    ended = [
        program.solved(program.start_at(problem, one), PLACE, ways, first)
        for one, first in zip(genes, values[:, 0], strict=True)
    ]
    ends = np.array([value if success else np.nan for value, success in ended])
    assert np.isfinite(ends).any()
    assert np.nanmax(ends / values[:, 1]) > 1.01
    assert np.nanmax(ends) <= found.maxima[1] * (1 + 1e-6)
