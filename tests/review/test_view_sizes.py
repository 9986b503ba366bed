"""The check for touching words measures the axes that it must measure, or fails."""

from __future__ import annotations

import pytest

from tests.review import view_sizes
from tests.review.view_sizes import touching_words

FRAME = {"strips": [[[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]]]}
NAN = float("nan")


@pytest.fixture
def recorded(monkeypatch, tmp_path):
    """Return a function that makes a file of entities (by path) in views with scales (by origin)."""

    def record(entities, scales):
        monkeypatch.setattr(view_sizes, "read", lambda file: entities)
        monkeypatch.setattr(view_sizes, "view_scales", lambda file: scales)
        return tmp_path / "review.rrd"

    monkeypatch.setattr(view_sizes, "static_values", lambda entity, component: entity[component])
    monkeypatch.setattr(view_sizes, "static_words", lambda entity: entity["labels"])
    return record


def axes(*positions):
    """Return axes with words at places of their chart, from 1 on."""
    words = [str(number + 1) for number in range(len(positions))]
    return {"/chart/grid": FRAME, "/chart/labels": {"labels": words, "positions": positions}}


def test_words_that_touch_the_frame_or_others_are_named(recorded):
    file = recorded(axes([50.0, -60.0], [50.0, 50.0], [50.0, 130.0], [52.0, 131.0]), {"/chart": 1.0})
    assert touching_words(file, ["/chart"]) == [("/chart", "frame", "2"), ("/chart", "3", "4")]


def test_axes_without_labels_fail(recorded):
    with pytest.raises(AssertionError, match="/chart: no labels"):
        touching_words(recorded({"/chart/grid": FRAME}, {"/chart": 1.0}), ["/chart"])


def test_axes_in_no_view_fail_unless_they_are_named(recorded):
    entities = axes([50.0, 130.0]) | {"/hidden/grid": FRAME}
    file = recorded(entities, {"/chart": 1.0})
    with pytest.raises(AssertionError, match="/hidden: views"):
        touching_words(file, ["/chart"])
    assert not touching_words(file, ["/chart"], not_in_layout=["/hidden"])
    with pytest.raises(AssertionError, match="/chart: views"):
        touching_words(file, ["/chart"], not_in_layout=["/hidden", "/chart"])


@pytest.mark.parametrize("charts", [[], ["/chart"], ["/front", "/chart"]])
def test_charts_without_flat_axes_fail(recorded, charts):
    entities = {"/chart/grid": FRAME, "/front/grid": FRAME, "/front/labels": axes([50.0, 130.0])["/chart/labels"]}
    with pytest.raises(AssertionError, match="no axes measured"):
        touching_words(recorded(entities, {"/chart": NAN, "/front": 1.0}), charts)
