"""The study of weighted gradient projection, from a few starts."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import paretoik as pk
from problems import wan_2018
from studies.wan_2018.fronts import comparison_rows
from studies.wan_2018.methods import (
    AXES,
    all_methods,
    paper,
    paper_methods,
    resolve_table,
    start_postures,
    worst_errors,
)
from studies.wan_2018.tables import EVENTS, event_rows, table_rows


@cache
def resolved_table(table):
    return resolve_table(table, population=20)


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
def test_tables_are_compared_with_the_papers(table):
    rows = table_rows(resolved_table(table))
    errors = [row for row in rows if row.reference is not None]
    assert len(errors) == 18
    assert {row.reference for row in errors} == {v for (t, row, _), v in paper().items() if t == table and row in AXES}
    shares = [row.ours for row in rows if row.unit == "share of starts"]
    assert all(0 <= share <= 1 for share in shares)


def test_joint_4_is_freed_more_often_than_by_the_weighted_least_norm():
    rows = {(row.row, row.column): row.ours for row in table_rows(resolved_table("Table 2"))}
    for name in ("WGPM, as printed", "WGPM, consistent"):
        assert rows[name, "joint 4 ends at a limit"] < rows["WLN", "joint 4 ends at a limit"]


@pytest.mark.parametrize("table", ["Table 2", "Table 3"])
def test_the_quadratic_program_alone_keeps_all_limits(table):
    rows = {(row.row, row.column): row.ours for row in table_rows(resolved_table(table))}
    for name in all_methods(table):
        keeps = [rows[name, column] for column in ("positions keep their limits", "velocities keep theirs")]
        assert (keeps == [1.0, 1.0]) == (name == "QP, velocities too")
        assert keeps[0] == 1.0 or "QP" not in name


def test_events_are_compared_with_the_papers():
    rows = event_rows([resolved_table(table) for table in ("Table 2", "Table 3")])
    told = {value for (figure, *_), value in paper().items() if figure.startswith("Figure")}
    assert {row.reference for row in rows if row.reference is not None} == told
    assert sum(len(events) for events in EVENTS.values()) == len(told)
    assert all(row.note for row in rows)


def test_families_are_compared_by_their_fronts():
    rows = comparison_rows(seeds=2, population=8, generations=2, judged_starts=1)
    assert [row.column for row in rows] == ["hypervolume, median", "IGD+, median", "additive ε, median"]
    assert all(row.note.startswith("from 1 starts each: undecided") for row in rows)  # two seeds cannot decide
