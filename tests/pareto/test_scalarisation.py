"""Objectives made one: sizes, ranges and weights by their definitions; batches change nothing."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.front.indicators import ranges_of
from paretoik.nlp.program import InteriorPointOptions
from paretoik.pareto.scalarisation import main_weights, minimise_weighted, objective_sizes
from tests.pareto.sketches import ellipses, ellipses_best, placed, sketched


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


def test_the_main_objective_weighs_one_and_the_others_what_is_asked():
    np.testing.assert_array_equal(main_weights(3, np.array([2, 0]), 0.1), [[0.1, 0.1, 1.0], [1.0, 0.1, 0.1]])
    np.testing.assert_array_equal(main_weights(2, np.array([0, 1]), np.array([0.2, 0.3])), [[1.0, 0.2], [0.3, 1.0]])


def test_batches_lead_where_all_points_lead_at_once_and_are_looked_at_one_by_one():
    program, weights = sketched(2, ellipses), np.array([[0.8, 0.2]])
    rng, counts = np.random.default_rng(0), []
    starts = placed(ellipses, rng.normal(size=(5, 2)))
    settings = {"solver": "auto", "observe": lambda *count: counts.append(count)}
    together = minimise_weighted(program, starts, weights, None, InteriorPointOptions(), **settings)
    batches = minimise_weighted(program, starts, weights, None, InteriorPointOptions(), batch=2, **settings)
    assert counts == [(5, 5), (2, 5), (4, 5), (5, 5)]
    np.testing.assert_array_equal(together.x, batches.x)
    assert together.x[:, :2] == pytest.approx(np.tile(ellipses_best(0.8), (5, 1)), abs=1e-5)


def test_a_bound_holds_where_the_weights_alone_would_break_it():
    program, upper = sketched(2, ellipses), np.array([[np.inf, 2.0]])
    start = placed(ellipses, [[1.0, 0.5]])
    (end,) = minimise_weighted(program, start, np.array([[1.0, 0.0]]), upper, InteriorPointOptions(), solver="auto").x
    shares = np.linspace(0.0, 1.0, 2001)[1:-1]
    front = np.array([ellipses(ellipses_best(share)) for share in shares])
    assert end[3] == pytest.approx(2.0, abs=1e-6)
    assert end[2] == pytest.approx(np.interp(2.0, front[:, 1], front[:, 0]), rel=1e-5)
