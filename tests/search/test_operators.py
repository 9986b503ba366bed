"""Operators of the genetic algorithm of Marcos et al. 2012, and operators for smooth genes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.core.problem import Problem

from paretoik.search.operators import (
    BinaryTournament,
    Differential,
    OneElite,
    RankWeighting,
    ReplaceOne,
    RowCrossover,
    SmoothMutation,
)


class Box(Problem):
    def __init__(self, genes):
        super().__init__(n_var=genes, n_obj=1, xl=-np.ones(genes), xu=2 * np.ones(genes))


def test_every_row_is_cut_at_a_place_of_its_own_and_both_children_are_complementary():
    rng, row, rows = np.random.default_rng(0), 4, 3
    parents = np.stack([np.zeros((500, row * rows)), np.ones((500, row * rows))])
    one, other = RowCrossover(row)._do(Box(row * rows), parents, random_state=rng)
    np.testing.assert_array_equal(one + other, 1.0)
    behind = one.reshape(500, rows, row)
    assert (np.diff(behind, axis=-1) >= 0).all()  # of the other parent from some gene on
    cuts = row - behind.sum(axis=-1)
    assert set(np.unique(cuts)) == {1, 2, 3}
    assert abs(np.corrcoef(cuts[:, 0], cuts[:, 1])[0, 1]) < 0.2


def test_one_gene_is_replaced_by_a_number_within_its_bounds():
    X = np.full((1000, 5), 7.0)
    made = ReplaceOne()._do(Box(5), X, random_state=np.random.default_rng(0))
    changed = made != 7.0
    assert (changed.sum(axis=1) == 1).all()
    assert (changed.sum(axis=0) > 120).all()
    assert made[changed].min() >= -1
    assert made[changed].max() <= 2
    assert made[changed].max() > 1.9


def ranked(rank, distance):
    individuals = Population.new("X", np.zeros((len(rank), 1)))
    for individual, r, d in zip(individuals, rank, distance, strict=True):
        individual.data |= {"rank": r, "insertion_distance": d}
    return individuals


def test_a_tournament_is_won_by_rank_then_by_distance():
    population = ranked([0, 0, 1, 1], [1.0, np.inf, 5.0, 2.0])
    won = BinaryTournament()._do(Box(1), population, 20000, 1, random_state=np.random.default_rng(0))[:, 0]
    shares = np.bincount(won, minlength=4) / len(won)
    assert shares == pytest.approx([5 / 16, 7 / 16, 3 / 16, 1 / 16], abs=0.015)


def test_rank_weighting_draws_the_best_most_often():
    population = Population(individuals=[Individual(X=np.zeros(1), F=np.array([f])) for f in (3.0, 1.0, 2.0)])
    for individual in population:
        individual.CV = np.zeros(1)
    drawn = RankWeighting()._do(Box(1), population, 30000, 1, random_state=np.random.default_rng(0))[:, 0]
    assert np.bincount(drawn) / len(drawn) == pytest.approx([1 / 6, 3 / 6, 2 / 6], abs=0.015)


def evaluated(*values):
    individuals = [Individual(X=np.array([f]), F=np.array([f])) for f in values]
    for individual in individuals:
        individual.CV = np.zeros(1)
    return Population(individuals=individuals)


def test_offspring_replace_their_parents_but_the_best_parent_that_replaces_the_worst_of_them():
    pop = Population.merge(evaluated(1.0, 9.0, 8.0), evaluated(5.0, 7.0, 6.0))
    assert sorted(OneElite()._do(Box(1), pop, n_survive=3).get("F")[:, 0]) == [1.0, 5.0, 6.0]


# Operators for smooth genes stay in bounds and change only their genes.


ROW = 6


def problem() -> Problem:
    return Problem(n_var=1 + 2 * ROW, n_obj=2, xl=np.r_[0.0, -np.ones(2 * ROW)], xu=np.r_[3.0, np.ones(2 * ROW)])


def individuals(rng, shape):
    box = problem()
    return box.xl + rng.random((*shape, box.n_var)) * (box.xu - box.xl)


@given(st.integers(0, 2**32 - 1))
def test_a_differential_step_moves_along_the_difference_and_stays_in_the_bounds(seed):
    rng = np.random.default_rng(seed)
    X = individuals(rng, (3, 20))
    (made,) = Differential()._do(problem(), X, random_state=rng)
    assert (made >= problem().xl).all()
    assert (made <= problem().xu).all()
    free = (made > problem().xl) & (made < problem().xu)
    step, difference = made - X[0], X[1] - X[2]
    ratios = np.divide(step, difference, out=np.full_like(step, np.nan), where=free & (np.abs(difference) > 1e-6))
    allowed = np.isnan(ratios) | np.isclose(ratios[..., None], [0.3, 0.6, 1.0], rtol=1e-6).any(axis=-1)
    assert allowed.all()


@given(st.integers(0, 2**32 - 1))
def test_a_smooth_mutation_moves_one_row_in_the_bounds_and_never_the_genes_before_the_rows(seed):
    rng = np.random.default_rng(seed)
    X = individuals(rng, (20,))
    made = SmoothMutation(ROW)._do(problem(), X, random_state=rng)
    assert (made >= problem().xl).all()
    assert (made <= problem().xu).all()
    assert np.array_equal(made[:, 0], X[:, 0])
    moved = (made != X)[:, 1:].reshape(20, 2, ROW).any(axis=2)
    assert (moved.sum(axis=1) <= 1).all()
    assert moved.any()
