"""The recording of an infeasible search says what is broken, and shows the least-violating motion."""

from __future__ import annotations

import numpy as np
import pytest
from pymoo.core.problem import Problem

import paretoik as pk
from tests.api.problems import QUICK, tracking
from tests.review.reading import blank_views, check_broken_limits, last_text, missing_entities, read, rows


class Walled(Problem):
    """Three constraints; every point breaks two of them, by 0.5 and 0.25."""

    def __init__(self) -> None:
        super().__init__(n_var=2, n_obj=2, n_ieq_constr=3, xl=0.0, xu=1.0)

    def _evaluate(self, X, out, *args, **kwargs) -> None:
        out["F"] = np.column_stack([X[:, 0], 1.0 - X[:, 0]])
        out["G"] = np.tile([0.25, -1.0, 0.5], (len(X), 1))


@pytest.fixture(scope="module")
def narrow(tmp_path_factory):
    folder = tmp_path_factory.mktemp("narrow") / "run"
    problem = tracking(velocity=1.0)
    with pytest.raises(pk.Infeasible) as refused:
        pk.solve(problem, **QUICK, out=folder, observe=False)
    return problem, refused.value, folder / "review.rrd"


def test_every_limit_that_the_least_violating_motion_breaks_is_named_with_its_amount(narrow):
    problem, error, file = narrow
    words = last_text(read(file)["/text"], "generation", max(rows(read(file)["/text"], "generation", "text")))
    assert str(error) in words
    check_broken_limits(words, problem, error.motion)


def test_generations_say_what_the_least_violating_so_far_breaks(narrow):
    _, _, file = narrow
    texts = rows(read(file)["/text"], "generation", "text")
    for number in sorted(texts)[:-1]:
        assert "Constraints broken by the least-violating individual so far:" in str(texts[number][0])
        assert "violated by" in str(texts[number][0])


def test_individuals_and_the_motion_that_breaks_least_are_seen_and_nothing_is_blank(narrow):
    _, _, file = narrow
    last = max(rows(read(file)["/text"], "generation", "text"))
    instants = {"generation": (last,), "motion": (0,)}
    wanted = ["/arm/chosen/path", r"/front/kinetic_energy\ -\ torque_norm/population", "/joint_charts/velocity"]
    assert missing_entities(file, wanted, instants) == []
    assert blank_views(file, instants) == []


def test_a_plain_problem_names_its_constraints_by_their_numbers_the_worst_first(tmp_path):
    with pytest.raises(pk.Infeasible):
        pk.solve(Walled(), **QUICK, out=tmp_path / "run", observe=False)
    text = read(tmp_path / "run" / "review.rrd")["/text"]
    words = last_text(text, "generation", max(rows(text, "generation", "text")))
    assert "- constraint 3: violated by 0.5\n- constraint 1: violated by 0.25\n" in words
    assert "constraint 2" not in words
