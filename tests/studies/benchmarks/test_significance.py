"""Indicators of fronts, and the comparison and report of two methods."""

from __future__ import annotations

import numpy as np
import pytest

from studies.benchmarks import significance as study


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
