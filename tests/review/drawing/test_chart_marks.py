"""Marks of charts: curves are visible with any number of points, and their names are at their ends."""

from __future__ import annotations

import numpy as np
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st

from paretoik.review.drawing.axes import TEXT, text_width
from paretoik.review.drawing.charts import Chart
from paretoik.review.palette import SCREEN
from tests.review.reading import Drawn, read, static_values


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


@given(st.lists(st.integers(0, 300), min_size=2, max_size=9, unique=True))
def test_names_of_curves_keep_their_order_and_cover_neither_each_other_nor_the_ticks(ends):
    values, stream = np.array(ends)[:, None] * np.ones(2), Drawn()
    names, colours = [f"curve {number}" for number in range(len(ends))], [SCREEN.text] * len(ends)
    chart = Chart.over("time [s]", "chart", "position", np.arange(2.0), values, colours, names=names)
    chart.draw(stream, chart.instants, values)
    places = np.array(stream.drawn["charts/chart/names"][0].positions.as_arrow_array().to_pylist())
    (x, y), order = places.T, np.argsort(-values[:, 0], kind="stable")
    assert (np.diff(y[order]) >= -1e-3).all()
    for one in range(len(ends)):
        for other in range(one):
            assert abs(y[one] - y[other]) >= TEXT.line - 1e-3 or abs(x[one] - x[other]) >= text_width("curve 0")
    assert y.max() + TEXT.drop <= chart.canvas.height
