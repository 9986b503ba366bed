"""MaxiMinNSGA2 as a guest of pymoo."""

from __future__ import annotations

import numpy as np
import pytest
from moocore import hypervolume
from pymoo.core.population import Population
from pymoo.operators.sampling.lhs import LHS
from pymoo.optimize import minimize
from pymoo.problems import get_problem

from paretoik.errors import InvalidInput
from paretoik.search.nsga2 import MaxiMinNSGA2
from tests.search.problems import Constant, Parabolas, Repeated


def test_it_solves_zdt1_through_minimize():
    result = minimize(get_problem("zdt1"), MaxiMinNSGA2(pop_size=50), ("n_gen", 250), seed=1)
    assert result.algorithm.evaluator.n_eval == 50 * 250
    assert len(result.F) == 50
    assert hypervolume(result.F, ref=[1.1, 1.1]) > 0.855  # the front itself: 0.8767


def test_the_same_seed_gives_the_same_bits():
    runs = [minimize(Parabolas(), MaxiMinNSGA2(pop_size=12), ("n_gen", 12), seed=seed).F for seed in (3, 3, 4)]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_ask_and_tell_equals_minimize():
    problem = Parabolas()
    algorithm = MaxiMinNSGA2(pop_size=12)
    algorithm.setup(problem, seed=3, termination=("n_gen", 12))
    while algorithm.has_next():
        infills = algorithm.ask()
        algorithm.evaluator.eval(problem, infills)
        algorithm.tell(infills=infills)
    assert np.array_equal(algorithm.result().F, minimize(problem, MaxiMinNSGA2(pop_size=12), ("n_gen", 12), seed=3).F)


def test_one_objective():
    result = minimize(get_problem("sphere", n_var=4), MaxiMinNSGA2(pop_size=20), ("n_gen", 80), seed=1)
    assert result.F[0] < 1e-3


@pytest.mark.parametrize("problem", [Constant(1), Constant(2), Constant(3), Repeated(), Parabolas(n_obj=10)])
def test_constant_repeated_and_ten_objectives(problem):
    result = minimize(problem, MaxiMinNSGA2(pop_size=12), ("n_gen", 8), seed=1)
    assert np.isfinite(result.F).all()


def test_constraints_are_kept():
    result = minimize(Parabolas(constrained=True), MaxiMinNSGA2(pop_size=20), ("n_gen", 40), seed=1)
    assert (result.X[:, 0] >= 0.3 - 1e-9).all()
    assert result.X[:, 0].min() < 0.32


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


def test_misspelt_options_are_refused():
    with pytest.raises(InvalidInput, match="popsize"):
        MaxiMinNSGA2(popsize=10)
    with pytest.raises(InvalidInput, match="minimize: one of pymoo's options wanted, got 'sede'"):
        minimize(Parabolas(), MaxiMinNSGA2(pop_size=10), ("n_gen", 2), sede=1)


def test_offspring_may_differ_in_number():
    result = minimize(Parabolas(), MaxiMinNSGA2(pop_size=10, n_offsprings=3), ("n_gen", 5), seed=1)
    assert result.algorithm.evaluator.n_eval == 10 + 4 * 3
    with pytest.raises(InvalidInput, match="n_offsprings: an integer of at least 1 wanted, got 0"):
        MaxiMinNSGA2(n_offsprings=0)
