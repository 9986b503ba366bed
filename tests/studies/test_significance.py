"""Tests of two methods' values over seeds, their correction for several, and bootstrap intervals."""

from __future__ import annotations

import numpy as np
import pytest

from studies import significance as study
from studies.significance import RESAMPLES, bootstrap_interval, compare_samples, holm


def test_holm_is_the_textbook_s():
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]).tolist() == [1.0, 1.0]


@pytest.mark.parametrize("maximised", [True, False])
def test_a12_counts_pairs_of_which_ours_is_better_and_half_of_ties(maximised):
    ours, theirs = np.array([1.0, 2.0, 3.0, 6.0]), np.array([2.0, 4.0, 5.0])
    pairs = np.sign(ours[:, None] - theirs) * (1.0 if maximised else -1.0)
    comparison = compare_samples(ours, theirs, maximised=maximised)
    assert comparison.a12 == pytest.approx(0.5 * (1.0 + pairs.mean()))
    assert (comparison.ours, comparison.theirs, comparison.ratio) == (2.5, 4.0, 2.5 / 4.0)


def test_an_interval_is_the_percentiles_of_the_statistic_of_resamples():
    values = np.random.default_rng(3).normal(size=31)
    draw = np.random.default_rng(0).integers(0, 31, size=(RESAMPLES, 31))
    expected = np.percentile(values[draw].mean(axis=1), [2.5, 97.5])
    np.testing.assert_allclose(bootstrap_interval(np.mean, values), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [([1.0], [2.0]), ([np.inf] * 3, [1.0, 1.1, 1.2]), ([1.0, 1.1, 1.2], [0.0] * 3), ([0.0] * 3, [0.0] * 3)],
)
def test_without_finite_ratios_of_several_seeds_there_is_no_interval(ours, theirs):
    comparison = compare_samples(np.array(ours), np.array(theirs), maximised=True)
    assert np.isnan([comparison.ratio_low, comparison.ratio_high]).all()


def values(centre, seed):
    return centre * np.random.default_rng(seed).uniform(0.99, 1.01, 31)


@pytest.mark.parametrize("indicator", study.MARGIN)
def test_exchanging_the_sides_exchanges_the_verdict(indicator):
    ours, theirs = values(1.0, 0), values(1.5, 1)
    one, other = (study.compare("p", indicator, "peer", *sides) for sides in ((ours, theirs), (theirs, ours)))
    assert one.a12 + other.a12 == pytest.approx(1.0)
    assert one.ratio * other.ratio == pytest.approx(1.0)
    (first,), (second,) = study.decide([one]), study.decide([other])
    assert {first.verdict, second.verdict} == {"win", "loss"}
    assert (first.verdict == "win") == (indicator != "hypervolume")


def test_losses_come_first_and_equals_are_called_so():
    same = study.compare("same", "IGD+", "peer", values(1.0, 0), values(1.0, 1))
    won = study.compare("won", "IGD+", "peer", values(1.0, 0), values(2.0, 1))
    lost = study.compare("lost", "IGD+", "peer", values(2.0, 0), values(1.0, 1))
    comparisons = study.decide([won, same, lost])
    assert [(one.problem, one.verdict) for one in comparisons] == [("lost", "loss"), ("same", "equal"), ("won", "win")]


def test_the_union_itself_scores_best_and_units_do_not_matter():
    x = np.linspace(0.0, 1.0, 20)
    union = np.column_stack((x, 1 - np.sqrt(x)))
    whole, part = study.scores(union, union), study.scores(union[5:15] + 0.01, union)
    assert (whole["IGD+"], whole["epsilon"]) == (0.0, 0.0)
    assert whole["hypervolume"] > part["hypervolume"]
    assert min(part["IGD+"], part["epsilon"]) > 0
    scale = np.array([1000.0, 0.01])
    assert study.scores((union[5:15] + 0.01) * scale, union * scale) == pytest.approx(part)
    assert study.scores(np.empty((0, 2)), union)["hypervolume"] == 0.0
