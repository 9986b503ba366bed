"""Cold searches of a program whose optima are known: two valleys, of which the deeper comes first."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.errors import SolverFailed
from paretoik.pareto.cold_search import ColdSearch, StartSearch
from tests.pareto.sketches import scaled, sketched


def valleys(upper=2.0):
    """Depths of two valleys, at −1 and, a little less, at 1, and the distance from 0, within bounds."""
    return sketched(
        1, lambda x: [(x[0] ** 2 - 1) ** 2 + 0.1 * x[0], x[0] ** 2], lambda x: ([], [upper - x[0], x[0] + 2.0])
    )


def search(program, starts, **settings):
    x = np.concatenate([starts[:, None], np.zeros((len(starts), 2))], axis=1)
    return StartSearch(program_of=lambda scales: scaled(program, scales), starts=x, n_obj=2, **settings)


def test_the_deeper_valley_comes_first_and_both_are_found():
    cold = search(valleys(), np.linspace(-1.9, 1.9, 9))
    assert isinstance(cold, ColdSearch)
    optima = cold.optima(0)[:, 0]
    slope = np.polynomial.Polynomial([0.1, -4.0, 0.0, 4.0]).roots()  # of the depth, alone
    deep, shallow = slope.min(), slope.max()
    assert optima[0] == pytest.approx(deep, abs=1e-2)  # the other objective counts a little
    assert np.abs(optima - shallow).min() < 1e-2
    assert (np.diff((optima**2 - 1) ** 2 + 0.1 * optima) >= -1e-6).all()


def test_below_a_bound_on_the_other_objective_optima_lie_on_it():
    program = valleys()
    cold = search(program, np.linspace(-1.9, 1.9, 5))
    solutions = cold.optima_below(program, 0, np.array([np.inf, 0.25]), 1e-6)
    assert len(solutions)
    assert np.abs(solutions.x[:, 0]) == pytest.approx(0.5, abs=1e-3)
    assert solutions.x[0, 0] < 0


def test_starts_without_numbers_are_left_out_and_batches_are_shown():
    seen = []
    cold = search(
        valleys(), np.array([np.nan, -0.5, 0.5, np.inf, 1.5, -1.5, 0.2]), observe=lambda *counts: seen.append(counts)
    )
    assert len(cold.optima(0)) == 5
    assert seen[-1] == (5, 5)
    assert [done for done, _ in seen] == [4, 5]


def test_where_no_start_leads_within_the_limits_that_is_said():
    with pytest.raises(SolverFailed, match="a start that leads to a point within all limits wanted"):
        search(valleys(upper=-3.0), np.linspace(-1.0, 1.0, 3)).optima(0)
