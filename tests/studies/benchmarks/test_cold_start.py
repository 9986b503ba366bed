"""The table of first results: seconds, ratio, and whether the bits are the same."""

from __future__ import annotations

import pytest

from studies.benchmarks import cold_start
from studies.benchmarks.cold_start import Timing, tabulate


def timing(processor, result=(1.0,)):
    return Timing(processor=processor, clock=2 * processor, result=result)


def test_seconds_of_one_checkout_have_no_ratio():
    (row,) = tabulate("plan", {"now": (timing(3.0), timing(0.5))})
    assert (row.row, row.column, row.ours) == ("plan", "now", 3.0)
    assert "0.5 s once compiled; by the clock 6 and 1 s" in row.note


@pytest.mark.parametrize(("seconds", "words"), [(3.9, "goal met"), (4.1, "goal missed")])
def test_the_ratio_is_held_against_the_goal(seconds, words):
    before = timing(10.0), timing(1.0)
    *_, ratio = tabulate("plan", {"now": (timing(seconds), timing(1.0)), "before": before})
    assert ratio.ours == pytest.approx(seconds / 10)
    assert ratio.reference == 0.4
    assert ratio.note == f"{words}; the same bits"


def test_other_results_are_said():
    before = timing(10.0, (2.0,)), timing(1.0)
    *_, ratio = tabulate("tracking", {"now": (timing(1.0), timing(1.0)), "before": before})
    assert "results (1.0,) and (2.0,)" in ratio.note


def test_a_case_that_fails_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(cold_start.CASES, "plan", "raise ValueError('no such problem')")
    with pytest.raises(RuntimeError, match=r"plan in .*: ValueError: no such problem"):
        cold_start.time_case("plan", tmp_path, tmp_path)
