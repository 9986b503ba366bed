"""Refinement of points of small programs with known fronts."""

from __future__ import annotations

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from paretoik.pareto import refine as refinement
from paretoik.pareto.refine import suggest_points
from tests.pareto.sketches import ONES, certificates, ellipses, ellipses_best, placed, scaled, sketched


def refined(program, z, ranges, observe=None):
    """Return points refined one at a time, and which converged."""
    with patch.object(refinement, "OPTIONS", replace(refinement.OPTIONS, batch=1)):
        return refinement.refine(scaled(program, ranges), z, len(ranges), observe=observe)


def beside(count, seed):
    """Return points near the middle of the front of ``ellipses``."""
    away = 0.1 * np.random.default_rng(seed).normal(size=(count, 2))
    best = [ellipses_best(share) for share in np.linspace(0.5, 0.95, count)]
    return placed(ellipses, best + away)


def test_refining_leads_to_the_front_and_gains_in_everything():
    program, rng, ranges = sketched(2, ellipses), np.random.default_rng(0), np.array([2.0, 25.0])
    z = beside(8, seed=0)
    z[:, 2:] += ranges * rng.uniform(0.0, 0.02, (8, 2))
    refined_points, good = refined(program, z, ranges)
    assert good.all()
    assert (refined_points[:, 2:] <= z[:, 2:] + 1e-8).all()
    certified = certificates(program, refined_points, ranges)
    assert certified.criticality.max() <= 1e-6
    assert set(certified.status) == {"minimum"}
    shares = certified.weights / ranges
    shares = shares[:, 0] / shares.sum(axis=1)
    assert refined_points[:, :2] == pytest.approx(np.array([ellipses_best(share) for share in shares]), abs=1e-4)


def test_points_go_straight_ahead_as_far_as_that_goes():
    """Between bowls of one shape, gains over ranges are equal."""

    def bowls(x):
        return [x[0] ** 2 + x[1] ** 2, (x[0] - 1) ** 2 + x[1] ** 2]

    program, ranges = sketched(2, bowls), np.array([1.0, 2.0])
    z = placed(bowls, [[0.4, 0.5], [0.6, -0.3], [0.5, 0.2]])
    refined_points, good = refined(program, z, ranges)
    gains = (z[:, 2:] - refined_points[:, 2:]) / ranges
    assert good.all()
    assert gains[:, 0] == pytest.approx(gains[:, 1], abs=1e-6)
    assert gains.min() > 0.01


def test_points_that_a_solver_stops_short_of_are_led_on_to_critical_ones_no_worse():
    program, z = scaled(sketched(2, ellipses), (2.0, 25.0)), beside(6, seed=1)
    options, names = refinement.OPTIONS, ("straight", "below", "near", "cold")
    short = {name: getattr(options, name)._replace(iterations=7) for name in names}
    with patch.object(refinement, "OPTIONS", replace(options, **short)):
        refined_points, good = refinement.refine(program, z, 2)
        with patch.object(refinement, "can_follow", lambda program: False):
            _, solved = refinement.refine(program, z, 2)
    assert not solved.all()
    assert good.all()
    assert certificates(program, refined_points).criticality.max() <= 1e-8
    assert (refined_points[:, 2:] <= z[:, 2:] + 1e-8).all()


def test_later_points_stay_if_observe_returns_true():
    last, program, ranges, seen, points = 3, sketched(2, ellipses), np.array([2.0, 25.0]), [], []
    z = beside(8, seed=0)

    def observe(done, total, point):
        seen.append((done, total))
        points.append(point)
        return done == last

    refined_points, good = refined(program, z, ranges, observe)
    every, _ = refined(program, z, ranges)
    assert seen == [(done, 8) for done in range(1, last + 1)]
    assert np.array_equal(refined_points[:last], every[:last])
    assert np.array_equal(points, every[:last])
    assert np.array_equal(refined_points[last:], z[last:])
    assert good.tolist() == [True] * last + [False] * (8 - last)
    assert not (every == z).all(axis=1).any()


def test_point_that_cannot_be_refined_stays_and_is_reported():
    nowhere = sketched(2, ellipses, lambda x: ([], [x[0] - 2.0, 1.0 - x[0]]))
    z = placed(ellipses, [[1.5, 0.0]])
    refined_points, good = refined(nowhere, z, ONES)
    assert np.array_equal(refined_points, z)
    assert good.tolist() == [False]
    assert certificates(nowhere, z).violation == pytest.approx([0.5])


# Points that help a search: better than their starts, at its ends, in gaps and in every branch.


def program():
    """Squared distances to (0, 0) and (1, 0): the front is the line between them."""
    return sketched(2, lambda x: [x[0] ** 2 + x[1] ** 2, (x[0] - 1) ** 2 + x[1] ** 2])


def near_the_front(count, height=0.2):
    """Return points above the line, and their objectives."""
    places = np.stack([np.linspace(0.2, 0.8, count), np.full(count, height)], axis=1)
    F = np.stack([(places**2).sum(axis=1), ((places - [1, 0]) ** 2).sum(axis=1)], axis=1)
    return np.concatenate([places, F], axis=1), F


def test_points_come_nearer_to_the_front_and_its_ends_move_out():
    x, F = near_the_front(5)
    suggested, iterations = suggest_points(program(), x, F, ["one"] * 5)
    values = np.stack([(suggested[:, :2] ** 2).sum(axis=1), ((suggested[:, :2] - [1, 0]) ** 2).sum(axis=1)], axis=1)
    assert len(values) >= 3
    assert (values.min(axis=0) < 0.5 * F.min(axis=0)).all()
    assert np.abs(suggested[:, 1]).min() < 0.5 * 0.2
    assert 0 < iterations <= 5 * (len(suggested) + 1)


def test_every_branch_is_aimed_at():
    x, F = near_the_front(6)
    x[3:, 1] *= -1
    both, _ = suggest_points(program(), x, F, ["above" if y > 0 else "below" for y in x[:, 1]])
    alone, _ = suggest_points(program(), x, F, ["one"] * 6)
    assert len(both) == len(alone) + 1
