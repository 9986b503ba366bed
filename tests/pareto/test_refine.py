"""Polishing and certifying points of small smooth programs whose minima, saddles and slopes are known."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.pareto.refine import certified, polished
from tests.pareto.sketches import sketched

ONES = np.ones(2)


def placed(values, x):
    x = np.atleast_2d(np.asarray(x, dtype=float))
    return np.array([[*one, *values(one)] for one in x])


def certificates(sketch, z, ranges=ONES, signs=ONES):
    return certified(sketch, z, np.asarray(ranges, dtype=float), np.asarray(signs, dtype=float), np.zeros(len(z)))


def ellipses(x):
    """Two bowls about (0, 0) and (1, 0.5), of other shapes and sizes."""
    return [x[0] ** 2 + 3 * x[1] ** 2, 10 * (2 * (x[0] - 1) ** 2 + (x[1] - 0.5) ** 2)]


def ellipses_best(share):
    """Where share · the first + (1 − share) · the second is least."""
    one, other = 2 * share * np.diag([1.0, 3.0]), 20 * (1 - share) * np.diag([2.0, 1.0])
    return np.linalg.solve(one + other, other @ [1.0, 0.5])


def saddle(x):
    """Along the last coordinate there is something better on either side, in both objectives."""
    bent = x[1] ** 4 - x[1] ** 2
    return [x[0] ** 2 + bent, (x[0] - 1) ** 2 + bent]


SHARES = np.array([0.2, 0.5, 0.8, 0.9])


def beside(count, seed):
    """Points near the middle of the front of ``ellipses``."""
    away = 0.1 * np.random.default_rng(seed).normal(size=(count, 2))
    best = [ellipses_best(share) for share in np.linspace(0.5, 0.95, count)]
    return placed(ellipses, best + away)


def test_minima_are_called_minima_with_the_weights_that_made_them():
    sketch, ranges = sketched(2, ellipses), np.array([2.0, 25.0])
    known = certificates(sketch, placed(ellipses, [ellipses_best(share) for share in SHARES]), ranges)
    assert known.status.tolist() == ["minimum"] * 4
    assert known.kkt_residual.max() <= 1e-9
    assert known.violation.max() <= 1e-12
    weights = np.stack([SHARES, 1 - SHARES], axis=1) * ranges
    assert known.weights == pytest.approx(weights / weights.sum(axis=1, keepdims=True), rel=1e-6)


@pytest.mark.parametrize("signs", [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
def test_exchange_rates_are_the_slopes_of_the_front_and_what_is_maximised_has_its_own_sign(signs):
    sketch, step = sketched(2, ellipses), 1e-4
    known = certificates(sketch, placed(ellipses, [ellipses_best(s) for s in SHARES]), (2.0, 25.0), signs)
    beside = np.array([[ellipses(ellipses_best(s + sign * step)) for sign in (-1, 1)] for s in SHARES])
    change = np.diff(beside * signs, axis=1)[:, 0]
    assert known.exchange_rates[:, 0, 1] == pytest.approx(change[:, 1] / change[:, 0], rel=1e-5)
    assert known.exchange_rates[:, 1, 0] == pytest.approx(change[:, 0] / change[:, 1], rel=1e-5)
    assert known.exchange_intervals[:, 0, 1] == pytest.approx(
        np.repeat(known.exchange_rates[:, 0, 1, None], 2, axis=1), rel=1e-4
    )


def test_at_a_corner_of_the_front_the_exchange_lies_between_the_slopes_of_both_sides():
    """On x + y ≥ 1 and 3 x + y ≥ 1.5 from (0.25, 0.75): y falls by 1 for x to one side, by 3 to the other."""
    sketch = sketched(2, lambda x: [x[0], x[1]], lambda x: ([], [x[0] + x[1] - 1.0, 3 * x[0] + x[1] - 1.5]))
    known = certificates(sketch, np.array([[0.25, 0.75, 0.25, 0.75]]))
    assert known.status[0] == "minimum"
    assert np.sort(known.exchange_intervals[0, 0, 1]) == pytest.approx([-3.0, -1.0], abs=1e-5)
    assert np.sort(known.exchange_intervals[0, 1, 0]) == pytest.approx([-1.0, -1 / 3], abs=1e-5)


@pytest.mark.parametrize("place", [0.2, 0.5, 0.7])
def test_a_saddle_is_called_one_and_the_valleys_beside_it_minima(place):
    sketch = sketched(2, saddle)
    root = np.sqrt(0.5)
    known = certificates(sketch, placed(saddle, [[place, 0.0], [place, root], [place, -root]]))
    assert known.kkt_residual.max() <= 1e-6
    assert known.status.tolist() == ["saddle", "minimum", "minimum"]
    assert known.weights == pytest.approx(np.tile([1 - place, place], (3, 1)), abs=1e-6)


@pytest.mark.parametrize("low", [0.0, -1e-3])
def test_what_limits_keep_from_going_down_is_a_minimum_unless_there_is_another_side(low):
    """At the saddle the last coordinate may only rise, or not even that."""
    within = sketched(2, saddle, lambda x: ([], [x[1] - low, -x[1] - low]))
    z = placed(saddle, [[0.5, 0.0]])
    known = certificates(within, z)
    assert known.status[0] == ("minimum" if low == 0.0 else "saddle")
    one_sided = sketched(2, saddle, lambda x: ([], [x[1]]))
    assert certificates(one_sided, z).status[0] == "saddle"


def test_what_could_gain_in_both_is_not_critical_and_past_limits_says_by_how_much():
    sketch = sketched(2, ellipses, lambda x: ([], [0.8 - x[0]]))
    known = certificates(sketch, placed(ellipses, [[0.3, 0.9], [1.0, 0.5]]), (2.0, 25.0))
    assert known.status[0] == "undetermined"
    assert known.kkt_residual[0] > 1e-2
    assert known.violation == pytest.approx([0.0, 0.2])
    assert np.array_equal(known.violation_between, known.violation)


def test_polishing_leads_to_the_front_and_gains_in_everything():
    sketch, rng, ranges = sketched(2, ellipses), np.random.default_rng(0), np.array([2.0, 25.0])
    z = beside(8, seed=0)
    z[:, 2:] += ranges * rng.uniform(0.0, 0.02, (8, 2))
    found, good = polished(sketch, z, ranges)
    assert good.all()
    assert (found[:, 2:] <= z[:, 2:] + 1e-8).all()
    known = certificates(sketch, found, ranges)
    assert known.kkt_residual.max() <= 1e-6
    assert set(known.status) == {"minimum"}
    shares = known.weights / ranges
    shares = shares[:, 0] / shares.sum(axis=1)
    assert found[:, :2] == pytest.approx(np.array([ellipses_best(share) for share in shares]), abs=1e-4)


def test_points_go_straight_ahead_as_far_as_that_goes():
    """Between bowls of one shape, gains over ranges are equal."""

    def bowls(x):
        return [x[0] ** 2 + x[1] ** 2, (x[0] - 1) ** 2 + x[1] ** 2]

    sketch, ranges = sketched(2, bowls), np.array([1.0, 2.0])
    z = placed(bowls, [[0.4, 0.5], [0.6, -0.3], [0.5, 0.2]])
    found, good = polished(sketch, z, ranges)
    gains = (z[:, 2:] - found[:, 2:]) / ranges
    assert good.all()
    assert gains[:, 0] == pytest.approx(gains[:, 1], abs=1e-6)
    assert gains.min() > 0.01


def test_points_that_are_critical_stay_bit_for_bit():
    sketch = sketched(2, ellipses)
    z = placed(ellipses, [ellipses_best(share) for share in SHARES])
    found, good = polished(sketch, z, np.array([2.0, 25.0]))
    assert good.all()
    assert np.array_equal(found, z)


@pytest.mark.parametrize("last", [1, 3, 8])
def test_where_observe_returns_true_later_points_stay_as_they_were(last):
    sketch, ranges, seen = sketched(2, ellipses), np.array([2.0, 25.0]), []
    z = beside(8, seed=0)

    def observe(done, wanted):
        seen.append((done, wanted))
        return done == last

    found, good = polished(sketch, z, ranges, observe)
    every, _ = polished(sketch, z, ranges)
    assert seen == [(done, 8) for done in range(1, last + 1)]
    assert np.array_equal(found[:last], every[:last])
    assert np.array_equal(found[last:], z[last:])
    assert good.tolist() == [True] * last + [False] * (8 - last)
    assert not (every == z).all(axis=1).any()


def test_a_point_that_nothing_can_be_done_for_stays_and_is_said_to():
    nowhere = sketched(2, ellipses, lambda x: ([], [x[0] - 2.0, 1.0 - x[0]]))
    z = placed(ellipses, [[1.5, 0.0]])
    found, good = polished(nowhere, z, ONES)
    assert np.array_equal(found, z)
    assert good.tolist() == [False]
    assert certificates(nowhere, z).violation == pytest.approx([0.5])
