"""Two checkouts side by side: ratios, values by name, reasons, and failures."""

from __future__ import annotations

import json

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
    ("seconds", "name", "value", "loss", "words"),
    [
        (1.0, "energy", 2.0, False, "energy the same bits"),
        (1.1, "energy", 2.0, True, "energy the same bits"),
        (1.0, "energy", 1.9, False, "energy 1.9 against 2, 5.0e-02 better"),
        (1.0, "energy", 2.1, True, "energy 2.1 against 2, 5.0e-02 worse"),
        (1.0, "hypervolume", 2.1, False, "hypervolume 2.1 against 2, 5.0e-02 better"),
        (1.0, "hypervolume", 1.9, True, "hypervolume 1.9 against 2, 5.0e-02 worse"),
        (1.0, "energy", 2.0 + 1e-10, False, "energy equal to 1e-9"),
    ],
)
def test_more_seconds_or_a_worse_value_are_a_loss(seconds, name, value, loss, words):
    row = tabulate("case", Case(code=""), results(seconds, {name: value}, {name: 2.0}))
    assert row.ours == pytest.approx(seconds)
    assert row.note.startswith("LOSS") == loss
    assert words in row.note


def test_a_reason_explains_a_loss_and_does_not_hide_it():
    case = Case(code="", reason="another model")
    row = tabulate("case", case, results(1.0, {"time": 1.0, "energy": 2.1}, {"time": 1.5, "energy": 2.0}))
    assert row.note.startswith("LOSS")
    assert row.note.endswith("5.0e-02 worse; another model")
    same = tabulate("case", case, results(1.0, {"energy": 2.0}, {"energy": 2.0}))
    assert "another model" not in same.note


def test_a_checkout_compared_with_itself_has_the_same_bits_and_failures_are_rows(tmp_path, monkeypatch):
    cases = {
        "sum": Case(code="def run():\n    return {'total': sum(range(100_000))}\n", repeats=2),
        "broken": Case(code="raise ValueError('no such thing')"),
    }
    monkeypatch.setattr(refactoring, "CASES", cases)
    monkeypatch.setattr(refactoring, "SHARED", "import json, time\n")
    refactoring.main(["--before", str(ROOT), "--rounds", "1", "--json", str(tmp_path / "rows.json")])
    notes = {row["row"]: row["note"] for row in json.loads((tmp_path / "rows.json").read_text())}
    assert "total the same bits" in notes["sum"]
    assert "no such thing" in notes["broken"]


def test_a_program_that_fails_says_its_last_line(tmp_path):
    with pytest.raises(RuntimeError, match="ValueError: bad"):
        run_in(ROOT, "raise ValueError('bad')", cache=tmp_path)
    assert run_in(ROOT, "print('{\"a\": 1}')", cache=tmp_path) == {"a": 1}
