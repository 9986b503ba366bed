"""Gradients inside a search and at its end."""

import numpy as np
import pytest

import paretoik as pk
from paretoik.refining import SHARE, Improver
from problems import tringali_2020

SMALL = {"population": 30, "generations": 24, "seed": 1, "refine": True}


def problem_of():
    limits = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)
    goals = [pk.kinetic_energy, pk.torque_norm]
    return pk.Tracking(pk.tringali_3r(), tringali_2020.straight(51), objectives=goals, limits=limits)


@pytest.fixture(scope="module")
def front():
    return pk.solve(problem_of(), **SMALL)


def test_a_search_with_gradients_ends_with_certified_points(front):
    assert front.certificates.kkt_residual.max() <= 1e-6
    assert front.certificates.violation.max() <= 1e-8
    assert front.motions.tracking_error.max() <= 1e-9
    assert front.provenance["counts"]["iterations"] > 0


def test_the_same_seed_gives_the_same_front(front):
    assert np.array_equal(pk.solve(problem_of(), **SMALL).objectives, front.objectives)


def test_iterations_take_no_more_than_their_share_of_the_evaluations(front):
    counts = front.provenance["counts"]
    one_round = 5 * 30
    assert counts["iterations"] <= SHARE * counts["evaluations"] + one_round


def test_what_is_suggested_is_better_than_where_it_came_from():
    problem = problem_of()
    search = pk.Search(problem, population=30, seed=1)
    improver = Improver(search)
    for _ in range(10):
        asked = search.ask()
        found = problem.evaluate(asked.X, return_as_dictionary=True)
        search.tell(asked.ids, found["F"], found["G"])
    from paretoik.search.evolution import _progress

    before = search.archive.F.min(axis=0)
    genes = improver(_progress(search, (), 0.0))
    after = problem.evaluate(genes, return_as_dictionary=True)
    fits = (after["G"] <= 1e-3).all(axis=1)
    assert np.all(after["F"][fits].min(axis=0) < before)


def test_only_a_tracking_problem_is_refined():
    from pymoo.problems import get_problem

    with pytest.raises(pk.InvalidInput, match="refine: a Tracking problem wanted"):
        pk.solve(get_problem("zdt1"), population=20, generations=2, refine=True)
