"""Charts: axes independent of units and rounding, curves visible with any number of points, names at their ends."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from paretoik.review.drawing.axes import TEXT, text_width
from paretoik.review.drawing.charts import Chart, LimitLine, fit_below_tabs
from paretoik.review.drawing.motion import joint_charts
from paretoik.review.palette import SCREEN, VIEWS
from paretoik.review.recording.messages import Workcell
from paretoik.robot.arms import marcos_nr, tringali_3r
from paretoik.task.motion import Motion
from tests.review.reading import Drawn, drawn_labels, read, static_values

TIME = np.linspace(0.0, 2.0, 5)
KINDS = {"position": "q", "velocity": "dq", "torque": "torque"}


def chart(values, limits=(), usual=0.0, title="joint torque") -> Chart:
    lines = [
        LimitLine(instants=TIME[[0, -1]], values=np.full(2, limit), name="", colours=[SCREEN.limit]) for limit in limits
    ]
    return Chart(
        entity="chart",
        title=title,
        labels=("time [s]", title),
        shown=np.stack([TIME, values], axis=1),
        names=["joint1"],
        colours=[SCREEN.front],
        limits=lines,
        usual=usual,
    )


def ends(drawn: Chart) -> tuple[float, float]:
    return float(drawn.canvas.low[1]), float(drawn.canvas.high[1])


def numbers(largest):
    """Return numbers of either sign or 0, whose fraction of 1e-30 is still normal in every unit."""
    return st.floats(-largest, largest, allow_subnormal=False).filter(lambda number: not 0.0 < abs(number) < 1e-250)


@given(
    st.lists(numbers(3.0), min_size=5, max_size=5),
    st.lists(numbers(20.0), max_size=3),
    st.sampled_from([0.0, 1.0, 40.0]),
    st.integers(-20, 20),
)
@example([0.0] * 5, [0.0], 40.0, 1)
@example([1e-29] * 5, [], 0.0, -20)
@settings(max_examples=40)
def test_axes_are_the_same_in_every_unit(values, limits, usual, power):
    unit = 2.0**power  # exact, so that rounding decides no case
    values, limits = np.array(values), np.array(limits)
    assume(np.any(values) or np.any(limits) or usual)  # zeros have no size to draw them by
    low, high = ends(chart(values, limits, usual))
    np.testing.assert_allclose(ends(chart(unit * values, unit * limits, unit * usual)), (unit * low, unit * high))


@given(st.lists(st.floats(-1e-12, 1e-12), min_size=5, max_size=5), st.lists(st.floats(0.1, 90.0), max_size=3))
@settings(max_examples=40)
def test_rounding_is_drawn_as_zero_between_all_limits(values, limits):
    both = [*limits, *(-limit for limit in limits)]
    low, high = ends(chart(np.array(values), both, usual=1.0))
    np.testing.assert_allclose((low, high), ends(chart(np.zeros(5), both, usual=1.0)))
    assert low <= -max(limits, default=1.0) < max(limits, default=1.0) <= high


@pytest.mark.parametrize("size", [0.0, 5e-324, 1e-300, 1e-280, 1e-40, 1e40])
def test_ticks_of_a_chart_are_numbers_whatever_the_size_of_its_values(size):
    canvas = chart(size * np.array([0.0, 1.0, 0.5, 1.0, 0.0])).canvas
    words, places = drawn_labels(canvas)
    assert np.isfinite(places).all()
    assert len(words) > 5


@pytest.mark.parametrize("arm", [marcos_nr(3), tringali_3r()], ids=["without masses", "with masses"])
@pytest.mark.parametrize("duration", [0.04, 1.0, 20.0])
def test_joints_that_stand_still_look_still(arm, duration):
    time = np.linspace(0.0, duration, 41)
    still = np.array([0.3, -0.7, 1.1]) + 1e-15 * np.random.default_rng(0).normal(size=(41, 3))
    motion = Motion(arm=arm, time=time, q=still, differences="spline")
    curves = {kind: getattr(motion, name) for kind, name in {**KINDS, "acceleration": "ddq", "power": "power"}.items()}
    charts = joint_charts("", Workcell(arm=arm), [(time, curves)])
    assert ("torque" in charts) == any(body.mass > 0 for body in arm.bodies)
    for kind in charts.keys() & {"velocity", "torque"}:
        low, high = ends(charts[kind])
        assert high - low > 1e6 * np.ptp(curves[kind])


def test_charts_in_nested_tabs_are_lower_by_the_row_of_names():
    titles = ["hypervolume of all objectives", "front points, failures", "best kinetic_energy", "best torque_norm"]
    drawn = [chart(TIME, title=title) for title in titles]
    fitted = fit_below_tabs(drawn)
    assert [each.total[1] for each in fitted] == [VIEWS.chart[1]] * 2 + [VIEWS.chart[1] - VIEWS.title] * 2
    assert [each.total for each in fit_below_tabs(drawn[:2])] == [VIEWS.chart] * 2


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
@settings(max_examples=40)
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
