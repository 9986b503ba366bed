"""Places of labels."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.review.drawing.axes import Canvas, text_width
from paretoik.review.drawing.label_places import half_size, joined_labels, label_place
from paretoik.review.palette import MARKS

CANVAS = Canvas(low=np.zeros(2), high=np.array([500.0, 390.0]), labels=("x", "y"))
places = st.tuples(st.floats(0, 500), st.floats(0, 390))


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
