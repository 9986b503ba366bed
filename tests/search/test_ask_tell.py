"""Ask and tell."""

from __future__ import annotations

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.problems import get_problem

from paretoik.errors import InvalidInput
from paretoik.search.ask_tell import Search
from paretoik.search.nsga2 import MaxiMinNSGA2
from tests.search.problems import Parabolas


def told(search, generations, split=None):
    problem = search.problem
    for _ in range(generations):
        asked = search.ask()
        out = problem.evaluate(asked.X, return_as_dictionary=True)
        parts = [np.arange(len(asked.ids))] if split is None else split(len(asked.ids))
        for part in parts:
            search.tell(asked.ids[part], out["F"][part], out["G"][part] if "G" in out else None)
    return search


def test_asking_twice_returns_the_same_and_changes_nothing():
    once, twice = Search(Parabolas(), population=8, seed=5), Search(Parabolas(), population=8, seed=5)
    for _ in range(3):
        first = twice.ask()
        assert twice.ask() is first
        assert np.array_equal(once.ask().X, first.X)
        for search in (once, twice):
            told(search, 1)


def test_order_and_parts_of_told_results_do_not_matter():
    rng = np.random.default_rng(0)

    def split(n):
        return np.array_split(rng.permutation(n), 3)

    whole = told(Search(Parabolas(), population=10, seed=1), 6)
    parts = told(Search(Parabolas(), population=10, seed=1), 6, split)
    assert np.array_equal(whole.archive.F, parts.archive.F)
    assert np.array_equal(whole.archive.ids, parts.archive.ids)
    assert np.array_equal(whole.ask().X, parts.ask().X)


def test_archived_points_are_what_was_asked_under_their_id():
    search = Search(Parabolas(), population=8, seed=2)
    rows = {}
    for _ in range(6):
        asked = search.ask()
        rows |= dict(zip(asked.ids.tolist(), asked.X, strict=True))
        told(search, 1)
    members = search.archive.members
    assert all(np.array_equal(rows[number], X) for number, X in zip(members.ids.tolist(), members.X, strict=True))
    assert np.array_equal(search.problem.evaluate(members.X), members.F)


@pytest.mark.parametrize(
    ("ids", "rows", "message"),
    [
        ([3, 99], 2, "ids must be among those asked, 0 to 5, got 99"),
        ([2, 2], 2, "ids must be told once each, got 2 again"),
        ([3, 4], 1, r"F must be real numbers of shape \(2, 2\), got shape \(1, 2\)"),
    ],
)
def test_ids_that_are_unknown_or_repeated_are_refused_and_nothing_is_taken(ids, rows, message):
    search = Search(Parabolas(), population=6)
    asked = search.ask()
    search.tell(asked.ids[:1], np.zeros((1, 2)))
    with pytest.raises(InvalidInput, match=message):
        search.tell(ids, np.zeros((rows, 2)))
    search.tell(asked.ids[1:], np.ones((5, 2)))
    assert search.generation == 1


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("F", "G", "message"),
    [
        (np.zeros(4), np.zeros((4, 1)), r"F must be .*\(4, 2\), got shape \(4,\)"),
        (np.zeros((4, 2)), None, r"G must be .*\(4, 1\), got nothing"),
    ],
)
def test_arrays_of_another_shape_or_type_are_refused_by_name(F, G, message):
    search = Search(Parabolas(constrained=True), population=4)
    with pytest.raises(InvalidInput, match=message):
        search.tell(search.ask().ids, F, G)


class Named(Parabolas):
    names = ("speed", "cost")
    units = ("m/s", "J")
    maximised = (True, False)


def test_the_front_speaks_the_users_language():
    search = told(Search(Named(), population=8), 3)
    front = search.front
    assert tuple(front.names) == ("speed", "cost")
    assert tuple(front.units) == ("m/s", "J")
    order = np.argsort(front.ids)
    assert np.array_equal(front.objectives[order], search.archive.F * [-1, 1])
    assert np.array_equal(front.genes[order], search.archive.members.X)
    assert tuple(told(Search(Parabolas(), population=8), 1).front.names) == ("f1", "f2")


def test_suggested_genes_are_asked_next_and_the_rest_later():
    search = told(Search(Parabolas(), population=6, offspring=2), 1)
    best = np.array([[0.1, 0, 0], [0.2, 0, 0], [0.3, 0, 0]])
    search.suggest(best)
    assert np.array_equal(search.ask().X, best[:2])
    told(search, 1)
    assert np.array_equal(search.ask().X[-1:], best[2:])
    told(search, 1)
    assert np.isin([6, 7, 9], search.archive.ids).all()
    with pytest.raises(InvalidInput, match=r"suggested\[0\] must have gene 2 .* got nan"):
        search.suggest([[0, 0, np.nan]])


@pytest.mark.parametrize("algorithm", [MaxiMinNSGA2(pop_size=12), NSGA2(pop_size=12)])
def test_any_genetic_algorithm_can_be_asked(algorithm):
    search = told(Search(Parabolas(), algorithm=algorithm, seed=1), 4)
    assert search.evaluations == 48
    assert algorithm.problem is None  # a copy was used


def test_anchors_look_at_one_objective_at_a_time_and_then_at_all():
    search = Search(get_problem("zdt1", n_var=6), population=20, seed=1, anchors=15)
    told(search, 14)
    alone, ignored = np.median(search.population, axis=0)
    told(search, 16)
    assert alone < 0.05
    assert np.median(search.population[:, 0]) > 10 * alone  # the second stage ignores the first objective
    assert np.median(search.population[:, 1]) < ignored / 2
    told(search, 20)
    assert search.population.shape == (20, 2)
    assert np.ptp(search.population[:, 0]) > 0.5
    assert search.evaluations == 50 * 20
    assert search.ask().ids[0] == search.evaluations
