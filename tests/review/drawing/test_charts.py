"""Charts: axes independent of units and rounding, curves visible with any number of points, names at their ends."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from paretoik.review.drawing.charts import Chart, LimitLine
from paretoik.review.drawing.motion import joint_charts
from paretoik.review.palette import SCREEN
from paretoik.review.recording.messages import Workcell
from paretoik.robot.arms import marcos_nr, tringali_3r
from paretoik.task.motion import Motion
from tests.review.reading import drawn_labels

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
