"""Offspring: tournaments, crossover by rows, replacement of one gene, copies at the end."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from paretoik.search.offspring import generate_offspring, next_bits, seed_stream, tournament

ROWS, ROW_SIZE, PARENTS = 3, 4, 11
SIZE = ROWS * ROW_SIZE


def stream(seed):
    state = np.empty(1, dtype=np.uint64)
    seed_stream(state, seed, 0)
    return state


def offspring(seed, count, crossover, mutation):
    """Return parents whose genes are their indices, children, children's objectives, and number of new ones."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(PARENTS)
    genes = np.repeat(np.arange(PARENTS, dtype=float)[:, None], SIZE, axis=1)
    fitness, children = rng.normal(size=PARENTS), np.full((SIZE, count), np.nan)
    F = np.concatenate([np.stack([order, -order]).astype(float), np.full((2, count), np.nan)], axis=1)
    arguments = fitness, F, ROW_SIZE, (crossover, mutation), (100.0, 101.0), children
    new = generate_offspring(stream(seed), genes, order, *arguments)
    return children, F[:, PARENTS:], new


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 12))
def test_without_crossover_and_mutation_children_are_copies_with_their_parents_objectives(seed, count):
    children, F, new = offspring(seed, count, 0.0, 0.0)
    assert new == 0
    assert (children == children[0]).all()
    np.testing.assert_array_equal(F, [children[0], -children[0]])


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), pairs=st.integers(1, 6))
def test_a_pair_shares_its_parents_genes_and_every_row_is_cut_once(seed, pairs):
    children, _, new = offspring(seed, 2 * pairs, 1.0, 0.0)
    assert new == 2 * pairs
    for first, second in children.T.reshape(pairs, 2, SIZE):
        parents = {first[0], second[0]}
        assert all({a, b} == parents for a, b in zip(first, second, strict=True))
        for row in first.reshape(ROWS, ROW_SIZE):
            assert np.count_nonzero(np.diff(row)) == len(parents) - 1
            assert row[0] == first[0]


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 12))
def test_mutation_replaces_one_gene_within_the_bounds(seed, count):
    children, _, new = offspring(seed, count, 0.0, 1.0)
    assert new == count
    assert ((children >= 100.0).sum(axis=0) == 1).all()
    assert children.max() < 101.0


def test_the_fitter_of_two_wins_as_often_as_two_draws_have_it():
    fitness, state, draws = np.arange(5.0), stream(1), 4000
    places = np.bincount([tournament(np.uint64(next_bits(state)), fitness, 5) for _ in range(draws)], minlength=5)
    for place, times in enumerate(places):
        assert binomtest(int(times), draws, (2 * place + 1) / 25).pvalue > 1e-4


# Random numbers in streams, compared with SplitMix64 in Python's integers.


def test_the_published_first_numbers_come_out():
    state = np.array([1234567], dtype=np.uint64)
    published = 6457827717110365317, 3203168211198807973, 9817491932198370423
    assert tuple(int(next_bits(state)) for _ in published) == published
