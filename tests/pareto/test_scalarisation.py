"""Scalarisation: sizes, ranges and weights follow their definitions; batches change nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from paretoik.errors import SolverFailed
from paretoik.front.hypervolume import ranges_of
from paretoik.nlp.program import InteriorPointOptions
from paretoik.pareto import scalarisation as cold_search
from paretoik.pareto.scalarisation import StartSearch, minimise_weighted, objective_sizes, optima_alone
from tests.pareto.sketches import ellipses, ellipses_best, placed, scaled, sketched


def test_the_size_of_an_objective_is_its_value_or_its_change_in_a_step_of_length_one():
    program = sketched(2, ellipses)
    x = placed(ellipses, [[0.5, 0.25], [0.0, 0.0]])
    unit = program.linearise(x[0]).unit
    sizes = objective_sizes(program, x, 2)
    values = np.abs(x[:, 2:]).max(axis=0)
    assert sizes == pytest.approx(np.maximum(values, unit))  # the sketch's objectives are coordinates: gradients of 1


def test_ranges_are_nadir_less_ideal_and_those_of_rounding_give_way_to_sizes():
    values = np.array([[1.0, 5.0, 0.0], [3.0, 5.0 + 1e-12, 0.0]])
    assert ranges_of(values) == pytest.approx([2.0, 5.0, 1.0])
    assert ranges_of(values, np.array([1.0, 7.0, 2.0])) == pytest.approx([2.0, 7.0, 2.0])


def test_a_bound_holds_where_the_weights_alone_would_break_it():
    program, upper = sketched(2, ellipses), np.array([[np.inf, 2.0]])
    start = placed(ellipses, [[1.0, 0.5]])
    (end,) = minimise_weighted(program, start, np.array([[1.0, 0.0]]), upper, InteriorPointOptions(), solver="auto").x
    shares = np.linspace(0.0, 1.0, 2001)[1:-1]
    front = np.array([ellipses(ellipses_best(share)) for share in shares])
    assert end[3] == pytest.approx(2.0, abs=1e-6)
    assert end[2] == pytest.approx(np.interp(2.0, front[:, 1], front[:, 0]), rel=1e-5)


# Optima from cold starts, best first, and the second barrier for starts that the first one loses.


def search(count=12):
    """Return the search in two valleys, at −1 and, less deep, at 1, and for the distance from 0, within bounds."""
    valleys = sketched(
        1, lambda x: [(x[0] ** 2 - 1) ** 2 + 0.1 * x[0], x[0] ** 2], lambda x: ([], [2.0 - x[0], x[0] + 2.0])
    )
    starts = np.pad(np.linspace(-1.9, 1.9, count)[:, None], ((0, 0), (0, 2)))
    return StartSearch(program_of=partial(scaled, valleys), starts=starts, names=("first", "second"))


def test_starts_that_the_first_barrier_loses_are_tried_with_the_second(monkeypatch):
    optima = search().optima(0)
    lost = replace(cold_search.COLD_OPTIONS, barrier=InteriorPointOptions(barrier=1e-2, iterations=1))
    monkeypatch.setattr(cold_search, "COLD_OPTIONS", lost)
    assert search().optima(0)[0] == pytest.approx(optima[0], abs=1e-5)
    monkeypatch.setattr(cold_search, "COLD_OPTIONS", replace(lost, second_barrier=lost.barrier))
    with pytest.raises(SolverFailed, match="at least one start must lead to a point within all limits"):
        search().optima(0)


def test_below_a_bound_on_the_other_objective_optima_lie_on_it():
    cold = search(5)
    solutions = cold.optima_below(cold.program_of([1.0, 1.0]), 0, np.array([np.inf, 0.25]), 1e-6)
    assert len(solutions)
    assert np.abs(solutions.x[:, 0]) == pytest.approx(0.5, abs=1e-3)
    assert solutions.x[0, 0] < 0


def test_initial_points_lead_to_an_optimum_where_the_others_are_small_too():
    """Objectives of x, and of x and y: at the first one's minimum any y is optimal."""
    program = sketched(
        2, lambda x: [x[0] ** 2, (x[0] - 1) ** 2 + x[1] ** 2], lambda x: ([], [5 - x[0], 5 + x[0], 5 - x[1], 1 + x[1]])
    )
    nothing = StartSearch(program_of=partial(scaled, program), starts=np.empty((0, 4)), names=("first", "second"))
    initial = np.array([[0.5, 3.0, 0.25, 9.25]])
    x = optima_alone(partial(scaled, program), nothing, 0, 2, initial, "auto")
    assert x[0, :2] == pytest.approx([0.0, 0.0], abs=1e-2)
