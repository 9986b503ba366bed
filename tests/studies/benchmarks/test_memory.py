"""Memory of a run and of its recorder, seen from outside."""

from __future__ import annotations

import subprocess
import sys

import pytest

from studies.benchmarks import memory
from studies.benchmarks.resident_memory import RECORDER, PeakMemory, run_watched

SIZE = 80_000_000
HOLD = f"import time; held = bytearray({SIZE}); time.sleep(1); print('done')"


def test_a_run_that_records_nothing_has_a_peak_and_no_recorder():
    printed, peak = run_watched([sys.executable, "-c", HOLD])
    assert printed == "done\n"
    assert peak.run > SIZE
    assert peak.recorder == 0


def test_the_recorder_s_peak_is_told_apart_from_the_run_s():
    start = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {HOLD!r}, {RECORDER!r}], check=True)"
    _, peak = run_watched([sys.executable, "-c", start])
    assert peak.run < SIZE < peak.recorder


def test_a_run_that_fails_is_an_error():
    with pytest.raises(subprocess.CalledProcessError):
        run_watched([sys.executable, "-c", "raise SystemExit(3)"])


def test_a_long_recorded_run_is_compared_with_a_short_one(monkeypatch):
    monkeypatch.setattr(memory, "OPTIONS", memory.MemoryOptions(population=12))
    peak, size = memory.measure(2)
    assert min(peak.run, peak.recorder, size) > 0
    rows = memory.tabulate(9, (PeakMemory(run=100, recorder=100), PeakMemory(run=150, recorder=210)), size)
    ratios = {row.row: row.ours for row in rows if row.column == "ratio"}
    assert ratios == {"both": 1.8, "the run": 1.5, "the process that records": 2.1}
