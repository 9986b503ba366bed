"""The study of the closed loop, on a few steps."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.formulations.closed_loop import mean_position_error
from paretoik.task.objectives import joint_drift
from studies.marcos_2012 import starts, tables
from studies.marcos_2012.starts import posture as posture_at
from studies.marcos_2012.starts import start_rows
from studies.marcos_2012.tables import Cell, cells, follow, paper, table_rows
from tests.closed_loop.postures import posture

CELL = Cell(links=3, distance=0.7, blocked=False, weight=0.5)


@pytest.fixture(scope="module")
def followed():
    return follow(CELL, posture(3), steps=12, seed=0, generations=60)


def test_the_papers_tables_are_whole_and_agree_with_its_text():
    assert len(cells()) == 88
    assert len(paper()) == 176
    errors = [paper()["Table 1", f"r = 0.7, w = {w}", "4R"] for w in tables.WEIGHTS]
    assert (min(errors), max(errors)) == (3.44e-07, 1.03e-05)  # section 5.1: 3E-07 and 1E-05
    assert paper()["Table 3", "r = 0.7, w = 0.0", "4R"] == 7.73e-07  # section 5.2: 8E-07


def test_a_searched_loop_is_compared_with_the_paper_and_the_oracle(followed):
    error, drift = table_rows([followed])
    assert error.table == "Table 1: mean position error, no obstacles"
    assert (error.reference, drift.reference) == (7.35e-06, 1.32e-03)
    assert error.ours == pytest.approx(mean_position_error(followed.exact), rel=0.01)
    assert drift.ours == pytest.approx(joint_drift(followed.exact), rel=0.05)
    assert f"exact {joint_drift(followed.exact):.4g}" in drift.note
    assert drift.note.startswith("the exact loop is off as well")


def test_starts_reach_the_circle_and_decide_the_numbers(monkeypatch):
    monkeypatch.setattr(starts, "DISTANCES", (0.7,))
    monkeypatch.setattr(starts, "WEIGHTS", (0.0, 0.5, 1.0))
    monkeypatch.setattr(starts, "NARROW", 1e-2)  # one exact loop per trial, and the angle is not checked
    for angle in np.linspace(-np.pi, np.pi, 8, endpoint=False):
        for side in (1, -1):
            q = posture_at(0.7, angle, side)
            if q is not None:
                ends = np.cumsum(q)
                np.testing.assert_allclose([np.cos(ends).sum(), np.sin(ends).sum()], [1.2, 0.0], atol=1e-12)
    rows = start_rows(8)
    assert [row.row for row in rows] == ["Table 1, r = 0.7, 3R", "Table 2, r = 0.7, 3R"]
    assert rows[0].ours >= 1
