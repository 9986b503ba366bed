"""The recordings of infeasible plans and ε-fronts give the reason, and show the least-violating motion."""

from __future__ import annotations

import pytest

import paretoik as pk
from tests.api.problems import tracking
from tests.review.reading import check_broken_limits, last_text, read, rows

VERBS = {
    "plan": (lambda problem, **options: pk.plan(problem, **options), (pk.kinetic_energy,)),
    "epsilon_front": (lambda problem, **options: pk.epsilon_front(problem, **options), ()),
}


@pytest.fixture(scope="module", params=VERBS)
def narrow(request, tmp_path_factory):
    """Return a problem whose velocity limit no motion satisfies, a verb's error, and its recording."""
    verb, objectives = VERBS[request.param]
    problem = tracking(*objectives, velocity=1.0)
    folder = tmp_path_factory.mktemp(request.param) / "run"
    with pytest.raises(pk.Infeasible) as refused:
        verb(problem, starts=6, out=folder, observe=False)
    return problem, refused.value, folder / "review.rrd"


def levels(file):
    return sorted(rows(read(file)["/text"], "level", "text"))


def test_the_end_says_the_reason_and_every_limit_that_is_broken(narrow):
    problem, error, file = narrow
    words = last_text(read(file)["/text"], "level", levels(file)[-1])
    assert str(error) in words
    check_broken_limits(words, problem, error.motion)
    for objective in problem.task.objectives:
        assert f"{objective.name}**: {float(objective(error.motion)):.4g} {objective.unit}" in words.replace(
            "\N{NO-BREAK SPACE}", " "
        )


def test_every_level_says_what_its_least_violating_motion_breaks(narrow):
    _, _, file = narrow
    texts = rows(read(file)["/text"], "level", "text")
    for number in sorted(texts)[:-1]:
        assert "violated by" in str(texts[number][0])
        assert "distinct opt" not in str(texts[number][0])
