"""MaxiMin selection: laws, brute force, and bad points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from moocore import pareto_rank
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize

from paretoik.errors import InvalidInput
from paretoik.search.maximin import (
    MaxiMin,
    front_order,
    greedy_order,
    nearest_squared,
    scaled,
    starting_points,
    survivors,
)
from tests.search.problems import Parabolas


def brute_force(Z, count, nearest, starts):
    """Return the selection by definition: the farthest from all selected, the first of equals."""
    order, distance = [], []
    for step in range(count):
        best, chosen = -1.0, -1
        for one in range(len(Z)):
            if one in order:
                continue
            value = nearest[one]
            for other in order:
                squares = [(a - b) ** 2 for a, b in zip(Z[one], Z[other], strict=True)]
                total = squares[0]
                for square in squares[1:]:
                    total += square
                value = min(value, total)
            if value > best:
                best, chosen = value, one
        if step < len(starts):
            best, chosen = np.inf, starts[step]
        order.append(chosen)
        distance.append(best)
    return np.array(order, dtype=int), np.array(distance)


def objectives(n_obj, max_points=14):
    ties = st.integers(0, 6).map(float)
    smooth = st.floats(-1e3, 1e3, width=32)
    return st.one_of(ties, smooth).flatmap(
        lambda _: st.sampled_from([ties, smooth]).flatmap(
            lambda values: hnp.arrays(float, st.tuples(st.integers(1, max_points), st.just(n_obj)), elements=values)
        )
    )


def one_rank(F, data):
    """Return a normalised rank of F and the points selected before it."""
    ranks = pareto_rank(F)
    rank = data.draw(st.integers(0, int(ranks.max())))
    first = F[ranks == 0]
    Z = scaled(F, first.min(axis=0), first.max(axis=0))
    nearest = nearest_squared(Z[ranks == rank], Z[ranks < rank])
    Z = Z[ranks == rank]
    starts = starting_points(Z) if rank == 0 else []
    count = data.draw(st.integers(1, len(Z)))
    return Z, count, nearest, starts[:count]


@settings(max_examples=50, deadline=None)
@given(objectives(2), st.data())
def test_the_fast_two_objective_selection_equals_brute_force_bit_for_bit(F, data):
    problem = one_rank(F, data)
    for actual, expected in zip(front_order(*problem), brute_force(*problem), strict=True):
        assert np.array_equal(actual, expected)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 4).flatmap(objectives), st.data())
def test_the_greedy_selection_equals_brute_force_bit_for_bit(F, data):
    problem = one_rank(F, data)
    for actual, expected in zip(greedy_order(*problem), brute_force(*problem), strict=True):
        assert np.array_equal(actual, expected)


@pytest.mark.parametrize("tail", [0.0, 1.0])
@pytest.mark.parametrize("count", [2, 150, 300])
def test_fast_and_greedy_selection_agree_on_large_fronts_and_geometric_tails(count, tail):
    rng = np.random.default_rng(3)
    x = 2.0 ** -rng.permutation(300) if tail else np.round(rng.random(300), 2)
    Z = np.column_stack((x, 1.0 - x))
    nearest = np.full(300, np.inf)
    starts = starting_points(Z)[:count]
    for actual, expected in zip(
        front_order(Z, count, nearest, starts), greedy_order(Z, count, nearest, starts), strict=True
    ):
        assert np.array_equal(actual, expected)


@settings(max_examples=40, deadline=None)
@given(objectives(2, max_points=20), st.data())
def test_survivors_are_those_of_the_rule_across_fronts(F, data):
    # Whole ranks while they fit; then the point farthest from all selected ones, including better ranks.
    count = data.draw(st.integers(1, len(F)))
    ranks, places = pareto_rank(F), np.arange(len(F))
    first = F[ranks == 0]
    Z = scaled(F, first.min(axis=0), first.max(axis=0))
    last = np.sort(ranks)[count - 1]
    chosen = places[ranks < last].tolist()
    splitting = places[ranks == last]
    starts = [int(splitting[one]) for one in starting_points(Z[splitting])] if last == 0 else []
    while len(chosen) < count:
        left = [one for one in splitting if one not in chosen]
        gaps = [min(((Z[one] - Z[other]) ** 2).sum() for other in chosen) if chosen else np.inf for one in left]
        chosen.append(starts[len(chosen)] if len(chosen) < len(starts) else left[int(np.argmax(gaps))])
    assert set(survivors(F, np.zeros(len(F)), count).index.tolist()) == set(chosen)


@settings(max_examples=25, deadline=None)
@given(objectives(2), st.integers(1, 20), st.integers(-20, 20))
def test_selection_does_not_depend_on_units(F, scale, shift):
    F = np.round(F)
    count = max(1, len(F) // 2)
    selection = survivors(F, np.zeros(len(F)), count)
    other = survivors((F + shift) * 2.0**scale, np.zeros(len(F)), count)  # integers and powers of two keep every bit
    assert np.array_equal(selection.index, other.index)
    assert np.array_equal(selection.distance, other.distance)


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 4).flatmap(objectives), st.data())
def test_spacing_is_the_sum_of_distances_to_the_nearest_survivors_of_the_same_rank(F, data):
    selection = survivors(F, np.zeros(len(F)), data.draw(st.integers(1, len(F))))
    Z, first = F[selection.index], F[pareto_rank(F) == 0]
    width = np.ptp(first, axis=0)
    Z = np.where(width > np.finfo(float).tiny, (Z - first.min(axis=0)) / np.where(width > 0, width, 1.0), 0.0)
    n_obj = F.shape[1]
    for place, rank in enumerate(selection.rank):
        members = np.flatnonzero(selection.rank == rank)
        gaps = sorted(np.sqrt(((Z[place] - Z[each]) ** 2).sum()) for each in members if each != place)
        is_best = any(members[Z[members, axis].argmin()] == place for axis in range(n_obj))
        expected = np.inf if is_best or len(gaps) < n_obj else sum(gaps[:n_obj])
        assert selection.spacing[place] == pytest.approx(expected, rel=1e-12)


def test_spacing_does_not_depend_on_the_order_in_which_an_even_front_was_inserted():
    x = np.linspace(0.0, 1.0, 9)
    selection = survivors(np.column_stack((x, 1.0 - x)), np.zeros(9), 9)
    assert len(set(selection.distance[2:].round(9))) > 1
    np.testing.assert_allclose(selection.spacing[2:], np.hypot(1, 1) / 4)


def test_three_objectives_start_from_the_corners_and_not_from_their_neighbours():
    corners = np.eye(3)
    near = np.array([[0.999, 0.02, 0.0], [0.0, 0.999, 0.02], [0.02, 0.0, 0.999]])
    selection = survivors(np.concatenate((near, corners)), np.zeros(6), 3)
    assert sorted(selection.index.tolist()) == [3, 4, 5]


def test_a_box_of_interest_keeps_the_population_out_of_a_steep_tail():
    x = np.concatenate((np.geomspace(1e-4, 0.1, 100), np.linspace(0.1, 1, 100)[1:]))
    F = np.column_stack((x, 1 / x))
    box = np.array([[0.0, 0.0], [1.0, 10.0]])
    free = survivors(F, np.zeros(len(F)), 50)
    boxed = survivors(F, np.zeros(len(F)), 50, ranges=box)
    assert (F[boxed.index, 1] <= 10.0).all()
    assert (F[free.index, 1] <= 10.0).sum() < 30
    everyone = survivors(F, np.zeros(len(F)), 150, ranges=box)
    assert len(np.unique(everyone.index)) == 150


def test_points_that_are_not_finite_come_last_and_do_not_touch_the_ranges():
    x = np.linspace(0, 1, 12)
    F = np.column_stack((x, 1 - x))
    bad = np.array([[np.nan, 0.0], [-np.inf, 0.0], [np.inf, np.inf]])
    violation = np.concatenate(([np.inf], np.zeros(6), [np.inf], np.zeros(6), [np.inf]))
    mixed = np.concatenate((bad[:1], F[:6], bad[1:2], F[6:], bad[2:]))
    selection = survivors(mixed, violation, 14)
    assert np.isfinite(mixed[selection.index[:12]]).all()
    alone = survivors(F, np.zeros(12), 12)
    assert np.array_equal(mixed[selection.index[:12]], F[alone.index])
    assert np.array_equal(selection.distance[:12], alone.distance)


def test_a_share_of_infeasible_points_that_no_feasible_one_dominates_may_stay():
    x = np.linspace(0, 1, 20)
    feasible = np.column_stack((x, 1 - x))
    beyond = np.array([[0.2, 0.2], [0.9, 0.9], [0.1, 0.1]])
    F = np.concatenate((feasible, beyond))
    violation = np.concatenate((np.zeros(20), [0.2, 0.1, 0.3]))
    assert survivors(F, violation, 20).index.max() < 20
    selection = survivors(F, violation, 20, infeasible_share=0.1)
    assert selection.index[-2:].tolist() == [20, 22]
    assert (selection.rank[-2:] > 0).all()


def test_each_live_species_keeps_its_best_within_half_of_the_places():
    x = np.linspace(0, 1, 60)
    front = np.column_stack((x, 1 - x))
    F = np.concatenate((front, front[:9] + 5.0, front[:3] + 9.0))
    species = np.concatenate((np.zeros(60, int), np.repeat([1, 2, 3], 3), np.full(3, 4)))
    violation = np.zeros(len(F))
    violation[-3:] = 1.0  # species 4 has no feasible member: not live
    selection = survivors(F, violation, 50, species=species)
    assert len(np.unique(selection.index)) == 50
    assert np.bincount(species[selection.index], minlength=5).tolist() == [41, 3, 3, 3, 0]
    crowded = survivors(F[:60], np.zeros(60), 20, species=np.arange(60) % 30)
    assert len(np.unique(crowded.index)) == 20


def test_maximin_is_a_survival_for_pymoos_own_algorithms():
    problem = Parabolas()
    spread = minimize(problem, NSGA2(pop_size=40, survival=MaxiMin()), ("n_gen", 30), seed=1).F
    crowded = minimize(problem, NSGA2(pop_size=40), ("n_gen", 30), seed=1).F

    def unevenness(F):
        gaps = np.linalg.norm(np.diff(F[np.argsort(F[:, 0])], axis=0), axis=1)
        return gaps.std() / gaps.mean()

    assert len(spread) == 40
    assert unevenness(spread) < 0.7 * unevenness(crowded)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"infeasible_share": 1.0}, "infeasible_share must be .* got 1.0"),
        ({"ranges": [[0, 2], [1, 1]]}, "ranges must be .*lower <= upper"),
    ],
)
def test_settings_that_cannot_be_used_are_refused_by_name_and_value(settings, message):
    with pytest.raises(InvalidInput, match=message):
        MaxiMin(**settings)
