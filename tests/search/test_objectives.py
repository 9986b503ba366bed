"""What is said of a problem's objectives: its own words, or those of a plain pymoo problem."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from pymoo.problems import get_problem

from paretoik.errors import InvalidInput
from paretoik.search.objectives import describe_objectives


def test_objectives_of_a_plain_problem_are_numbered_from_one_and_minimised():
    assert describe_objectives(get_problem("zdt1")) == (("f1", "f2"), ("", ""), (False, False))


def test_a_problem_s_own_names_units_and_senses_are_taken():
    problem = SimpleNamespace(n_obj=2, names=["work", "reach"], units=["J", "m"], maximised=[False, True])
    assert describe_objectives(problem) == (("work", "reach"), ("J", "m"), (False, True))


@pytest.mark.parametrize("attribute", ["names", "units", "maximised"])
def test_one_of_each_an_objective_is_wanted(attribute):
    problem = SimpleNamespace(n_obj=3, **{attribute: ["a", "b"]})
    with pytest.raises(InvalidInput, match=rf"problem.{attribute}: 3 wanted, one an objective, got 2"):
        describe_objectives(problem)
