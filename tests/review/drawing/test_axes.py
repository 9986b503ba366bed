"""Axes: ticks, windows and names."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.review.drawing.axes import Canvas, nice_ticks, window


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
