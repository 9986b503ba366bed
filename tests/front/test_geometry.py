"""Jumps and missing hypervolume of certified fronts, on known fronts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, nnls

from paretoik.front.front import Front
from paretoik.front.geometry import PREFERENCE_OPTIONS as OPTIONS
from paretoik.front.geometry import unmatched_by_mixtures
from tests.front.random_fronts import minima, random_front

seeds = st.integers(0, 10**6)
few = settings(max_examples=30)


@dataclass(frozen=True)
class Line:
    """A problem of one number x; between two points x is interpolated."""

    objectives: object  # of x (points,) to (points, 2), minimised
    x: np.ndarray

    def values_between(self, front, shares):
        x = self.x[front.ids]
        between = x[:-1, None] + shares * np.diff(x)[:, None]
        return self.objectives(between.ravel()).reshape(*between.shape, 2)


def certified(problem, *, scales=(1.0, 1.0), maximised=(False, False)):
    """Return the front of a problem's points, with exchange rates from its gradient, in other units and signs."""
    signs = np.where(maximised, -1.0, 1.0)
    factors = np.array(scales) * signs
    values = problem.objectives(problem.x)
    step = 1e-6
    slope = (problem.objectives(problem.x + step) - problem.objectives(problem.x - step)) / (2 * step)
    with np.errstate(divide="ignore"):
        rate = slope[:, 1] / slope[:, 0] * factors[1] / factors[0]
    weights = np.abs(slope[:, ::-1]) / np.abs(slope).sum(axis=1, keepdims=True)
    rates = np.ones((len(values), 2, 2))
    rates[:, 0, 1], rates[:, 1, 0] = rate, 1 / rate
    bound = SimpleNamespace(
        values_between=lambda front, shares: problem.values_between(front, shares) * np.array(scales)
    )
    return Front(
        ids=np.arange(len(values)),
        objectives=values * factors,
        names=["one", "other"],
        units=["", ""],
        maximised=maximised,
        certificates=minima(weights, rates),
        problem=bound,
    )


def bowls(x):
    """Return objectives whose front has one convex piece, for x between 0 and 1."""
    return np.stack([x**2, (1 - x) ** 2], axis=1)


def valleys(x):
    """Return objectives with two branches: x up to 0.4, and x from 3.5 to 4."""
    far = 3.5 + 0.5 * (x - 3.5)
    second = np.where(x < 2, (1 - x) ** 2, (0.9 - (far - 3.0)) ** 2)
    return np.stack([np.where(x < 2, x**2, (far - 3.0) ** 2), second], axis=1) + np.exp(-((x - 2) ** 2) * 8)[:, None]


def one_valley(rng, points):
    return Line(bowls, np.sort(rng.uniform(0.01, 0.99, points)))


def two_valleys(rng, points):
    left, right = np.sort(rng.uniform(0.01, 0.4, points)), np.sort(rng.uniform(3.5, 4.2, points))
    return Line(valleys, np.concatenate([left, right]))


@few
@given(seed=seeds, points=st.integers(1, 12))
def test_a_convex_front_of_one_branch_has_no_jumps(seed, points):
    assert certified(one_valley(np.random.default_rng(seed), points)).jumps == ()


@few
@given(seed=seeds, points=st.integers(2, 8))
def test_a_front_of_two_branches_jumps_once_from_the_last_point_of_one_to_the_first_of_the_other(seed, points):
    assert certified(two_valleys(np.random.default_rng(seed), points)).jumps == ((points - 1, points),)


@few
@given(
    seed=seeds,
    scales=st.tuples(*[st.floats(1e-6, 1e6)] * 2),
    maximised=st.tuples(st.booleans(), st.booleans()),
    make=st.sampled_from([one_valley, two_valleys]),
)
def test_neither_units_nor_signs_change_jumps_and_missing_hypervolume(seed, scales, maximised, make):
    problem = make(np.random.default_rng(seed), 6)
    front, other = certified(problem), certified(problem, scales=scales, maximised=maximised)
    assert {frozenset(pair) for pair in other.jumps} == {frozenset(pair) for pair in front.jumps}
    assert other.missing_hypervolume == pytest.approx(front.missing_hypervolume, rel=1e-6)


@few
@given(seed=seeds, points=st.integers(2, 30))
def test_the_missing_hypervolume_of_bowls_is_that_between_the_points(seed, points):
    x = np.linspace(0.05, 0.95, points) + np.random.default_rng(seed).uniform(-0.04, 0.04, points) / points
    values, fine = bowls(x), bowls(np.linspace(x[0], x[-1], 20_001))

    def volume(points):
        return np.sum((points[-1, 0] - points[1:, 0]) * (points[:-1, 1] - points[1:, 1]))

    assert certified(Line(bowls, x)).missing_hypervolume == pytest.approx(1 - volume(values) / volume(fine), abs=1e-3)


def test_an_end_with_all_the_weight_on_one_objective_has_a_tangent_without_an_exchange_rate():
    front = certified(Line(bowls, np.linspace(0.0, 1.0, 5)))
    rates = front.certificates.exchange_rates.copy()
    rates[[0, -1], 0, 1] = np.nan
    weak = replace(front, certificates=replace(front.certificates, exchange_rates=rates))
    near = certified(Line(bowls, np.linspace(1e-5, 1 - 1e-5, 5)))
    assert weak.missing_hypervolume == pytest.approx(near.missing_hypervolume, rel=1e-3)


def test_jumps_and_missing_hypervolume_are_none_without_order_certificates_or_interpolation():
    front = certified(one_valley(np.random.default_rng(0), 5))
    unrefined = replace(front, certificates=None)
    assert (unrefined.jumps, unrefined.missing_hypervolume) == (None, None)
    assert replace(front, problem=None).jumps is None
    assert replace(front, problem=None).missing_hypervolume > 0
    single = certified(one_valley(np.random.default_rng(0), 1))
    assert (single.jumps, single.missing_hypervolume) == ((), None)
    three = Front(
        ids=np.arange(2), objectives=np.array([[0.0, 1.0, 1.0], [1.0, 0.0, 0.0]]), names=list("abc"), units=[""] * 3,
        maximised=[False] * 3, problem=front.problem,
    )  # fmt: skip
    assert (three.jumps, three.missing_hypervolume) == (None, None)


@pytest.mark.parametrize("seed", range(8))
def test_points_that_some_weights_choose_are_reached_and_no_weights_reach_the_others(seed):
    front = random_front(seed, points=40)
    reached, Z = front.supported, front.shares
    size = Z.shape[1]
    weights = np.random.default_rng(seed).dirichlet(np.full(size, 0.5), 2000)
    sums = Z @ weights.T
    assert reached[(sums <= sums.min(axis=0) + 1e-12).any(axis=1)].all()
    for row in np.flatnonzero(~reached):  # the least gain of a mixture of other points in every objective
        mixture = linprog(
            c=np.append(np.zeros(len(Z)), -1.0),
            A_ub=np.column_stack([Z.T, np.ones(size)]),
            b_ub=Z[row],
            A_eq=np.append(np.ones(len(Z)), 0.0)[None],
            b_eq=[1.0],
            bounds=[(0, None)] * len(Z) + [(None, None)],
        )
        assert -mixture.fun > 0.9e-6


def test_a_straight_and_a_bulging_front_are_reached_and_a_hollow_one_at_its_ends():
    angles = np.linspace(0.0, np.pi / 2, 9)
    for values, expected in (
        (np.stack([angles, angles[::-1]], axis=1), range(9)),
        (1 - np.stack([np.sin(angles), np.cos(angles)], axis=1), range(9)),
        (np.stack([np.sin(angles), np.cos(angles)], axis=1), (0, 8)),
    ):
        front = Front(ids=np.arange(9), objectives=values, names=["a", "b"], units=["", ""], maximised=[False] * 2)
        assert np.flatnonzero(front.supported).tolist() == sorted(expected)


@pytest.mark.parametrize("seed", range(3, 100, 12))
def test_the_hull_agrees_with_mixtures_of_points_for_two_objectives(seed):
    front = random_front(seed, n_obj=2, points=1 + seed)
    assert np.array_equal(front.supported, unmatched_by_mixtures(front.shares))


@pytest.mark.parametrize("n_obj", [3, 5])
def test_mixtures_of_near_points_decide_like_mixtures_of_all_points(n_obj):
    rng = np.random.default_rng(n_obj)
    directions = np.abs(rng.normal(size=(120, n_obj))) ** 2
    shares = directions / np.linalg.norm(directions, axis=1)[:, None] ** 0.7
    matrix = np.block([[shares.T, np.eye(n_obj)], [np.ones(120), np.zeros(n_obj)]])
    residuals = [nnls(matrix, np.append(point - OPTIONS.hull, 1.0))[1] for point in shares]
    expected = np.array(residuals) > 0.1 * OPTIONS.hull
    assert 0 < expected.sum() < 120
    assert np.array_equal(unmatched_by_mixtures(shares), expected)


def test_a_point_next_to_a_steep_or_a_flat_side_of_the_hull_is_reached():
    """It is within a millionth of the hull along one objective, and far above it along the other."""
    steep = np.array([[0.0, 1.0], [0.5 / 999 + 5e-7, 0.5], [1e-3, 1e-3], [1.0, 0.0]])
    for values in (steep, steep[:, ::-1]):
        front = Front(ids=np.arange(4), objectives=values, names=["a", "b"], units=["", ""], maximised=[False] * 2)
        assert front.supported.all()
