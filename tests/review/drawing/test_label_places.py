"""Places of labels."""

from __future__ import annotations

import numpy as np
import rerun as rr
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.review.drawing.axes import Canvas, text_width
from paretoik.review.drawing.label_places import half_size, joined_labels, label_area, label_place, plate_half
from paretoik.review.drawing.scatter import Scatter
from paretoik.review.palette import MARKS
from paretoik.review.recording.messages import RecordedPoint
from paretoik.review.recording.recorder import SearchedFront
from tests.review.reading import read, rows

CANVAS = Canvas(low=np.zeros(2), high=np.array([500.0, 390.0]), labels=("x", "y"))
HALF = np.array([0.5 * 6.5 * 8, 10.0])  # of a word of eight letters, as the viewer draws it
places = st.tuples(st.floats(0, 500), st.floats(0, 390))


@given(places, st.lists(places, max_size=30))
@settings(max_examples=30)
def test_a_label_is_whole_inside_its_frame_and_off_its_mark(mark, others):
    at = label_place(CANVAS, np.array(mark), "point 29", np.array([mark, *others]), is_joined=False)
    assert (at - HALF >= 0).all()
    assert (at + HALF <= (500, 390)).all()
    assert (np.abs(at - mark) >= HALF).any()


@given(places)
@settings(max_examples=30)
def test_a_label_covers_no_mark_where_one_side_is_free(mark):
    crowd = np.array([(x, y) for x in range(0, 500, 20) for y in range(0, 390, 10) if x < mark[0] or x > mark[0] + 150])
    wide = Canvas(low=np.zeros(2), high=np.array([700.0, 390.0]), labels=("x", "y"), width=700.0)
    at = label_place(wide, np.array(mark), "point 29", crowd.reshape(-1, 2).astype(float))
    assert not (np.abs(crowd - at) < HALF).all(axis=1).any()


@given(places, st.integers(0, 400))
@settings(max_examples=30)
def test_a_joined_label_covers_nothing_even_if_dots_fill_the_frame(mark, side_room):
    crowded = Canvas(low=CANVAS.low, high=CANVAS.high, labels=("x", "torque_norm [N²m²s]"), side_room=side_room)
    crowd = np.array([(x, y) for x in range(0, 501, 16) for y in range(0, 391, 10)], dtype=float)
    at, half = label_place(crowded, np.array(mark), "point 29", crowd), half_size("point 29")
    assert not (np.abs(crowd - at) < half).all(axis=1).any()
    title_end = crowded.upper_label_middle[0] + 0.5 * text_width(crowded.labels[1])
    assert at[0] - half[0] >= title_end  # nor the vertical axis label
    assert at[0] + half[0] <= 500 + side_room


@given(st.lists(places, min_size=2, max_size=3), st.lists(places, max_size=4))
@settings(max_examples=30)
def test_labels_that_avoid_earlier_ones_do_not_cover_these(marks, others):
    words, middles = ["position", "direction 1", "direction 2"][: len(marks)], list[np.ndarray]()
    taken = np.array(others).reshape(-1, 2)
    for mark, word in zip([marks[0], *marks[:-1]], words, strict=True):  # two in one place
        middles.append(label_place(CANVAS, np.array(mark), word, taken, is_joined=False))
        taken = np.concatenate([taken, label_area(middles[-1], word)])
    for row, word in enumerate(words):
        for other in range(row):
            distance = np.abs(middles[row] - middles[other])
            assert (distance >= plate_half(word) + plate_half(words[other])).any()


@given(places, st.lists(places, max_size=200))
@settings(max_examples=30)
def test_a_label_is_next_to_its_mark_or_a_line_joins_them(mark, others):
    words, mark = "point 29\nbest torque_norm", np.array(mark)
    middle, half = label_place(CANVAS, mark, words, np.array([mark, *others])), half_size(words)
    label, line = joined_labels([mark], [middle], [words], (255, 255, 255, 255))
    gap = float(np.linalg.norm(np.maximum(np.abs(mark - middle) - half, 0.0)))
    strips = line.strips.as_arrow_array().to_pylist()
    assert label.labels.as_arrow_array().to_pylist() == [words]
    assert bool(strips) == (gap > MARKS.leader)
    for start, end in strips:
        np.testing.assert_allclose(start, mark, atol=1e-3)
        assert (np.abs(np.array(end) - middle) <= half + 1e-3).all()


def test_best_points_that_coincide_are_rings_around_each_other_with_both_names(tmp_path):
    ends = [(0, 4, 0.0), (1, 7, 1.0), (2, 4, 0.0), (None, 7, 1.0)]
    points = [
        RecordedPoint(axis=axis, id=id, objectives=np.array([value, 1.0 - value, value])) for axis, id, value in ends
    ]
    F = np.array([point.objectives for point in points])
    scene = SearchedFront(names=("energy", "torque", "way"), units=("", "", ""), maximised=(False,) * 3)
    with rr.RecordingStream("paretoik-test") as stream:
        stream.save(tmp_path / "ends.rrd")
        stream.set_time("generation", sequence=1)
        scatter = Scatter(scene=scene, shown=F)
        scatter.log_marked(stream, points, of=" of level 1", avoid=scatter.area(F))
    entities = read(tmp_path / "ends.rrd")
    panel = "/front/energy\\ -\\ torque"
    radii = rows(entities[f"{panel}/ends"], "generation", "radii")[1]
    np.testing.assert_allclose(-radii, np.array([1, 1, 0]) * MARKS.ring + MARKS.end)  # in pixels: negative
    assert rows(entities[f"{panel}/ends/names"], "generation", "labels")[1].tolist() == ["best energy\nbest way"]
    hovered = rows(entities[f"{panel}/ends"], "generation", "labels")[1].tolist()
    both = "point 4 of level 1, best energy, best way"
    assert hovered == [both, "point 7 of level 1, best torque", both]
