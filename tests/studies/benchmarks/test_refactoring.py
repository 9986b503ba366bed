"""Two checkouts side by side: ratios, values by name, reasons, and failures."""

from __future__ import annotations

import json

from studies.benchmarks import refactoring
from studies.benchmarks.checkouts import ROOT
from studies.benchmarks.refactoring import Case


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
