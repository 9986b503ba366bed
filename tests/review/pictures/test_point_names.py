"""Names of points in pictures of fronts."""

from __future__ import annotations

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from paretoik.review.palette import PAPER
from paretoik.review.pictures.fronts import NAMES, NamedPoint, name_place, name_points

SIZE = np.array([300.0, 200.0])
HALF = np.array([12.0, 5.0])
places = st.tuples(st.floats(20, 280), st.floats(10, 190))


@given(places, st.lists(places, max_size=60))
def test_a_name_lies_in_its_axes_and_on_nothing_where_a_place_is_free(mark, others):
    taken = np.array([mark, *others])
    middle = name_place(np.array(mark), HALF, taken, SIZE)
    assert (middle - HALF >= -1e-9).all()
    assert (middle + HALF <= SIZE + 1e-9).all()
    grid = np.stack(np.meshgrid(*(np.linspace(h, s - h, NAMES.grid) for h, s in zip(HALF, SIZE, strict=True))), axis=-1)
    free = [not (np.abs(taken - place) < HALF + NAMES.gap).all(axis=1).any() for place in grid.reshape(-1, 2)]
    if any(free):
        assert not (np.abs(taken - middle) < HALF).all(axis=1).any()


@pytest.mark.parametrize("crowd", [0, 400])
def test_no_two_names_lie_on_each_other_and_what_is_far_off_is_joined(crowd):
    chance = np.random.default_rng(4)
    points = np.concatenate([[(0.5, 0.5), (0.502, 0.5), (0.5, 0.503)], chance.uniform(0, 1, (crowd, 2))])
    with matplotlib.rc_context(PAPER.style):
        figure = Figure(figsize=(4.2, 3.4), dpi=125)
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        axes.plot(*points.T, linestyle="none", marker="o", markersize=2.0)
        axes.set(xlim=(0, 1), ylim=(0, 1))
        name_points(axes, points, [NamedPoint(row=row, name=f"100{row}", colour="k") for row in range(3)])
        figure.draw_without_rendering()
    boxes = [Text.get_window_extent(text) for text in axes.texts]  # without the lines to their marks
    assert [text.get_text() for text in axes.texts] == ["1000", "1001", "1002"]
    assert not any(one.overlaps(other) for i, one in enumerate(boxes) for other in boxes[:i])
    for text, box in zip(axes.texts, boxes, strict=True):
        mark = axes.transData.transform(text.xy)
        gap = np.linalg.norm(
            np.maximum(
                np.abs(mark - [box.x0 + box.width / 2, box.y0 + box.height / 2]) - [box.width / 2, box.height / 2], 0.0
            )
        )
        assert text.arrow_patch is not None or gap <= (NAMES.leader + NAMES.character) * 125 / 72
