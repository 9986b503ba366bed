"""The recordings of infeasible runs give the reason and what is broken, and show the least-violating motion."""

from __future__ import annotations

import numpy as np
import pytest
from pymoo.core.problem import Problem

import paretoik as pk
from tests.api.problems import tracking
from tests.review.reading import blank_views, check_broken_limits, last_text, missing_entities, read, rows

VERBS = {  # the timeline, the run and its objectives
    "solve": ("generation", lambda problem, **options: pk.solve(problem, population=12, generations=3, **options), ()),
    "plan": ("level", lambda problem, **options: pk.plan(problem, starts=3, **options), (pk.kinetic_energy,)),
    "epsilon_front": ("level", lambda problem, **options: pk.epsilon_front(problem, starts=3, **options), ()),
}


@pytest.fixture(scope="module", params=VERBS)
def narrow(request, tmp_path_factory):
    """Return a problem whose velocity limit no motion satisfies, a verb's error, the timeline and its recording."""
    timeline, verb, objectives = VERBS[request.param]
    problem = tracking(*objectives, velocity=1.0)
    folder = tmp_path_factory.mktemp(request.param) / "run"
    with pytest.raises(pk.Infeasible) as refused:
        verb(problem, out=folder, observe=False)
    return problem, refused.value, timeline, folder / "review.rrd"


def test_the_end_says_the_reason_and_every_limit_that_is_broken_with_its_amount(narrow):
    problem, error, timeline, file = narrow
    texts = read(file)["/text"]
    words = last_text(texts, timeline, max(rows(texts, timeline, "text")))
    assert str(error) in words
    check_broken_limits(words, problem, error.motion)
    words = words.replace("\N{NO-BREAK SPACE}", " ")
    for objective in problem.task.objectives:
        assert f"{objective.name}**: {float(objective(error.motion)):.4g} {objective.unit}" in words


def test_every_generation_or_level_says_what_its_least_violating_motion_breaks(narrow):
    texts = rows(read(narrow[3])["/text"], narrow[2], "text")
    for number in sorted(texts)[:-1]:
        assert "violated by" in str(texts[number][0])
        assert "distinct opt" not in str(texts[number][0])


def test_the_motion_that_breaks_least_is_seen_and_nothing_is_blank(narrow):
    _, _, timeline, file = narrow
    instants = {timeline: (max(rows(read(file)["/text"], timeline, "text")),), "motion": (0,)}
    assert missing_entities(file, ["/arm/chosen/path", "/joint_charts/velocity"], instants) == []
    assert blank_views(file, instants) == []


class Walled(Problem):
    """Three constraints; every point breaks two of them, by 0.5 and 0.25."""

    def __init__(self) -> None:
        super().__init__(n_var=2, n_obj=2, n_ieq_constr=3, xl=0.0, xu=1.0)

    def _evaluate(self, X, out, *args, **kwargs) -> None:
        out["F"] = np.column_stack([X[:, 0], 1.0 - X[:, 0]])
        out["G"] = np.tile([0.25, -1.0, 0.5], (len(X), 1))


def test_a_plain_problem_names_its_constraints_by_their_numbers_the_worst_first(tmp_path):
    with pytest.raises(pk.Infeasible):
        pk.solve(Walled(), population=12, generations=2, out=tmp_path / "run", observe=False)
    text = read(tmp_path / "run" / "review.rrd")["/text"]
    words = last_text(text, "generation", max(rows(text, "generation", "text")))
    assert "- constraint 3: violated by 0.5\n- constraint 1: violated by 0.25\n" in words
    assert "constraint 2" not in words
