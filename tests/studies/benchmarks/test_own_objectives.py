"""Own objectives on arms of a package: rows have seconds and misses."""

from __future__ import annotations

from dataclasses import replace

import pytest

from problems import panda
from studies.benchmarks import own_objectives as study
from studies.reporting import LOSS


@pytest.mark.slow
def test_rows_of_an_arm_say_seconds_certificates_and_limits(monkeypatch):
    walk = replace(next(each for each in study.WALKS if each.name.startswith("Panda")), axes="pose")
    monkeypatch.setattr(study, "robot_file", lambda name: panda.URDF)
    monkeypatch.setattr(study, "SAMPLES", 9)
    rows = {row.column: row for row in study.walk_rows(walk, points=3)}
    assert rows["time"].note.removeprefix(LOSS).startswith("3 points")
    assert rows["not a minimum"].ours == 0
    assert rows["worst violation between samples"].reference == 1e-4
