"""Sorting, merging and ranking of two-objective points, compared with NumPy's sort and moocore's ranks."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from moocore import pareto_rank

from paretoik.closed_loop.programs import allocate
from paretoik.search.sorted_points import first_front, locate, merge_children, merge_sort, rank_sorted

seeds = st.integers(0, 10_000)
counts = st.integers(1, 60)


def objectives(seed, count, *, failed=0.0):
    """Return objectives (points, 2) with ties and copies, some of them failed."""
    rng = np.random.default_rng(seed)
    F = np.round(rng.uniform(size=(count, 2)), rng.integers(1, 4))
    F[rng.uniform(size=count) < failed] = np.inf
    return F


def in_order(F):
    return F[np.lexsort(F.T[::-1])]


@settings(max_examples=25)
@given(seed=seeds, count=counts)
def test_points_are_sorted_by_the_first_then_the_second_objective(seed, count):
    F = objectives(seed, count)
    points, values = np.arange(count), np.concatenate([F.T, np.empty((2, count))])
    merge_sort(points, values, 0, count, np.empty(count, dtype=int))
    np.testing.assert_array_equal(values[:2].T, in_order(F))
    np.testing.assert_array_equal(F[points], in_order(F))
    assert sorted(points) == list(range(count))


@settings(max_examples=25)
@given(seed=seeds, count=counts)
def test_ranks_are_those_of_moocore_and_failed_points_are_beyond_all(seed, count):
    F = in_order(objectives(seed, count, failed=0.1))
    rank = np.empty(count, dtype=int)
    rank_sorted(F.T.copy(), count, rank, np.empty((2, count)))
    finite = np.isfinite(F[:, 0])
    assert (rank[~finite] == count).all()
    if finite.any():
        np.testing.assert_array_equal(rank[finite], pareto_rank(F[finite]))


@settings(max_examples=25)
@given(seed=seeds, count=counts)
def test_the_first_front_is_what_nothing_dominates(seed, count):
    F = in_order(objectives(seed, count))
    front, values = np.empty(count + 1, dtype=int), np.empty((2, count + 1))
    size = first_front(np.arange(count), count, F.T.copy(), front, values)
    np.testing.assert_array_equal(front[:size], np.flatnonzero(pareto_rank(F) == 0))
    np.testing.assert_array_equal(values[:, :size].T, F[front[:size]])


@settings(max_examples=25)
@given(seed=seeds, count=st.integers(1, 30))
def test_children_are_merged_into_sorted_parents(seed, count):
    parents, children = in_order(objectives(seed, count)), objectives(seed + 1, count, failed=0.1)
    F = np.concatenate([parents, children])
    workspace = allocate(3, 1, count, 2, 1).selection
    locate(F.T.copy(), count, count, workspace.places, workspace.dominated)
    total = merge_children(F.T.copy(), count, count, False, workspace)
    assert total == 2 * count
    np.testing.assert_array_equal(workspace.values[:2, :total].T, in_order(F))
    np.testing.assert_array_equal(F[workspace.points[:total]], in_order(F))


@settings(max_examples=25)
@given(seed=seeds, count=st.integers(1, 30))
def test_of_a_single_rank_children_that_a_parent_weakly_dominates_are_left_out(seed, count):
    t = np.sort(np.random.default_rng(seed).choice(100, count, replace=False)) / 100
    parents, children = np.stack([t, 1 - t], axis=1), objectives(seed + 1, count, failed=0.1)
    F = np.concatenate([parents, children])
    workspace = allocate(3, 1, count, 2, 1).selection
    locate(F.T.copy(), count, count, workspace.places, workspace.dominated)
    total = merge_children(F.T.copy(), count, count, True, workspace)
    dominated = (parents[None] <= children[:, None]).all(axis=2).any(axis=1)
    expected = np.concatenate([np.arange(count), count + np.flatnonzero(~dominated & np.isfinite(children[:, 0]))])
    assert sorted(workspace.points[:total]) == expected.tolist()
