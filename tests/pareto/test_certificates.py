"""Certificates of points of small programs whose minima, saddles and exchange rates are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from paretoik.errors import SolverFailed
from paretoik.nlp.program import Constraints
from paretoik.pareto import certificates as certifying
from paretoik.pareto.certificates import certify, exchange_rates, weight_ratios
from paretoik.stop_flag import STOP
from tests.pareto.sketches import ONES, SHARES, certificates, ellipses, ellipses_best, placed, sketched


def saddle(x):
    """Return two objectives that both improve on either side along the last coordinate."""
    bent = x[1] ** 4 - x[1] ** 2
    return [x[0] ** 2 + bent, (x[0] - 1) ** 2 + bent]


def test_minima_are_called_minima_with_the_weights_that_made_them():
    program, ranges = sketched(2, ellipses), np.array([2.0, 25.0])
    certificate = certificates(program, placed(ellipses, [ellipses_best(share) for share in SHARES]), ranges)
    assert certificate.status.tolist() == ["minimum"] * 4
    assert certificate.criticality.max() <= 1e-9
    assert certificate.violation.max() <= 1e-12
    weights = np.stack([SHARES, 1 - SHARES], axis=1) * ranges
    assert certificate.weights == pytest.approx(weights / weights.sum(axis=1, keepdims=True), rel=1e-6)


@pytest.mark.parametrize("signs", [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
def test_exchange_rates_are_the_slopes_of_the_front_and_what_is_maximised_has_its_own_sign(signs):
    program, step = sketched(2, ellipses), 1e-4
    certificate = certificates(program, placed(ellipses, [ellipses_best(s) for s in SHARES]), (2.0, 25.0), signs)
    beside = np.array([[ellipses(ellipses_best(s + sign * step)) for sign in (-1, 1)] for s in SHARES])
    change = np.diff(beside * signs, axis=1)[:, 0]
    assert certificate.exchange_rates[:, 0, 1] == pytest.approx(change[:, 1] / change[:, 0], rel=1e-5)
    assert certificate.exchange_rates[:, 1, 0] == pytest.approx(change[:, 0] / change[:, 1], rel=1e-5)
    assert certificate.exchange_intervals[:, 0, 1] == pytest.approx(
        np.repeat(certificate.exchange_rates[:, 0, 1, None], 2, axis=1), rel=1e-4
    )


def test_at_a_corner_of_the_front_the_exchange_lies_between_the_slopes_of_both_sides():
    """At (0.25, 0.75) on x + y ≥ 1 and 3 x + y ≥ 1.5, y falls by 1 per x on one side, by 3 on the other."""
    program = sketched(2, lambda x: [x[0], x[1]], lambda x: ([], [x[0] + x[1] - 1.0, 3 * x[0] + x[1] - 1.5]))
    certificate = certificates(program, np.array([[0.25, 0.75, 0.25, 0.75]]))
    assert certificate.status[0] == "minimum"
    assert np.sort(certificate.exchange_intervals[0, 0, 1]) == pytest.approx([-3.0, -1.0], abs=1e-5)
    assert np.sort(certificate.exchange_intervals[0, 1, 0]) == pytest.approx([-1.0, -1 / 3], abs=1e-5)


@pytest.mark.parametrize("place", [0.2, 0.7])
def test_a_saddle_is_called_one_and_the_valleys_beside_it_minima(place):
    program = sketched(2, saddle)
    root = np.sqrt(0.5)
    certificate = certificates(program, placed(saddle, [[place, 0.0], [place, root], [place, -root]]))
    assert certificate.criticality.max() <= 1e-6
    assert certificate.status.tolist() == ["saddle", "minimum", "minimum"]
    assert certificate.weights == pytest.approx(np.tile([1 - place, place], (3, 1)), abs=1e-6)


@pytest.mark.parametrize("low", [0.0, -1e-3])
def test_what_limits_keep_from_going_down_is_a_minimum_unless_there_is_another_side(low):
    """At the saddle the last coordinate may only rise, or may not change."""
    within = sketched(2, saddle, lambda x: ([], [x[1] - low, -x[1] - low]))
    z = placed(saddle, [[0.5, 0.0]])
    certificate = certificates(within, z)
    assert certificate.status[0] == ("minimum" if low == 0.0 else "saddle")
    one_sided = sketched(2, saddle, lambda x: ([], [x[1]]))
    assert certificates(one_sided, z).status[0] == "saddle"


def test_point_that_gains_in_both_is_not_critical_and_reports_its_violation():
    program = sketched(2, ellipses, lambda x: ([], [0.8 - x[0]]))
    certificate = certificates(program, placed(ellipses, [[0.3, 0.9], [1.0, 0.5]]), (2.0, 25.0))
    assert certificate.status[0] == "undetermined"
    assert certificate.criticality[0] > 1e-2
    assert certificate.violation == pytest.approx([0.0, 0.2])
    assert np.array_equal(certificate.violation_between, certificate.violation)


def test_a_solver_that_fails_at_one_point_leaves_that_one_undetermined_with_its_reason(monkeypatch):
    program, ranges = sketched(2, ellipses), (2.0, 25.0)
    x = placed(ellipses, [ellipses_best(share) for share in SHARES])
    clean, solve, calls = certificates(program, x, ranges), certifying.criticality, []

    def fail(*arguments):
        calls.append(arguments)
        if len(calls) == 2:
            raise SolverFailed("criticality: Clarabel must end with Solved, got InsufficientProgress")
        return solve(*arguments)

    monkeypatch.setattr(certifying, "criticality", fail)
    certificate = certificates(program, x, ranges)
    assert certificate.status.tolist() == ["minimum", "undetermined", "minimum", "minimum"]
    assert [reason != "" for reason in certificate.reason] == [False, True, False, False]
    assert certificate.reason[1].endswith("got InsufficientProgress")
    assert np.isnan(certificate.criticality[1])
    assert np.isnan(certificate.exchange_rates[1, [0, 1], [1, 0]]).all()
    assert certificate.violation[1] == clean.violation[1]
    others = [0, 2, 3]
    for name in ("criticality", "weights", "exchange_rates", "exchange_intervals"):
        assert np.array_equal(getattr(certificate, name)[others], getattr(clean, name)[others])


def test_after_a_signal_no_point_is_certified_and_all_are_kept():
    program, x = sketched(2, ellipses), placed(ellipses, [ellipses_best(share) for share in SHARES])
    counts = []

    def interrupt(done, total):
        counts.append((done, total))
        STOP[0] = done == 2

    try:
        certificate, _ = certify(
            program, x, ranges=np.array([2.0, 25.0]), signs=ONES, violation_between=np.zeros(4), observe=interrupt
        )
    finally:
        STOP[0] = 0
    assert counts == [(1, 4), (2, 4)]
    assert certificate.status.tolist() == ["minimum"] * 2 + ["undetermined"] * 2
    assert certificate.reason.tolist() == ["", ""] + ["interrupted before it was certified"] * 2
    assert np.isfinite(certificate.violation).all()


@pytest.mark.parametrize(("width", "end"), [(1e-6, "that ends at left, right"), (1e-2, "in which no better point was")])
def test_a_direction_that_soon_meets_a_limit_is_said_to_end_there(width, end, monkeypatch):
    monkeypatch.setattr(certifying, "_better_point", lambda *arguments: None)  # as if no solver finds one
    program = sketched(2, saddle, lambda x: ([], [1.0 - x[1] / width, 1.0 + x[1] / width]))
    program = replace(program, inequality_names=("first", "second", "left", "right"))
    certificate = certificates(program, placed(saddle, [[0.5, 0.0]]))
    assert certificate.status.tolist() == ["undetermined"]
    assert certificate.reason[0].startswith(f"curvature -2.0e+00 along a direction {end}")


# Exchange rates from weights, and intervals of rates if multipliers are not unique.


RANGES = np.array([2.0, 5.0, 0.1])
SIGNS = np.array([1.0, -1.0, 1.0])


def limits(rows, slacks):
    return Constraints(unknowns=2, values=np.asarray(slacks, float), jacobian=csr_array(np.asarray(rows, float)))


def ratios_of(weights):
    """Return ratios λ_i/λ_j of unique weights as ends of intervals."""
    return np.stack([weights[:, :, None] / weights[:, None, :]] * 2, axis=-1)


def test_a_step_along_the_front_s_tangent_plane_keeps_the_weighted_sum():
    weights = np.random.default_rng(0).dirichlet(np.ones(3), size=20)
    rates = exchange_rates(weights, ratios_of(weights), RANGES, SIGNS)
    scaled = weights * SIGNS / RANGES  # for natural objectives in their own signs
    for i in range(3):
        for j in range(3):
            if i != j:
                np.testing.assert_allclose(scaled[:, i] + scaled[:, j] * rates[:, i, j], 0.0, atol=1e-12)
    np.testing.assert_array_equal(rates[:, range(3), range(3)], 1.0)
    np.testing.assert_allclose(rates * np.swapaxes(rates, 1, 2), 1.0)


@pytest.mark.parametrize("ends", [(0.5, 1.0), (1.0, np.inf)])
def test_no_single_rate_stands_for_an_interval_or_for_what_is_unknown(ends):
    ratios = np.broadcast_to(ends, (1, 2, 2, 2))
    rates = exchange_rates(np.full((1, 2), 0.5), ratios, np.ones(2), np.ones(2))[0]
    assert np.isnan(rates[0, 1])


@pytest.mark.parametrize("slack", [0.0, 0.1])
def test_at_a_corner_any_ratio_between_those_of_both_sides_serves(slack):
    """Gradients (1, 0) and (−1, 1) with limits x ≥ 0 and y ≥ 0: λ₁ − λ₂ = μ₁ ≥ 0 and λ₂ = μ₂ if both are active."""
    gradients = np.array([[1.0, 0.0], [-1.0, 1.0]])
    weights = np.array([0.5, 0.5])
    ratios = weight_ratios(gradients, limits(np.eye(2), [slack, 0.0]), weights)
    if slack:  # only y ≥ 0 is active: both weights are equal
        np.testing.assert_allclose(ratios, 1.0, atol=1e-6)
    else:
        assert ratios[0, 1, 0] == pytest.approx(1.0, abs=1e-6)
        assert np.isposinf(ratios[0, 1, 1])
        np.testing.assert_allclose(ratios[1, 0], [0.0, 1.0], atol=1e-6)
