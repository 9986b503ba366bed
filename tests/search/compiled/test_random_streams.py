"""Random numbers by streams, beside SplitMix64 in Python's integers."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2, kstest

from paretoik.search.offspring import draw_bits, lower_integer, next_bits, seed_stream, uniform, upper_integer

MASK = (1 << 64) - 1
words = st.integers(0, MASK)


def split_mix(state):
    """The next state and output as Steele, Lea & Flood print them."""
    state = (state + 0x9E3779B97F4A7C15) & MASK
    z = state
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
    return state, z ^ (z >> 31)


def stream(seed, step):
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


@settings(max_examples=25)
@given(st.integers(0, 2**31), st.integers(0, 2**31))
def test_streams_of_other_seeds_and_steps_begin_elsewhere(seed, step):
    beginnings = {int(stream(*key)[0]) for key in ((seed, step), (seed + 1, step), (seed, step + 1))}
    assert len(beginnings) == 3
    assert int(stream(seed, step)[0]) in beginnings


def test_numbers_are_uniform_on_the_unit_interval():
    state = stream(0, 0)
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


def test_integers_come_equally_often():
    state, count, draws = stream(3, 1), 7, 14_000
    for take in (upper_integer, lower_integer):
        seen = np.bincount([take(np.uint64(next_bits(state)), count) for _ in range(draws)], minlength=count)
        assert ((seen - draws / count) ** 2).sum() / (draws / count) < chi2(count - 1).ppf(0.999)
