"""Shared parts of all studies."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studies.reporting import Row, goal_row, report

numbers = st.floats(allow_nan=True, allow_infinity=True)
rows = st.builds(
    Row,
    table=st.sampled_from(["Table 5", "figure"]),
    row=st.text(max_size=8),
    column=st.text(max_size=8),
    unit=st.sampled_from(["", "N²m²s"]),
    ours=numbers,
    reference=st.none() | numbers,
    source=st.sampled_from(["paper", "goal"]),
    note=st.text(max_size=8),
)


def row(**fields):
    return Row(**{"table": "Table 5", "row": "simulation 1", "column": "energy", "unit": "J s", "ours": 1.0, **fields})


def refuse(constant):
    pytest.fail(f"{constant} is no strict JSON")


@settings(max_examples=30)
@given(st.lists(rows, max_size=3))
def test_json_is_strict_and_says_what_the_rows_say(tmp_path_factory, some):
    file = tmp_path_factory.mktemp("study") / "rows.json"
    report(some, json_file=file)
    read = json.loads(file.read_text(), parse_constant=refuse)
    assert len(read) == len(some)
    for record, one in zip(read, some, strict=True):
        for name in ("table", "row", "column", "unit", "note"):
            assert record.pop(name) == getattr(one, name)
        assert record.pop("source") == (None if one.reference is None else one.source)
        for name in ("ours", "reference"):
            value = getattr(one, name)
            assert record.pop(name) == (value if value is not None and math.isfinite(value) else None)
        assert not record


def test_a_goal_that_is_missed_is_a_loss_and_so_is_no_number():
    place = "Table 5", "simulation 1", "energy", "J s"
    assert [goal_row(*place, ours, 1.0).note for ours in (1.0, 1.1, math.nan)] == ["goal", "LOSS: goal", "LOSS: goal"]
    assert [goal_row(*place, ours, 1.0, "of 3", least=True).note for ours in (1.0, 0.9)] == ["of 3", "LOSS: of 3"]
