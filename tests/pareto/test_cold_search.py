"""What cold starts lead to, best first, and the second barrier for those that the first one loses."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from paretoik.errors import SolverFailed
from paretoik.nlp.program import InteriorPointOptions
from paretoik.pareto import scalarisation as cold_search
from paretoik.pareto.scalarisation import StartSearch, optima_alone
from tests.pareto.sketches import scaled, sketched


def two_valleys():
    """Of x, whose valleys at -1 and 1 are 0 and 0.5 deep, and of y."""
    return sketched(
        2,
        lambda x: [(x[0] ** 2 - 1) ** 2 + 0.25 * (x[0] + 1) + 0.01 * x[1] ** 2, (x[1] - 1) ** 2],
        lambda x: ([], [3 - x[0], 3 + x[0], 3 - x[1], 3 + x[1]]),
    )


def search():
    starts = np.random.default_rng(0).uniform(-2, 2, (12, 4))
    return StartSearch(program_of=partial(scaled, two_valleys()), starts=starts, names=("first", "second"))


def test_the_optima_of_one_objective_come_best_first():
    x = search().optima(0)
    assert np.all(np.diff((x[:, 0] ** 2 - 1) ** 2 + 0.25 * (x[:, 0] + 1)) >= -1e-6)
    assert x[0, 0] < 0 < x[-1, 0]


def test_starts_that_the_first_barrier_loses_are_tried_with_the_second(monkeypatch):
    optima = search().optima(0)
    lost = replace(cold_search.COLD_OPTIONS, barrier=InteriorPointOptions(barrier=1e-2, iterations=1))
    monkeypatch.setattr(cold_search, "COLD_OPTIONS", lost)
    assert search().optima(0)[0] == pytest.approx(optima[0], abs=1e-5)
    monkeypatch.setattr(cold_search, "COLD_OPTIONS", replace(lost, second_barrier=lost.barrier))
    with pytest.raises(SolverFailed, match="a start that leads to a point within all limits wanted, found none"):
        search().optima(0)


def bounded_valleys(upper=2.0):
    """Depths of two valleys, at −1 and, a little less, at 1, and the distance from 0, within bounds."""
    return sketched(
        1, lambda x: [(x[0] ** 2 - 1) ** 2 + 0.1 * x[0], x[0] ** 2], lambda x: ([], [upper - x[0], x[0] + 2.0])
    )


def search_from(program, starts, **settings):
    x = np.concatenate([starts[:, None], np.zeros((len(starts), 2))], axis=1)
    return StartSearch(
        program_of=lambda scales: scaled(program, scales), starts=x, names=("first", "second"), **settings
    )


def test_below_a_bound_on_the_other_objective_optima_lie_on_it():
    program = bounded_valleys()
    cold = search_from(program, np.linspace(-1.9, 1.9, 5))
    solutions = cold.optima_below(program, 0, np.array([np.inf, 0.25]), 1e-6)
    assert len(solutions)
    assert np.abs(solutions.x[:, 0]) == pytest.approx(0.5, abs=1e-3)
    assert solutions.x[0, 0] < 0


def test_batches_of_starts_are_shown():
    seen = []
    cold = search_from(
        bounded_valleys(),
        np.array([-0.5, 0.5, 1.5, -1.5, 0.2]),
        observe=lambda *counts: seen.append(counts),
    )
    assert len(cold.optima(0)) == 5
    assert seen == [(4, 5, "first (1 of 2)"), (5, 5, "first (1 of 2)")]


def test_where_no_start_leads_within_the_limits_that_is_said():
    with pytest.raises(SolverFailed, match="a start that leads to a point within all limits wanted"):
        search_from(bounded_valleys(upper=-3.0), np.linspace(-1.0, 1.0, 3)).optima(0)


def test_initial_points_lead_to_an_optimum_where_the_others_are_small_too():
    """Of x alone and of x and y: where the first is least, any y is as good to it."""
    program = sketched(
        2, lambda x: [x[0] ** 2, (x[0] - 1) ** 2 + x[1] ** 2], lambda x: ([], [5 - x[0], 5 + x[0], 5 - x[1], 1 + x[1]])
    )
    nothing = StartSearch(program_of=partial(scaled, program), starts=np.empty((0, 4)), names=("first", "second"))
    initial = np.array([[0.5, 3.0, 0.25, 9.25]])
    x = optima_alone(partial(scaled, program), nothing, 0, 2, initial, "auto")
    assert x[0, :2] == pytest.approx([0.0, 0.0], abs=1e-2)
