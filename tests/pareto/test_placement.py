"""Placement of points on two-objective fronts: brute force, and known fronts."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.front.geometry import tangents_meet
from paretoik.front.hypervolume import hypervolume
from paretoik.pareto.placement import (
    OPTIONS,
    POINT_TOLERANCE,
    _gaps,
    best_rows,
    fill_gaps,
    front_rows,
    gap_between,
    is_duplicate,
    next_targets,
    spread_rows,
)

seeds = st.integers(0, 10**6)


def volume(values):
    """Return the hypervolume up to the worst values."""
    return hypervolume(values, values.max(axis=0))


def staircase(rng, size):
    """Return non-dominated points sorted by the first objective."""
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


def bowls(share):
    """Return the front of (x², (1 − x)²) at shares of the way, and its weights there."""
    share = np.asarray(share, dtype=float)
    return np.stack([share**2, (1 - share) ** 2], axis=1), np.stack([1 - share, share], axis=1)


@given(first=st.floats(0.0, 0.9), width=st.floats(0.05, 0.1))
def test_front_of_bowls_is_its_parabola(first, width):
    values, weights = bowls([first, first + width])
    gap = gap_between(values, weights)
    assert not gap.contradicts
    assert not gap.is_concave
    assert np.sqrt(gap.places).sum(axis=1) == pytest.approx(1.0)
    fine = bowls(np.linspace(first, first + width, 4001))[0]
    assert gap.area == pytest.approx(volume(fine), rel=1e-3)


def test_across_a_jump_tangents_contradict_each_other():
    values, weights = np.array([[0.0, 1.0], [0.1, 0.4]]), np.array([[0.3, 0.7], [0.4, 0.6]])
    assert tangents_meet(*values, *weights) is None
    assert gap_between(values, weights).contradicts
    assert gap_between(values, np.full((2, 2), np.nan)).contradicts


@pytest.mark.parametrize("points", [5, 20])
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


# Non-dominated points, neighbours and gaps of a front, compared with brute force.


@given(seed=seeds, n_obj=st.integers(1, 4))
def test_front_has_no_point_that_another_equals_or_beats_everywhere(seed, n_obj):
    rng = np.random.default_rng(seed)
    shares = rng.integers(0, 6, (rng.integers(1, 25), n_obj)) / 6 + rng.uniform(-0.4, 0.4, (1, n_obj)) * POINT_TOLERANCE
    rows = front_rows(shares)
    best = [one for one in shares.tolist() if not any(_dominates(other, one) for other in shares.tolist())]
    assert sorted(map(tuple, shares[rows].tolist())) == sorted(set(map(tuple, best)))
    assert (np.diff(shares[rows, 0]) >= 0).all()


def _dominates(one, other):
    return all(a <= b for a, b in zip(one, other, strict=True)) and one != other


@given(seed=seeds)
def test_every_point_has_one_on_the_front_that_is_as_good_and_nothing_on_the_front_has_another(seed):
    rng = np.random.default_rng(seed)
    near = POINT_TOLERANCE * rng.choice([1.0, 100.0], (24, 1))
    shares = np.repeat(rng.uniform(size=(12, 2)), 2, axis=0) + rng.uniform(-1.0, 1.0, (24, 2)) * near
    front = shares[front_rows(shares)]
    for one in shares:
        assert any(np.all(other <= one + 2 * POINT_TOLERANCE) for other in front)
    for one, other in combinations(front, 2):
        assert not np.all(one <= other) or np.all(other <= one)
        assert np.abs(one - other).max() > POINT_TOLERANCE


@given(seed=seeds, n_obj=st.integers(2, 3), count=st.integers(3, 20))
def test_removed_points_are_nearer_to_kept_ones_than_those_to_each_other(seed, n_obj, count):
    rng = np.random.default_rng(seed)
    shares = rng.uniform(size=(rng.integers(1, 16), n_obj))
    rows = spread_rows(shares, count)
    assert len(rows) == min(count, len(shares))
    assert np.array_equal(rows, np.unique(rows))
    ends = set(shares.argmin(axis=0).tolist())
    assert ends <= set(rows.tolist())
    apart = np.linalg.norm(shares[:, None] - shares[None], axis=2)
    radius = apart[:, rows].min(axis=1).max()
    for i in set(rows.tolist()) - ends:
        assert min(apart[i, j] for j in rows if j != i) >= radius


@given(seed=seeds, n_obj=st.integers(2, 4))
def test_neighbours_have_no_point_in_the_ball_between_them_and_the_farthest_come_first(seed, n_obj):
    rng = np.random.default_rng(seed)
    values = rng.uniform(size=(rng.integers(1, 14), n_obj))
    values = np.concatenate([values, values[:2] + 1e-8])
    gaps, expected = _gaps(values), set()
    for i, j in combinations(range(len(values)), 2):
        middle, radius = (values[i] + values[j]) / 2, np.linalg.norm(values[i] - values[j]) / 2
        others = [np.linalg.norm(values[k] - middle) for k in range(len(values)) if k not in (i, j)]
        if radius > 5 * POINT_TOLERANCE and all(distance >= radius * (1 - 1e-12) for distance in others):
            expected.add((i, j))
    assert set(gaps) == expected
    lengths = [np.linalg.norm(values[i] - values[j]) for i, j in gaps]
    assert lengths == sorted(lengths, reverse=True)


@given(seed=seeds)
def test_duplicate_equals_a_point_in_every_objective(seed):
    rng = np.random.default_rng(seed)
    others = rng.uniform(size=(6, 3))
    which = rng.integers(6)
    assert is_duplicate(others[which] + rng.uniform(-9.9, 9.9, 3) * POINT_TOLERANCE, others)
    moved = others[which].copy()
    moved[rng.integers(3)] += 11 * POINT_TOLERANCE * rng.choice([-1.0, 1.0])
    assert not is_duplicate(moved, others)


class Filled:
    """A front y = shape(x) on the unit interval, its points so far, and the requests."""

    def __init__(self, shape, hidden=()):
        self.places = np.linspace(0.0, 1.0, 20001)
        visible = np.ones(len(self.places), dtype=bool)
        for low, high in hidden:
            visible &= (self.places <= low) | (self.places >= high)
        self.every = np.stack([self.places, shape(self.places)], axis=1)[visible]
        self.points, self.asked = self.every[[0, -1]], []

    def front(self):
        return self.points[np.argsort(self.points[:, 0])]

    def add(self, main, caps):
        assert np.isposinf(caps).tolist() == [main == k for k in range(2)]
        self.asked.append((main, *caps))
        below = self.every[(self.every <= caps).all(axis=1)]
        point = below[below[:, main].argmin()]
        if is_duplicate(point, self.points):
            return False
        self.points = np.concatenate([self.points, point[None]])
        return True


def bulge(x):
    return np.sqrt(1.0 - x * x)


def bent(x):
    return (1.0 - np.sqrt(x)) ** 2


@pytest.mark.parametrize("shape", [bulge, bent, lambda x: 1.0 - x], ids=["bulging", "bent in", "straight"])
@pytest.mark.parametrize("points", [3, 20])
def test_gaps_are_filled_up_to_the_asked_number_of_points(shape, points):
    filled = Filled(shape)
    fill_gaps(filled.front, filled.add, points)
    assert len(filled.points) == points
    assert len(filled.asked) == points - 2
    gaps = np.linalg.norm(np.diff(filled.front(), axis=0), axis=1)
    length = np.linalg.norm(np.diff(filled.every, axis=0), axis=1).sum()
    assert gaps.max() <= 2.6 * length / (points - 1)


def test_the_longer_side_of_the_widest_gap_is_cut_first():
    points = np.array([[0.0, 1.0, 0.0], [0.1, 0.6, 0.0], [1.0, 0.0, 0.0]])
    asked = []

    def add(main, caps):
        asked.append((main, caps.tolist()))
        return False

    fill_gaps(lambda: points, add, 9)
    assert [main for main, _ in asked] == [2, 1, 0, 2, 0, 1]
    assert asked[0][1] == pytest.approx([0.55, 0.3, np.inf])
    assert asked[3][1] == pytest.approx([0.05, 0.8, np.inf])
