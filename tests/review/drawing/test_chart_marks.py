"""Marks of charts: curves are visible with any number of points, and their names are at their ends."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st

from paretoik.review.drawing.axes import TEXT
from paretoik.review.drawing.charts import Chart, _spread_labels
from paretoik.review.palette import SCREEN
from tests.review.reading import read, static_values

gaps = st.floats(0.5, 4.0)
ends = st.lists(st.floats(0, 30), min_size=1, max_size=9)


def test_a_curve_of_one_point_is_a_dot_in_its_colour(tmp_path):
    instants = np.array([0.0, 0.5, 1.0, 2.0])
    curves = np.array([[3.0, 2.0, np.nan, np.nan], [np.nan, np.nan, 1.0, np.nan], [np.nan] * 4])
    chart = Chart(
        entity="chart",
        title="best",
        labels=("level", "best"),
        shown=np.stack([np.tile(instants, 3), curves.ravel()], axis=1),
        names=["26 samples", "51 samples", "101 samples"],
        colours=[SCREEN.joint(number) for number in range(3)],
    )
    with rr.RecordingStream("paretoik-test") as stream:
        stream.save(tmp_path / "chart.rrd")
        chart.draw(stream, instants, curves, static=True)
    batches = read(tmp_path / "chart.rrd")["/chart/curves"]
    (dot,) = static_values(batches, "positions")
    np.testing.assert_allclose(dot, chart.canvas.place(np.array([1.0, 1.0])), rtol=1e-6)
    (column,) = [name for name in batches[-1].schema.names if name == "Points2D:colors"]
    (colour,) = batches[-1].column(column).to_pylist()[-1]
    assert colour == int.from_bytes(bytes(SCREEN.joint(1)), "big")
    (column,) = [name for name in batches[-1].schema.names if name == "LineStrips2D:strips"]
    assert [len(strip) for strip in batches[-1].column(column).to_pylist()[-1]] == [2, 1, 0]


@given(ends, gaps)
def test_a_name_leaves_the_end_of_its_curve_only_for_a_neighbour_that_it_touches(places, gap):
    moved = np.array(_spread_labels(places, gap=gap))
    for number, (place, at) in enumerate(zip(places, moved, strict=True)):
        others = np.delete(moved, number)
        assert at == pytest.approx(place) or np.isclose(np.abs(others - at), gap, atol=1e-6).any()


@given(ends, ends, gaps)
def test_names_that_crowd_each_other_move_none_that_are_far_from_them(places, others, gap):
    far = 1000.0
    together = _spread_labels([*places, *(far + other for other in others)], gap=gap)
    np.testing.assert_allclose(together[: len(places)], _spread_labels(places, gap=gap), atol=1e-9)
    at = np.sort(together[len(places) :]) - far
    np.testing.assert_allclose(at, np.sort(_spread_labels(others, gap=gap)), atol=1e-6)


@given(ends)
def test_names_that_crowd_each_other_have_the_middle_that_their_ends_have(places):
    crowd = 0.01 * np.array(places)
    moved = _spread_labels(list(crowd), gap=1.0)
    assert np.mean(moved) == pytest.approx(np.mean(crowd))


@given(st.lists(st.floats(0, 30), min_size=1, max_size=8))
def test_names_are_between_the_highest_and_the_lowest_place(places):
    moved = np.array(_spread_labels(places, gap=4.0, highest=-1.0, lowest=29.0))
    assert moved.min() >= -1.0 - 1e-9
    assert moved.max() <= 29.0 + 1e-9
    assert (np.diff(moved[np.argsort(places, kind="stable")]) >= 4.0 - 1e-9).all()


def test_a_single_name_is_at_the_end_of_its_curve(tmp_path):
    instants, values = np.array([0.0, 1.0]), np.array([[4.7] * 2, [-1.0] * 2, [-1.5] * 2, [-2.0] * 2, [-6.0] * 2])
    chart = Chart(
        entity="chart",
        title="joint position",
        labels=("time [s]", "joint position [rad]"),
        shown=np.stack([np.tile(instants, 5), values.ravel()], axis=1),
        names=["shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_3_joint", "wrist_2_joint"],
        colours=[SCREEN.joint(number) for number in range(5)],
    )
    with rr.RecordingStream("paretoik-test") as stream:
        stream.save(tmp_path / "chart.rrd")
        chart.draw(stream, instants, values, static=True)
    names = static_values(read(tmp_path / "chart.rrd")["/chart/names"], "positions")
    heights = chart.canvas.place(np.array([(1.0, each[-1]) for each in values]))[:, 1]
    for number in (0, 4):
        assert names[number][1] + TEXT.drop == pytest.approx(heights[number], abs=1e-3)
