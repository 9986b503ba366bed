"""Tests of two methods' values over seeds, their correction for several, and bootstrap intervals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.significance import SIGNIFICANCE, bootstrap_interval, compare_samples, holm

p_values = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12)


def test_holm_is_the_textbook_s():
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]).tolist() == [1.0, 1.0]


@given(p_values)
def test_holm_never_helps_and_keeps_the_order(p):
    corrected = holm(p)
    assert (corrected >= p).all()
    assert (corrected <= 1).all()
    assert (np.diff(corrected[np.argsort(p)]) >= 0).all()


@pytest.mark.parametrize("maximised", [True, False])
def test_a12_counts_pairs_of_which_ours_is_better_and_half_of_ties(maximised):
    ours, theirs = np.array([1.0, 2.0, 3.0, 6.0]), np.array([2.0, 4.0, 5.0])
    pairs = np.sign(ours[:, None] - theirs) * (1.0 if maximised else -1.0)
    comparison = compare_samples(ours, theirs, maximised=maximised)
    assert comparison.a12 == pytest.approx(0.5 * (1.0 + pairs.mean()))
    assert (comparison.ours, comparison.theirs, comparison.ratio) == (2.5, 4.0, 2.5 / 4.0)


def test_the_same_values_show_no_difference():
    comparison = compare_samples(np.ones(5), np.ones(5), maximised=True)
    assert (comparison.a12, comparison.p) == (0.5, 1.0)
    assert (comparison.ratio_low, comparison.ratio_high) == (1.0, 1.0)


def test_an_interval_is_the_percentiles_of_the_statistic_of_resamples():
    values = np.random.default_rng(3).normal(size=31)
    draw = np.random.default_rng(0).integers(0, 31, size=(SIGNIFICANCE.resamples, 31))
    expected = np.percentile(values[draw].mean(axis=1), [2.5, 97.5])
    np.testing.assert_allclose(bootstrap_interval(np.mean, values), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [([1.0], [2.0]), ([np.inf] * 3, [1.0, 1.1, 1.2]), ([1.0, 1.1, 1.2], [0.0] * 3), ([0.0] * 3, [0.0] * 3)],
)
def test_without_finite_ratios_of_several_seeds_there_is_no_interval(ours, theirs):
    comparison = compare_samples(np.array(ours), np.array(theirs), maximised=True)
    assert np.isnan([comparison.ratio_low, comparison.ratio_high]).all()
