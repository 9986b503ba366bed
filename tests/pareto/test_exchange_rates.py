"""How objectives trade: rates from weights, and intervals of rates where multipliers are not unique."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from paretoik.nlp.program import Constraints
from paretoik.pareto.certificates import exchange_intervals, exchange_rates, weight_ratios

RANGES = np.array([2.0, 5.0, 0.1])
SIGNS = np.array([1.0, -1.0, 1.0])


def limits(rows, slacks):
    return Constraints(unknowns=2, values=np.asarray(slacks, float), jacobian=csr_array(np.asarray(rows, float)))


def ratios_of(weights):
    """Ratios λ_i/λ_j of unique weights, as ends of intervals."""
    return np.stack([weights[:, :, None] / weights[:, None, :]] * 2, axis=-1)


def test_a_step_along_the_front_s_tangent_plane_keeps_the_weighted_sum():
    weights = np.random.default_rng(0).dirichlet(np.ones(3), size=20)
    rates = exchange_rates(weights, ratios_of(weights), RANGES, SIGNS)
    scaled = weights * SIGNS / RANGES  # of natural objectives in their own signs
    for i in range(3):
        for j in range(3):
            if i != j:
                np.testing.assert_allclose(scaled[:, i] + scaled[:, j] * rates[:, i, j], 0.0, atol=1e-12)
    np.testing.assert_array_equal(rates[:, range(3), range(3)], 1.0)
    np.testing.assert_allclose(rates * np.swapaxes(rates, 1, 2), 1.0)


def test_what_has_no_weight_has_no_rate_in_either_direction():
    weights = np.array([[1.0 - 1e-9, 1e-9]])
    rates = exchange_rates(weights, ratios_of(weights), np.ones(2), np.ones(2))[0]
    assert np.isnan(rates[[0, 1], [1, 0]]).all()
    assert np.array_equal(np.diagonal(rates), np.ones(2))


@pytest.mark.parametrize("ends", [(0.5, 1.0), (0.0, 1.0), (1.0, np.inf), (np.nan, np.nan)])
def test_no_single_rate_stands_for_an_interval_or_for_what_is_unknown(ends):
    ratios = np.broadcast_to(ends, (1, 2, 2, 2))
    rates = exchange_rates(np.full((1, 2), 0.5), ratios, np.ones(2), np.ones(2))[0]
    assert np.isnan(rates[0, 1])


def test_intervals_of_unique_weights_are_the_rates():
    weights = np.array([[0.2, 0.3, 0.5]])
    ends = exchange_intervals(ratios_of(weights), RANGES, SIGNS)
    rates = exchange_rates(weights, ratios_of(weights), RANGES, SIGNS)
    np.testing.assert_allclose(ends, np.stack([rates, rates], axis=-1))


def test_intervals_have_the_lower_end_first_whatever_the_signs():
    ratios = np.random.default_rng(1).uniform(0.1, 2.0, (4, 3, 3, 2))
    ends = exchange_intervals(ratios, RANGES, SIGNS)
    assert (ends[..., 0] <= ends[..., 1]).all()


def test_ratios_of_opposed_gradients_are_those_of_their_lengths():
    gradients = np.array([[1.0, 0.0], [-2.0, 0.0]])
    ratios = weight_ratios(gradients, limits(np.zeros((0, 2)), []), np.array([2.0, 1.0]) / 3)
    np.testing.assert_allclose(ratios[0, 1], 2.0)
    np.testing.assert_allclose(ratios[1, 0], 0.5)


@pytest.mark.parametrize("slack", [0.0, 0.1])
def test_at_a_corner_any_ratio_between_those_of_both_sides_serves(slack):
    """Gradients (1, 0) and (−1, 1) with limits x ≥ 0 and y ≥ 0: λ₁ − λ₂ = μ₁ ≥ 0 and λ₂ = μ₂ where both are reached."""
    gradients = np.array([[1.0, 0.0], [-1.0, 1.0]])
    weights = np.array([0.5, 0.5])
    ratios = weight_ratios(gradients, limits(np.eye(2), [slack, 0.0]), weights)
    if slack:  # only y ≥ 0 is reached: both weigh the same
        np.testing.assert_allclose(ratios, 1.0, atol=1e-6)
    else:
        assert ratios[0, 1, 0] == pytest.approx(1.0, abs=1e-6)
        assert np.isposinf(ratios[0, 1, 1])
        np.testing.assert_allclose(ratios[1, 0], [0.0, 1.0], atol=1e-6)
