from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog, nnls

from paretoik.front.front import Front
from paretoik.front.geometry import PREFERENCE_OPTIONS as OPTIONS
from paretoik.front.geometry import _unmatched_by_mixtures
from tests.front.random_fronts import random_front


@pytest.mark.parametrize("seed", range(40))
def test_points_that_some_weights_choose_are_reached_and_no_weights_reach_the_others(seed):
    front = random_front(seed, points=40)
    reached, Z = front.supported, front.shares
    size = Z.shape[1]
    weights = np.random.default_rng(seed).dirichlet(np.full(size, 0.5), 2000)
    sums = Z @ weights.T
    assert reached[(sums <= sums.min(axis=0) + 1e-12).any(axis=1)].all()
    for row in np.flatnonzero(~reached):  # the least that other points, mixed, are better by in every objective
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


@pytest.mark.parametrize("seed", range(100))
def test_of_two_objectives_the_hull_says_what_mixtures_of_points_do(seed):
    front = random_front(seed, n_obj=2, points=1 + seed)
    assert np.array_equal(front.supported, _unmatched_by_mixtures(front.shares))


def test_the_hull_is_computed_once_a_front():
    angles = np.linspace(0.0, np.pi / 2, 5000)
    front = Front(
        ids=np.arange(len(angles)),
        objectives=1 - np.stack([np.sin(angles), np.cos(angles)], axis=1),
        names=["a", "b"],
        units=["", ""],
        maximised=[False] * 2,
    )
    assert front.supported.all()
    assert front.supported is front.supported


@pytest.mark.parametrize("n_obj", [3, 5])
def test_mixtures_of_near_points_decide_as_mixtures_of_all(n_obj):
    rng = np.random.default_rng(n_obj)
    directions = np.abs(rng.normal(size=(120, n_obj))) ** 2
    shares = directions / np.linalg.norm(directions, axis=1)[:, None] ** 0.7
    matrix = np.block([[shares.T, np.eye(n_obj)], [np.ones(120), np.zeros(n_obj)]])
    residuals = [nnls(matrix, np.append(point - OPTIONS.hull, 1.0))[1] for point in shares]
    expected = np.array(residuals) > 0.1 * OPTIONS.hull
    assert 0 < expected.sum() < 120
    assert np.array_equal(_unmatched_by_mixtures(shares), expected)


def test_a_point_next_to_a_steep_or_a_flat_side_of_the_hull_is_reached():
    """It is within a millionth of the hull along one objective, and far above it along the other."""
    steep = np.array([[0.0, 1.0], [0.5 / 999 + 5e-7, 0.5], [1e-3, 1e-3], [1.0, 0.0]])
    for values in (steep, steep[:, ::-1]):
        front = Front(ids=np.arange(4), objectives=values, names=["a", "b"], units=["", ""], maximised=[False] * 2)
        assert front.supported.all()
