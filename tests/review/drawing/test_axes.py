"""Axes: ticks, windows and names."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.review.drawing.axes import TEXT, Canvas, nice_ticks, text_width, window
from tests.review.reading import drawn_labels


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 8))
@settings(max_examples=40)
def test_ticks_are_even_round_and_inside(low, span, count):
    high = low + span
    ticks = nice_ticks(low, high, count=count)
    slack = 1e-8 * span + 1e-12 * abs(low)
    assert ((ticks >= low - slack) & (ticks <= high + slack)).all()
    assert len(ticks) <= count + 2
    if len(ticks) > 1:
        step = ticks[1] - ticks[0]
        leading = step / 10 ** np.floor(np.log10(step * 1.0000001))
        assert np.isclose(leading, [1, 2, 5, 10], rtol=1e-3).any()
        assert np.allclose(np.diff(ticks), step, rtol=1e-3)


@given(st.lists(st.tuples(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9)), min_size=1, max_size=8))
@settings(max_examples=40)
def test_a_window_shows_all_its_points(points):
    points = np.array(points)
    low, high = window(points)
    canvas = Canvas(low=low, high=high, labels=("x", "y"))
    assert canvas.shows(points).all()
    placed = canvas.place(points)
    assert ((placed >= 0) & (placed <= [canvas.width, canvas.height])).all()


def test_the_second_axis_points_up():
    canvas = Canvas(low=np.zeros(2), high=np.ones(2), labels=("x", "y"), width=140.0, height=100.0)
    assert canvas.place(np.array([0.0, 0.0])).tolist() == [0.0, 100.0]
    assert canvas.place(np.array([1.0, 1.0])).tolist() == [140.0, 0.0]


@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(0.01, 1e3), st.floats(0.01, 1e3))
@settings(max_examples=40)
def test_no_label_of_a_tick_covers_another(left, bottom, across, upwards):
    low = np.array([left, bottom])
    canvas = Canvas(low=low, high=low + np.array([across, upwards]), labels=("x", "y"), width=430.0, height=130.0)
    words, middles = drawn_labels(canvas)
    halves = np.array([0.5 * text_width(word) + 0.5 * TEXT.padding for word in words])
    for i in range(len(words)):
        for k in range(i):
            distance = np.abs(middles[i] - middles[k])
            assert distance[0] >= halves[i] + halves[k] or distance[1] >= 0.8 * TEXT.line, (words[k], words[i])
