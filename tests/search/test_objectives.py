"""Descriptions of a problem's objectives: its own, or those of a plain pymoo problem."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from pymoo.problems import get_problem

from paretoik.errors import InvalidInput
from paretoik.search.objectives import describe_objectives, violations


def test_objectives_of_a_plain_problem_are_numbered_from_one_and_minimised():
    assert describe_objectives(get_problem("zdt1")) == (("f1", "f2"), ("", ""), (False, False))


@pytest.mark.parametrize("attribute", ["names", "units", "maximised"])
def test_descriptions_must_have_one_entry_per_objective(attribute):
    problem = SimpleNamespace(n_obj=3, **{attribute: ["a", "b"]})
    with pytest.raises(InvalidInput, match=rf"problem.{attribute} must have one entry per objective \(3\), got 2"):
        describe_objectives(problem)


# Feasibility of points.


F = np.zeros((4, 2))


def test_an_excess_within_tolerance_is_none_and_beyond_it_counts_whole():
    G = np.array([[1e-12, -1.0], [1e-9, 0.0], [2e-9, 0.0], [0.5, 0.25]])
    assert violations(F, G).tolist() == [0.0, 0.0, 2e-9, 0.75]


def test_each_constraint_may_have_its_own_tolerance():
    G = np.array([[0.1, 0.1], [0.3, 0.0], [0.0, 0.05], [0.2, -5.0]])
    assert violations(F, G, tolerance=[0.2, 0.05]).tolist() == [0.1, 0.3, 0.0, 0.0]


def test_equalities_count_on_both_sides():
    H = np.array([[1e-5], [-1e-5], [0.5], [-0.5]])
    assert violations(F, None, H).tolist() == [0.0, 0.0, 0.5, 0.5]


def test_nan_constraints_and_objectives_that_are_not_finite_are_infinitely_bad():
    poisoned = F.copy()
    poisoned[0, 1], poisoned[1, 0] = np.nan, -np.inf
    G = np.array([[-1.0], [-1.0], [np.nan], [-np.inf]])
    assert violations(poisoned, G).tolist() == [np.inf, np.inf, np.inf, 0.0]
    assert violations(F, None, np.full((4, 1), np.nan)).tolist() == [np.inf] * 4


@pytest.mark.parametrize("tolerance", [[0.1, 0.1, 0.1], -1e-3, np.nan])
def test_a_tolerance_that_cannot_be_used_is_refused_by_name(tolerance):
    with pytest.raises(InvalidInput, match="tolerance must be"):
        violations(F, np.zeros((4, 2)), tolerance=tolerance)
