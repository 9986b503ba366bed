"""Ranks for any number of objectives, and choice by distance, compared with moocore and NumPy."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from moocore import pareto_rank

from paretoik.search.maximin_kernels import rank_points, select_by_distance

shapes = st.tuples(st.integers(2, 4), st.integers(2, 30), st.integers(0, 10_000))


def points(shape):
    """Return objectives (objectives, points) with ties and one failed point, and their ranks."""
    objectives, count, seed = shape
    F = np.round(np.random.default_rng(seed).uniform(size=(objectives, count)), 2)
    F[:, 0] = np.inf
    rank = np.empty(count, dtype=int)
    rank_points(F, rank, np.empty(count, dtype=int))
    return F, rank


@settings(max_examples=25)
@given(shapes)
def test_ranks_are_those_of_moocore_and_the_failed_are_beyond_all(shape):
    F, rank = points(shape)
    assert rank[0] == F.shape[1]
    np.testing.assert_array_equal(rank[1:], pareto_rank(F[:, 1:].T))


@settings(max_examples=25)
@given(shapes, st.floats(0.1, 1.0))
def test_whole_ranks_are_chosen_and_then_always_the_farthest(shape, share):
    F, rank = points(shape)
    objectives, count = F.shape
    places = max(1, int(share * (count - 1)))
    chosen, distance = np.empty(count, dtype=int), np.empty(count)
    members, begins, Z = np.empty(count, dtype=int), np.empty(count + 2, dtype=int), np.empty((2, objectives, count))
    work = Z[0], np.empty(count), members, begins, Z[1]
    size = select_by_distance(F, rank, places, chosen, distance, *work)
    chosen = chosen[:size]
    assert size == places
    assert len(set(chosen)) == size
    assert (np.diff(rank[chosen]) >= 0).all()
    assert rank[chosen].max() < count
    np.testing.assert_array_equal(np.sort(rank[chosen]), np.sort(rank[1:])[:size])
    first = F[:, rank == 0]
    width = np.ptp(first, axis=1, keepdims=True)
    scaled = (np.where(np.isfinite(F), F, 0.0) - first.min(axis=1, keepdims=True)) / np.where(width > 0, width, np.inf)
    for k in range(1, size):
        if not np.isfinite(distance[k]):
            continue  # the ends along the axes come first

        def squared_to_chosen(i, k=k):
            return ((scaled[:, chosen[:k]] - scaled[:, [i]]) ** 2).sum(axis=0).min()

        assert np.isclose(distance[k], squared_to_chosen(chosen[k]), rtol=1e-9, atol=1e-12)
        others = np.setdiff1d(np.flatnonzero(rank == rank[chosen[k]]), chosen[:k])
        assert distance[k] >= max(squared_to_chosen(i) for i in others) - 1e-12
