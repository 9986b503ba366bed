"""Offspring: tournaments, crossover by rows, replacement of one gene, copies at the end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest, kstest

from paretoik.search.offspring import (
    draw_bits,
    draw_chromosome,
    generate_offspring,
    lower_integer,
    next_bits,
    seed_stream,
    tournament,
    uniform,
    upper_integer,
)

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


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 12))
def test_new_children_come_first_and_every_place_is_filled(seed, count):
    children, _, new = offspring(seed, count, 0.0, 0.5)
    assert np.isfinite(children).all()
    assert ((children >= 100.0).any(axis=0) == (np.arange(count) < new)).all()


def test_the_fitter_of_two_wins_as_often_as_two_draws_have_it():
    fitness, state, draws = np.arange(5.0), stream(1), 4000
    places = np.bincount([tournament(np.uint64(next_bits(state)), fitness, 5) for _ in range(draws)], minlength=5)
    for place, times in enumerate(places):
        assert binomtest(int(times), draws, (2 * place + 1) / 25).pvalue > 1e-4


@pytest.mark.parametrize(("lower", "upper"), [(-1.0, 1.0), (3.0, 3.5)])
def test_a_chromosome_is_drawn_within_its_bounds(lower, upper):
    children = np.full((SIZE, 3), np.nan)
    draw_chromosome(stream(0), lower, upper, children, 1)
    assert ((children[:, 1] >= lower) & (children[:, 1] < upper)).all()
    assert len(set(children[:, 1])) == SIZE
    assert np.isnan(children[:, [0, 2]]).all()


# Random numbers in streams, compared with SplitMix64 in Python's integers.


MASK = (1 << 64) - 1
words = st.integers(0, MASK)


def split_mix(state):
    """Return the next state and output as Steele, Lea & Flood print them."""
    state = (state + 0x9E3779B97F4A7C15) & MASK
    z = state
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
    return state, z ^ (z >> 31)


def random_stream(seed, step):
    state = np.empty(1, dtype=np.uint64)
    seed_stream(state, seed, step)
    return state


@settings(max_examples=25)
@given(words)
def test_bits_are_those_of_split_mix(start):
    state, reference = np.array([start], dtype=np.uint64), start
    for _ in range(5):
        reference, bits = split_mix(reference)
        assert int(next_bits(state)) == bits


@settings(max_examples=25)
@given(words, st.integers(0, 20))
def test_many_bits_at_once_are_those_one_after_another(start, count):
    many, single = np.array([start], dtype=np.uint64), np.array([start], dtype=np.uint64)
    numbers = np.empty(count, np.uint64)
    draw_bits(many, numbers)
    assert [int(bits) for bits in numbers] == [int(next_bits(single)) for _ in range(count)]
    assert many[0] == single[0]


def test_the_published_first_numbers_come_out():
    state = np.array([1234567], dtype=np.uint64)
    published = 6457827717110365317, 3203168211198807973, 9817491932198370423
    assert tuple(int(next_bits(state)) for _ in published) == published


def test_numbers_are_uniform_on_the_unit_interval():
    state = random_stream(0, 0)
    numbers = np.array([uniform(state) for _ in range(20_000)])
    assert numbers.min() >= 0.0
    assert numbers.max() < 1.0
    assert kstest(numbers, "uniform").pvalue > 1e-3
    assert abs(np.corrcoef(numbers[:-1], numbers[1:])[0, 1]) < 4 / np.sqrt(len(numbers))


@settings(max_examples=25)
@given(words, st.integers(1, 2**31))
def test_halves_of_the_bits_are_integers_below_the_count(bits, count):
    upper, lower = upper_integer(np.uint64(bits), count), lower_integer(np.uint64(bits), count)
    assert upper == (bits >> 32) * count >> 32
    assert lower == (bits & 0xFFFFFFFF) * count >> 32
    assert min(upper, lower) >= 0
    assert max(upper, lower) < count
