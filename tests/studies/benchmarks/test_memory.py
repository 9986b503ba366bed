"""Memory of a run and of its recorder, seen from outside."""

from __future__ import annotations

import sys

from studies.benchmarks.resident_memory import RECORDER, run_watched

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
