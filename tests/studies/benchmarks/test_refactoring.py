"""Two checkouts side by side: ratios, values, reasons, and what fails."""

from __future__ import annotations

import pytest

from studies.benchmarks import refactoring
from studies.benchmarks.checkouts import ROOT, run_in
from studies.benchmarks.refactoring import Case, tabulate


def results(seconds, now, before):
    return {
        "now": {"seconds": [9.0, seconds], "values": now},
        "before": {"seconds": [1.0, 3.0], "values": before},
    }


@pytest.mark.parametrize(
    ("seconds", "now", "maximised", "lost", "words"),
    [
        (1.0, [2.0], False, False, "the same bits"),
        (1.1, [2.0], False, True, "the same bits"),
        (1.0, [1.9], False, False, "values better by 5.0e-02"),
        (1.0, [2.1], False, True, "values worse by 5.0e-02"),
        (1.0, [2.1], True, False, "values better by 5.0e-02"),
        (1.0, [2.0 + 1e-10], False, False, "values equal to 1e-9"),
    ],
)
def test_more_seconds_or_worse_values_are_a_loss(seconds, now, maximised, lost, words):
    row = tabulate("case", Case(code="", maximised=maximised), results(seconds, now, [2.0]))
    assert row.ours == pytest.approx(seconds)
    assert row.note.startswith("LOSS") == lost
    assert words in row.note


def test_worse_values_with_a_reason_say_it():
    row = tabulate("case", Case(code="", reason="another model"), results(1.0, [2.1], [2.0]))
    assert not row.note.startswith("LOSS")
    assert "values worse by 5.0e-02; another model" in row.note


def test_a_checkout_beside_itself_has_the_same_bits_and_what_fails_is_a_row(tmp_path, monkeypatch, capsys):
    cases = {
        "sum": Case(code="def run():\n    return [sum(range(100_000))]\n", repeats=2),
        "broken": Case(code="raise ValueError('no such thing')"),
    }
    monkeypatch.setattr(refactoring, "CASES", cases)
    monkeypatch.setattr(refactoring, "SHARED", "import json, time\n")
    refactoring.main(["--before", str(ROOT), "--rounds", "1", "--json", str(tmp_path / "rows.json")])
    told = capsys.readouterr().out
    assert "the same bits" in told
    assert "no such thing" in told


def test_a_program_that_fails_says_its_last_line(tmp_path):
    with pytest.raises(RuntimeError, match="ValueError: bad"):
        run_in(ROOT, "raise ValueError('bad')", cache=tmp_path)
    assert run_in(ROOT, "print('{\"a\": 1}')", cache=tmp_path) == {"a": 1}
