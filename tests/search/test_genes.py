"""MaxiMinNSGA2 on genes of any kind: integers, binary, named variables, real numbers without bounds."""

from __future__ import annotations

import numpy as np
import pytest
from pymoo.core.problem import ElementwiseProblem, Problem
from pymoo.core.variable import Binary, Choice, Integer, Real
from pymoo.operators.sampling.rnd import BinaryRandomSampling
from pymoo.optimize import minimize
from pymoo.problems import get_problem

from paretoik.errors import InvalidInput
from paretoik.search.ask_tell import Search
from paretoik.search.genes import seeded_population
from paretoik.search.nsga2 import MaxiMinNSGA2


class Integers(Problem):
    def __init__(self):
        super().__init__(n_var=3, n_obj=2, xl=-20, xu=20, vtype=int)

    def _evaluate(self, X, out, *args, **kwargs):
        assert np.array_equal(X, np.round(X))
        out["F"] = np.stack([(X**2).sum(axis=1), ((X - 5) ** 2).sum(axis=1)], axis=1)


class Bits(Problem):
    def __init__(self, n_var=20):
        super().__init__(n_var=n_var, n_obj=2, xl=0, xu=1, vtype=bool)

    def _evaluate(self, X, out, *args, **kwargs):
        assert X.dtype == bool
        half = self.n_var // 2
        out["F"] = np.stack([-X.sum(axis=1), X[:, :half].sum(axis=1)], axis=1).astype(float)


class Named(ElementwiseProblem):
    def __init__(self):
        names = {"flag": Binary(), "kind": Choice(options=["a", "b"]), "n": Integer(bounds=(-2, 2))}
        super().__init__(vars={**names, "x": Real(bounds=(-5, 5))}, n_obj=2)

    def _evaluate(self, X, out, *args, **kwargs):
        assert isinstance(X["n"], int | np.integer)
        worse = (X["kind"] == "b") + 0.5 * (not X["flag"]) + X["n"] ** 2
        out["F"] = [X["x"] ** 2 + worse, (X["x"] - 1) ** 2 + worse]


class Unbounded(Problem):
    """The front is outside of the first population, between 5 and 6."""

    def __init__(self, xl=None, xu=None):
        super().__init__(n_var=1, n_obj=2, xl=xl, xu=xu)

    def _evaluate(self, X, out, *args, **kwargs):
        out["F"] = np.concatenate([(X - 5) ** 2, (X - 6) ** 2], axis=1)


def solved(problem, *, generations=40, **settings):
    return minimize(problem, MaxiMinNSGA2(pop_size=20, **settings), ("n_gen", generations), seed=1)


def test_integers_stay_integers_and_come_near_both_ends_of_the_front():
    result = solved(Integers(), generations=50)
    assert result.F.min(axis=0).max() <= 2.0
    assert np.array_equal(result.X, np.round(result.X))


def test_bits_reach_both_ends_of_the_front():
    result = solved(Bits(12), generations=60)
    assert result.F.min(axis=0).tolist() == [-12.0, 0.0]
    assert result.X.dtype == bool


def test_named_variables_keep_their_types_and_come_near_the_front():
    result = solved(Named())
    assert {(each["kind"], bool(each["flag"]), each["n"]) for each in result.X} == {("a", True, 0)}
    assert result.F.min(axis=0) == pytest.approx([0.0, 0.0], abs=1e-3)


@pytest.mark.parametrize("bounds", [{}, {"xl": np.zeros(1)}])
def test_without_bounds_the_population_goes_as_far_as_the_front_is(bounds):
    result = solved(Unbounded(**bounds), generations=60, sampling=[[0.0], [1.0]])
    assert result.F.min(axis=0) == pytest.approx([0.0, 0.0], abs=1e-2)
    assert result.F.max() < 1.1


@pytest.mark.parametrize("make", [Bits, Named])
def test_evaluated_individuals_are_not_evaluated_again(make):
    problem = make()
    first = minimize(problem, MaxiMinNSGA2(pop_size=20), ("n_gen", 1), seed=1).pop
    assert len(first) == 20
    result = solved(problem, generations=4, sampling=first)
    assert result.algorithm.evaluator.n_eval == 3 * 20


@pytest.mark.parametrize("sampling", [BinaryRandomSampling(), np.random.default_rng(0).random((20, 80)) < 0.5])
def test_genes_are_binary_where_the_sampling_is_whatever_pymoo_calls_them(sampling):
    problem = get_problem("zdt5")
    assert problem.vtype is float
    result = minimize(problem, MaxiMinNSGA2(pop_size=20, sampling=sampling), ("n_gen", 30), seed=1)
    assert result.X.dtype == bool
    ones = result.X[:, :30].sum(axis=1)
    np.testing.assert_allclose(result.F[:, 0], (1 + ones - 1) / 30, atol=1e-12)  # f1 = 1 + ones, normalised


# The first population.


class Structured(Problem):
    def __init__(self):
        super().__init__(n_var=2, n_obj=2, xl=0.0, xu=1.0)

    def sample_starts(self, n, rng):
        return np.column_stack((np.full(n, 0.25), rng.random(n)))

    def self_motion_samples(self, n, rng):
        return np.column_stack((np.full(n, 0.75), rng.random(n)))


def plain(xl=0.0, xu=1.0):
    return Problem(n_var=2, n_obj=2, xl=xl, xu=xu)


def rng():
    return np.random.default_rng(0)


def test_a_third_each_comes_from_candidates_self_motion_and_chance_after_the_initial_rows():
    X = seeded_population(Structured(), 30, [[0.5, 0.5], [0.1, 0.2]], rng=rng())
    assert X.shape == (30, 2)
    assert X[:2].tolist() == [[0.5, 0.5], [0.1, 0.2]]
    assert (X[2:12, 0] == 0.25).all()
    assert (X[12:22, 0] == 0.75).all()
    assert not np.isin(X[22:, 0], (0.25, 0.75)).any()


@pytest.mark.parametrize("size", [4, 17])
def test_few_or_equal_seeds_are_topped_up_to_exactly_the_size(size):
    X = seeded_population(plain(), size, [[0.5, 0.0], [0.5, -0.0], [0.5, 0.0]], rng=rng())
    assert X.shape == (size, 2)
    assert len(np.unique(X, axis=0)) == size


def test_rounding_is_clipped_and_anything_more_is_refused_with_row_and_gene():
    X = seeded_population(plain(), 4, [[1.0 + 1e-13, -1e-13]], rng=rng())
    assert X[0].tolist() == [1.0, 0.0]
    with pytest.raises(InvalidInput, match=r"initial\[1\] must have gene 0 between 0.0 and 1.0, got 1.001"):
        seeded_population(plain(), 4, [[0.1, 0.1], [1.001, 0.1]], rng=rng())
    with pytest.raises(InvalidInput, match=r"initial\[0\] must have gene 1 .* got nan"):
        seeded_population(plain(), 4, [[0.1, np.nan]], rng=rng())


@pytest.mark.parametrize(
    ("xl", "xu", "message"),
    [
        ([0.0, 2.0], [1.0, 1.0], "bounds of gene 1 must have xl <= xu, got 2.0 > 1.0"),
        ([0.0, np.nan], [1.0, 1.0], r"xl\[1\] must be a finite bound, got nan"),
        (None, [1.0, 1.0], r"xl must have one bound per gene \(2\), got none"),
    ],
)
def test_bounds_that_cannot_be_used_are_refused_by_name_and_value(xl, xu, message):
    problem = plain(None if xl is None else np.array(xl), np.array(xu))
    with pytest.raises(InvalidInput, match=message):
        Search(problem)
