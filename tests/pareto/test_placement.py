"""Where points of a front of two objectives go: beside brute force, and on fronts that are known."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.front.geometry import tangents_meet
from paretoik.front.indicators import hypervolume
from paretoik.pareto.placement import OPTIONS, BestSubsets, best_rows, gap_between, next_targets

seeds = st.integers(0, 10**6)


def volume(values):
    """Hypervolume up to the worst values."""
    return hypervolume(values, values.max(axis=0))


def staircase(rng, size):
    """Points none of which dominates another, by the first objective."""
    first, second = np.sort(rng.uniform(size=(2, size)), axis=1)
    return np.stack([first, second[::-1]], axis=1)


@given(seed=seeds, size=st.integers(2, 9), count=st.integers(2, 6))
def test_the_subset_of_most_hypervolume_is_that_of_brute_force(seed, size, count):
    values = staircase(np.random.default_rng(seed), size)
    inner = [(0, *chosen, size - 1) for chosen in combinations(range(1, size - 1), min(count, size) - 2)]
    best = max(volume(values[list(rows)]) for rows in inner)
    rows = best_rows(values, count)
    assert len(rows) == min(count, size)
    assert volume(values[rows]) == pytest.approx(best)


@given(seed=seeds, size=st.integers(3, 9))
def test_the_volume_of_every_subset_is_its_hypervolume_up_to_the_worst_values(seed, size):
    values = staircase(np.random.default_rng(seed), size)
    subsets = BestSubsets(values)
    for count in (size, 2, size - 1):  # in any order
        assert subsets.volume(count) == pytest.approx(volume(values[subsets.rows(count)]))


def bowls(share):
    """The front of (x², (1 − x)²) at shares of the way, and its weights there."""
    share = np.asarray(share, dtype=float)
    return np.stack([share**2, (1 - share) ** 2], axis=1), np.stack([1 - share, share], axis=1)


@given(first=st.floats(0.0, 0.9), width=st.floats(0.05, 0.1))
def test_of_bowls_the_parabola_is_the_front_itself(first, width):
    values, weights = bowls([first, first + width])
    gap = gap_between(values, weights)
    assert not gap.contradicts
    assert not gap.is_concave
    assert np.sqrt(gap.places).sum(axis=1) == pytest.approx(1.0)
    fine = bowls(np.linspace(first, first + width, 4001))[0]
    assert gap.area == pytest.approx(volume(fine), rel=1e-3)


def test_tangents_of_a_front_that_bulges_out_meet_too():
    angle = np.array([0.3, 0.9])
    values = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    gap = gap_between(values, values)
    assert gap.is_concave
    assert not gap.contradicts
    assert np.linalg.norm(gap.places, axis=1) == pytest.approx(1.0, abs=0.01)


def test_across_a_jump_tangents_contradict_each_other():
    values, weights = np.array([[0.0, 1.0], [0.1, 0.4]]), np.array([[0.3, 0.7], [0.4, 0.6]])
    assert tangents_meet(*values, *weights) is None
    assert gap_between(values, weights).contradicts
    assert gap_between(values, np.full((2, 2), np.nan)).contradicts


@pytest.mark.parametrize("points", [5, 10, 20])
def test_points_placed_have_nearly_the_most_hypervolume_there_is_and_more_than_even_ones(points):
    shares = [0.0, 1.0]
    for _ in range(2 * points):
        values, weights = bowls(sorted(shares))
        gaps = [gap_between(values[i : i + 2], weights[i : i + 2]) for i in range(len(values) - 1)]
        targets = next_targets(gaps, values, points)
        if not targets:
            break
        shares += [float(np.sqrt(target.values[0])) for target in targets]
    values = bowls(sorted(shares))[0]
    fine = bowls(np.linspace(0.0, 1.0, 401))[0]
    best, even = volume(fine[best_rows(fine, points)]), np.linspace(0.0, 1.0, points)
    uniform = volume(np.stack([(1 - np.sqrt(1 - even)) ** 2, 1 - even], axis=1))
    placed = volume(values[best_rows(values, points)])
    assert len(values) <= 2 * points
    assert placed >= uniform
    assert placed >= best - 3 * OPTIONS.gain * sum(gap.area for gap in gaps)


def test_with_as_many_points_as_wanted_that_none_would_better_there_is_no_target():
    fine, weights = bowls(np.linspace(0.0, 1.0, 401))
    rows = best_rows(fine, 6)
    gaps = [gap_between(fine[[i, j]], weights[[i, j]]) for i, j in pairwise(rows)]
    assert next_targets(gaps, fine[rows], 6) == []
    assert next_targets(gaps, fine[rows], 7)
    assert next_targets([], fine[rows], 7) == []
