"""The study of weighted gradient projection, from a few starts."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import paretoik as pk
from problems import wan_2018
from studies.reporting import holm
from studies.wan_2018 import __main__ as study
from studies.wan_2018.fronts import comparison_rows
from studies.wan_2018.methods import paper, paper_methods, speed_row, start_postures, table_rows, worst_errors


def test_paths_are_the_papers():
    path = wan_2018.experiment()
    assert (path.samples, path.duration) == (743, 3.71)
    np.testing.assert_allclose(path.positions[371], wan_2018.ENDS["experiment"][1][0], atol=1e-12)
    np.testing.assert_allclose(path.positions[[0, -1]], [wan_2018.ENDS["experiment"][0][0]] * 2, atol=1e-12)
    turned = Rotation.from_quat(wan_2018.simulation().quaternions[-1], scalar_first=True)
    expected = Rotation.from_euler("ZYZ", wan_2018.ENDS["simulation"][1][1], degrees=True)
    assert (turned.inv() * expected).magnitude() < 1e-9


def test_the_modified_trapezoid_has_its_textbooks_peaks():
    u = np.linspace(0, 1, 4001)
    way = wan_2018.modified_trapezoid(u)
    assert way[[0, 2000, -1]] == pytest.approx([0.0, 0.5, 1.0], abs=1e-9)
    assert np.gradient(way, u).max() == pytest.approx(2.0, rel=1e-3)
    assert np.gradient(np.gradient(way, u), u)[5:-5].max() == pytest.approx(4.888, rel=5e-3)


def test_starts_are_within_the_limits_and_on_the_first_pose():
    path, arm = wan_2018.simulation(), pk.arms.wan_7r()
    postures = start_postures(path, 60)
    assert len(postures) > 5
    assert ((postures >= arm.position_limits[:, 0]) & (postures <= arm.position_limits[:, 1])).all()
    motion = pk.resolve(arm, path, paper_methods("Table 2")["WLN"], start=postures, unreachable="track")
    assert np.abs(motion.traces.errors[:, 0]).max() < 1e-9
    assert worst_errors(motion).shape == (len(postures), 6)


@pytest.mark.parametrize("table", ["Table 2", "Table 3"])
def test_tables_stand_beside_the_papers(table):
    rows = table_rows(table, population=30)
    errors = [row for row in rows if row.reference is not None]
    assert len(errors) == 18
    assert {row.reference for row in errors} == {value for place, value in paper().items() if place[0] == table}
    shares = [row.ours for row in rows if row.unit == "share of starts"]
    assert all(0 <= share <= 1 for share in shares)


def test_joint_4_is_freed_more_often_than_by_the_weighted_least_norm():
    rows = {(row.row, row.column): row.ours for row in table_rows("Table 2", population=60)}
    for name in ("WGPM, as printed", "WGPM, consistent"):
        assert rows[name, "joint 4 ends there"] < rows["WLN", "joint 4 ends there"]


def test_corrected_p_values_are_holms():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.9, 0.8]).tolist() == [1.0, 1.0]


def test_families_are_compared_by_their_fronts():
    rows = comparison_rows(seeds=2, population=8, generations=2, judged_starts=1)
    assert [row.column for row in rows] == ["hypervolume, median", "IGD+, median", "additive ε, median"]
    assert all(row.note.startswith("from 1 starts each: undecided") for row in rows)  # two seeds decide nothing


def test_the_command_writes_rows(tmp_path, monkeypatch):
    monkeypatch.setattr(study, "table_rows", lambda *_, **__: [])
    monkeypatch.setattr(study, "comparison_rows", lambda **_: [])
    monkeypatch.setattr(study, "speed_row", lambda rounds: speed_row(rounds=1))
    study.main(["--quick", "--json", str(tmp_path / "rows.json")])
    (row,) = json.loads((tmp_path / "rows.json").read_text())
    assert row["row"] == "200 sets, 743 samples"
    assert row["ours"] > 0
    assert row["unit"] == "s"
