"""MaxiMinNSGA2 within pymoo."""

from __future__ import annotations

import numpy as np
import pytest
from moocore import hypervolume
from pymoo.core.population import Population
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.operators.sampling.lhs import LHS
from pymoo.optimize import minimize
from pymoo.problems import get_problem

from paretoik.search.ask_tell import Search
from paretoik.search.nsga2 import BranchwiseMating, MaxiMinNSGA2
from tests.search.problems import Branches, Constant, Parabolas


def test_maximin_nsga2_solves_zdt1_through_minimize():
    result = minimize(get_problem("zdt1", n_var=10), MaxiMinNSGA2(pop_size=50), ("n_gen", 120), seed=1)
    assert result.algorithm.evaluator.n_eval == 50 * 120
    assert len(result.F) == 50
    assert hypervolume(result.F, ref=[1.1, 1.1]) > 0.855  # the front itself: 0.8767


def test_infeasible_survivors_never_enter_the_result():
    algorithm = MaxiMinNSGA2(pop_size=20, infeasible_share=0.2)
    result = minimize(Parabolas(constrained=True), algorithm, ("n_gen", 40), seed=1)
    assert (result.G <= 1e-9).all()
    assert (result.pop.get("G") > 0).sum() == 4


class Poisoned(Parabolas):
    """NaN objectives in 70 % of the box, and NaN constraints in a part of the rest."""

    def _evaluate(self, x, out, *args, **kwargs):
        super()._evaluate(x, out)
        out["F"][x[:, 1] < 0.8] = np.nan
        out["F"][x[:, 1] > 1.9] = -np.inf
        out["G"][x[:, 2] > 1.0] = np.nan


def test_nan_and_infinite_objectives_and_nan_constraints_never_enter_the_front():
    result = minimize(Poisoned(constrained=True), MaxiMinNSGA2(pop_size=30), ("n_gen", 40), seed=1)
    assert len(result.F) > 5
    assert np.isfinite(result.F).all()
    assert (result.X[:, 1] >= 0.8).all()


class Impossible(Parabolas):
    def _evaluate(self, x, out, *args, **kwargs):
        super()._evaluate(x, out)
        out["G"] = 1.0 + x[:, :1] ** 2


def test_without_a_feasible_point_the_least_violating_one_is_the_optimum():
    result = minimize(
        Impossible(constrained=True), MaxiMinNSGA2(pop_size=10), ("n_gen", 30), seed=1, return_least_infeasible=True
    )
    assert 1.0 <= result.G.min() < 1.01


@pytest.mark.parametrize("sampling", [LHS(), np.full((3, 3), 0.5), Population.new("X", np.full((2, 3), 0.25))])
def test_any_sampling_is_topped_up_to_the_population(sampling):
    first = []
    minimize(
        Parabolas(),
        MaxiMinNSGA2(pop_size=10, sampling=sampling),
        ("n_gen", 2),
        seed=1,
        callback=lambda algorithm: first.append(algorithm.pop.get("X")),
    )
    assert len(first[0]) == 10
    if not isinstance(sampling, LHS):
        assert (first[0] == (0.25 if isinstance(sampling, Population) else 0.5)).all(axis=1).sum() == 1


# Tournaments, species, and new offspring.


def population(problem, X, *, rank=None, distance=None, violation=None):
    n = len(X)
    pop = Population.new("X", X)
    pop.set("F", problem.evaluate(X, return_values_of=["F"]))
    pop.set("rank", np.zeros(n, int) if rank is None else rank)
    pop.set("crowding", np.ones(n) if distance is None else distance)
    pop.set("CV", np.zeros((n, 1)) if violation is None else violation)
    return pop


def mating(**settings):
    return BranchwiseMating(SBX(eta=15, prob=0.9), PM(eta=20), **settings)


def test_offspring_stay_in_their_parents_species_or_jump_whole():
    problem = Branches()
    rng = np.random.default_rng(4)
    X = np.column_stack((rng.integers(0, 4, 80) + 0.125, rng.uniform(-1, 1, (80, 2))))
    X[:, 1] = problem.species(X) * 0.01  # a mark of the species, narrow relative to mutation
    children = mating().do(problem, population(problem, X), 400, random_state=rng).get("X")
    stayed = children[:, 0] % 1 == 0.125
    assert ((children[:, 0] % 1 == 0.5) | stayed).all()
    assert 0.01 < (~stayed).mean() < 0.12
    assert (problem.xl <= children).all()
    assert (children <= problem.xu).all()
    marked = np.isclose(children[stayed, 1], 0.01 * problem.species(children[stayed]))
    assert marked.mean() > 0.5  # crossing two species would have mixed the marks


def test_offspring_repeat_neither_each_other_nor_their_parents():
    problem = Branches()
    X = np.random.default_rng(1).random((20, 3))
    children = mating().do(problem, population(problem, X), 50, random_state=np.random.default_rng(2)).get("X")
    assert len(np.unique(np.concatenate((X, children)), axis=0)) == 70


def test_offspring_are_complete_even_without_room():
    problem = Constant(2)
    problem.xl = problem.xu = np.array([0.5, 0.5])
    X = np.full((4, 2), 0.5)
    children = mating().do(problem, population(problem, X), 7, random_state=np.random.default_rng(0)).get("X")
    assert children.tolist() == [[0.5, 0.5]] * 7


def test_a_dominated_but_live_species_is_still_there_in_the_end():
    problem = Branches()
    rng = np.random.default_rng(0)
    initial = np.column_stack((np.repeat(np.arange(4), 5) + 0.5, rng.uniform(-1, 1, (20, 2))))
    search = Search(problem, population=40, seed=2, initial=initial)
    for _ in range(40):
        asked = search.ask()
        search.tell(asked.ids, problem.evaluate(asked.X))
    X = search._algorithm.pop.get("X")
    counts = np.bincount(problem.species(X), minlength=4)
    assert counts.min() == 5  # half of the places, distributed evenly
    assert counts[0] == 25
    assert set(problem.species(search.archive.members.X)) == {0}
