"""Axes: ticks, windows, names, and parallel coordinates."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st

from paretoik.review.drawing.axes import TEXT, Canvas, ParallelAxes, equal_window, nice_ticks, text_width, window
from paretoik.review.drawing.charts import _spread_labels
from paretoik.review.drawing.layout import BULLET
from tests.review.reading import read, static_values, static_words


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6), st.integers(2, 8))
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
def test_a_window_shows_all_its_points(points):
    points = np.array(points)
    low, high = window(points)
    canvas = Canvas(low=low, high=high, labels=("x", "y"))
    assert canvas.shows(points).all()
    placed = canvas.place(points)
    assert ((placed >= 0) & (placed <= [canvas.width, canvas.height])).all()


def test_nan_points_are_never_shown():
    canvas = Canvas(low=np.zeros(2), high=np.ones(2), labels=("x", "y"))
    points = np.array([[0.5, 0.5], [np.nan, 0.5], [np.inf, 0.5], [2.0, 0.5]])
    assert canvas.shows(points).tolist() == [True, False, False, False]


def test_the_second_axis_points_up():
    canvas = Canvas(low=np.zeros(2), high=np.ones(2), labels=("x", "y"), width=140.0, height=100.0)
    assert canvas.place(np.array([0.0, 0.0])).tolist() == [0.0, 100.0]
    assert canvas.place(np.array([1.0, 1.0])).tolist() == [140.0, 0.0]


def test_an_equal_window_keeps_shapes():
    low, high = equal_window(np.array([[0.0, 0.0], [1.0, 7.0]]), width=140.0, height=100.0)
    assert (high - low)[0] / (high - low)[1] == pytest.approx(1.4)


def test_a_canvas_is_kept_while_points_fill_half_of_it():
    canvas = Canvas(low=np.zeros(2), high=np.ones(2), labels=("x", "y"))
    assert canvas.fits(np.array([[0.1, 0.1], [0.9, 0.9]]))
    assert not canvas.fits(np.array([[0.1, 0.1], [0.4, 0.9]]))
    assert not canvas.fits(np.array([[0.1, 0.1], [1.1, 0.9]]))


@given(st.lists(st.floats(0, 30), min_size=1, max_size=9))
def test_names_are_pushed_apart_and_keep_their_order(places):
    moved = np.array(_spread_labels(places, gap=2.0))
    order = np.argsort(places, kind="stable")
    assert (np.diff(moved[order]) >= 2.0 - 1e-9).all()


@given(st.lists(st.floats(0, 30), min_size=1, max_size=9))
def test_no_name_is_further_down_than_the_lowest_place(places):
    moved = np.array(_spread_labels(places, gap=2.0, lowest=20.0))
    assert moved.max() <= 20.0 + 1e-9
    order = np.argsort(places, kind="stable")
    assert (np.diff(moved[order]) >= 2.0 - 1e-9).all()


@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(0.01, 1e3), st.floats(0.01, 1e3))
def test_no_label_of_a_tick_covers_another(left, bottom, across, upwards):
    low = np.array([left, bottom])
    canvas = Canvas(low=low, high=low + np.array([across, upwards]), labels=("x", "y"), width=430.0, height=130.0)
    words, middles = canvas._labels(*canvas._ticks())
    halves = np.array([0.5 * text_width(word) + 0.5 * TEXT.padding for word in words])
    for i in range(len(words)):
        for k in range(i):
            distance = np.abs(middles[i] - middles[k])
            assert distance[0] >= halves[i] + halves[k] or distance[1] >= 0.8 * TEXT.line, (words[k], words[i])


# Parallel coordinates: every tick has its number, and lines have the colours of the legend.


@pytest.mark.parametrize("n_obj", [3, 4, 5])
def test_every_tick_has_the_number_of_the_value_that_a_line_has_there(tmp_path, n_obj):
    rng = np.random.default_rng(0)
    F = 10.0 ** rng.uniform(-3.0, 3.0, n_obj) * rng.uniform(-1.0, 1.0, (12, n_obj))
    names = tuple(f"objective {number}" for number in range(n_obj))
    axes = ParallelAxes.around("parallel", names, F)
    with rr.RecordingStream("paretoik-test") as stream:
        stream.save(tmp_path / "axes.rrd")
        axes.log(stream, static=True)
    entities = read(tmp_path / "axes.rrd")
    strips = np.array(static_values(entities["/parallel/axes/lines"], "strips"))
    upright = strips[:, 0, 0] == strips[:, 1, 0]
    across, ticks = strips[upright][:, 0, 0], strips[~upright].mean(axis=1)
    words = static_words(entities["/parallel/axes/labels"])
    middles = np.array(static_values(entities["/parallel/axes/labels"], "positions")) + np.array([0.0, TEXT.drop])
    numbers = [(word, middle) for word, middle in zip(words, middles, strict=True) if word not in names]
    assert len(numbers) == len(ticks)
    for axis, x in enumerate(across):
        on_axis = ticks[ticks[:, 0] == x]
        assert len(on_axis) >= 2
        for place in on_axis:
            word, _ = min(numbers, key=lambda each, place=place: float(np.linalg.norm(each[1] - place)))
            share = (float(word) - axes.low[axis]) / (axes.high[axis] - axes.low[axis])
            height = strips[upright][0].max()
            assert place[1] == pytest.approx((1.0 - share) * height, abs=0.02 * height)


@pytest.mark.parametrize("ends", [(721.3, 1629.4), (0.0502, 0.124), (-0.04, 1.04)])
def test_inner_axes_end_in_round_numbers_near_the_values(ends):
    F = np.repeat(np.array(ends)[:, None], 3, axis=1)
    axes = ParallelAxes.around("parallel", ("a", "b", "c"), F)
    low, high = axes.low[1], axes.high[1]
    assert low < ends[0] < ends[1] < high
    assert high - low < 1.3 * (ends[1] - ends[0])
    assert all(len(f"{end:.6g}".strip("-0.").replace(".", "")) <= 3 for end in (low, high))


@pytest.fixture(scope="module")
def recordings(choice_recordings):
    return tuple(map(read, choice_recordings))


def colours(batches: list) -> set[int]:
    """Return the colours of an entity at all times."""
    return {
        colour
        for batch in batches
        for name in batch.schema.names
        if name.endswith(":colors")
        for row in batch.column(name).to_pylist()
        for colour in row or ()
    }


def legend(entities, origin: str) -> dict[str, int]:
    words = [word.removeprefix(BULLET) for word in static_words(entities[f"{origin}/words"])]
    return dict(zip(words, static_values(entities[f"{origin}/words"], "colors"), strict=True))


@pytest.mark.parametrize(
    ("layer", "name"),
    [("front", "front"), ("final", "final front"), ("chosen", "compromise"), ("looked_at", "point looked at")],
)
def test_lines_have_the_colour_of_the_legend(recordings, layer, name):
    recording, _ = recordings
    assert colours(recording[f"/parallel/{layer}"]) == {legend(recording, "/legend")[name]}


def test_lines_next_to_a_choice_have_the_colour_of_its_legend(recordings):
    _, chosen = recordings
    entries = legend(chosen, "/choice/legend")
    assert colours(chosen["/choice/parallel/front"]) == {entries["front"]}
    (name,) = [word for word in entries if word.startswith("point ")]
    assert colours(chosen["/choice/parallel/choice"]) == {entries[name]}
