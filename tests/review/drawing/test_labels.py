"""Places of labels."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st

from paretoik.review.drawing.axes import TEXT, Canvas, text_width
from paretoik.review.drawing.front_panels import LAYERS, log_ends, ring_radii
from paretoik.review.drawing.labels import (
    half_size,
    joined_label,
    joined_label_place,
    label_place,
    line_points,
    plate_half,
    separate_label_places,
)
from paretoik.review.outlines import NO_LINES, count_crossed, count_touched
from paretoik.review.palette import MARKS
from paretoik.review.recording.messages import RecordedPoint
from tests.review.reading import read, rows

CANVAS = Canvas(low=np.zeros(2), high=np.array([500.0, 390.0]), labels=("x", "y"))
HALF = np.array([0.5 * 6.5 * 8, 10.0])  # of a word of eight letters, as the viewer draws it
places = st.tuples(st.floats(0, 500), st.floats(0, 390))


@given(places, st.lists(places, max_size=30))
def test_a_label_is_whole_inside_its_frame_and_off_its_mark(mark, others):
    at = label_place(CANVAS, np.array(mark), "point 29", np.array([mark, *others]))
    assert (at - HALF >= 0).all()
    assert (at + HALF <= (500, 390)).all()
    assert (np.abs(at - mark) >= HALF).any()


@given(places)
def test_a_label_covers_no_mark_where_one_side_is_free(mark):
    crowd = np.array([(x, y) for x in range(0, 500, 20) for y in range(0, 390, 10) if x < mark[0] or x > mark[0] + 150])
    wide = Canvas(low=np.zeros(2), high=np.array([700.0, 390.0]), labels=("x", "y"), width=700.0)
    at = label_place(wide, np.array(mark), "point 29", crowd.reshape(-1, 2).astype(float))
    assert not (np.abs(crowd - at) < HALF).all(axis=1).any()


@given(places, st.integers(0, 400))
def test_a_joined_label_stands_on_nothing_even_where_dots_fill_the_frame(mark, side_room):
    crowded = Canvas(low=CANVAS.low, high=CANVAS.high, labels=("x", "torque_norm [N²m²s]"), side_room=side_room)
    crowd = np.array([(x, y) for x in range(0, 501, 16) for y in range(0, 391, 10)], dtype=float)
    at, half = joined_label_place(crowded, np.array(mark), "point 29", crowd), half_size("point 29")
    assert not (np.abs(crowd - at) < half).all(axis=1).any()
    title_end = crowded.upper_label_middle[0] + 0.5 * text_width(crowded.labels[1])
    assert at[0] - half[0] >= title_end  # nor on the vertical axis label
    assert at[0] + half[0] <= 500 + side_room


@given(st.lists(places, min_size=2, max_size=3), st.lists(places, max_size=4))
def test_labels_of_marks_in_one_place_cover_neither_each_other_nor_leave_the_frame(marks, others):
    words = ["position", "direction 1", "direction 2"][: len(marks)]
    marks, others = np.array([marks[0], *marks[:-1]]), np.array(others).reshape(-1, 2)
    middles = separate_label_places(CANVAS, marks, words, others)
    for row, word in enumerate(words):
        assert (middles[row] >= plate_half(word)).all()
        assert (middles[row] <= np.array([500.0, 390.0]) - plate_half(word)).all()
        for other in range(row):
            distance = np.abs(middles[row] - middles[other])
            assert (distance >= plate_half(word) + plate_half(words[other])).any()


@given(places, st.lists(places, max_size=200))
def test_a_label_is_next_to_its_mark_or_a_line_joins_them(mark, others):
    words, mark = "point 29\nbest torque_norm", np.array(mark)
    label, line = joined_label(CANVAS, mark, words, np.array([mark, *others]), (255, 255, 255, 255))
    middle, half = joined_label_place(CANVAS, mark, words, np.array([mark, *others])), half_size(words)
    gap = float(np.linalg.norm(np.maximum(np.abs(mark - middle) - half, 0.0)))
    strips = line.strips.as_arrow_array().to_pylist()
    assert label.labels.as_arrow_array().to_pylist() == [words]
    assert bool(strips) == (gap > MARKS.leader)
    for start, end in strips:
        np.testing.assert_allclose(start, mark, atol=1e-3)
        assert (np.abs(np.array(end) - middle) <= half + 1e-3).all()


PLATES = {  # width and height in pictures of the viewer [pixels]
    "point 2293": (75.0, 23.0),
    "point 1937": (75.0, 23.0),
    "best kinetic_energy\nbest joint_limit_distance": (150.5, 38.0),
}


@pytest.mark.parametrize("words", PLATES)
def test_a_plate_is_as_large_as_the_viewer_draws_it(words):
    np.testing.assert_allclose(2 * plate_half(words), PLATES[words], atol=2.0)


@pytest.mark.parametrize("words", PLATES)
@pytest.mark.parametrize("size", [(504.0, 414.0), (246.0, 181.0)], ids=["of two objectives", "of three objectives"])
@given(share=st.tuples(st.floats(0, 1), st.floats(0, 1)), crowd=st.integers(6, 40), scale=st.floats(0.95, 1.0))
def test_the_plate_of_a_label_touches_neither_the_frame_nor_the_name_of_the_axis(size, words, share, crowd, scale):
    """The view's unit is ``scale`` pixels; the plate keeps its size, below the label's point."""
    name = "speed_2 [m/s] ↑"
    canvas = Canvas(low=np.zeros(2), high=np.array(size), labels=("x", name), width=size[0], height=size[1])
    dots = np.array([(x, y) for x in range(0, int(size[0]), 2 * crowd) for y in range(0, int(size[1]), crowd)], float)
    label, line = joined_label(canvas, np.array(share) * size, words, dots, (255, 255, 255, 255))
    drop, half = TEXT.drop + 7.5 * words.count("\n"), 0.5 * np.array(PLATES[words])
    middle = scale * np.array(label.positions.as_arrow_array().to_pylist()[0]) + (0.0, drop)
    low, high = middle - half, middle + half
    title = scale * (canvas.upper_label_middle - (0.0, TEXT.drop)) + (0.0, TEXT.drop)
    is_inside = (low >= 1.0).all() and (high <= scale * np.array(size) - 1.0).all()
    assert is_inside or (high[1] < 0.0 and low[0] > title[0] + 56.0 + 6.0)  # half the width of its plate
    for _, tip in line.strips.as_arrow_array().to_pylist():
        depth = (half - np.abs(scale * np.array(tip) - middle)).min()
        assert -1.0 <= depth <= 6.0


corners = st.tuples(st.integers(0, 20), st.integers(0, 20))


def cross(a, b, c, d) -> bool:
    """Return whether the lines a to b and c to d cross, from the exact shares of both at the crossing."""
    (ux, uy), (vx, vy), (wx, wy) = ((q[0] - p[0], q[1] - p[1]) for p, q in ((a, b), (c, d), (a, c)))
    whole = ux * vy - uy * vx
    shares = () if whole == 0 else (Fraction(wx * vy - wy * vx, whole), Fraction(wx * uy - wy * ux, whole))
    return bool(shares) and all(0 < share < 1 for share in shares)


@given(corners, st.lists(corners, min_size=1, max_size=5), st.lists(st.tuples(corners, corners), max_size=5))
def test_the_lines_that_are_crossed_are_counted(start, ends, lines):
    counted = count_crossed(np.array(start, float), np.array(ends, float), np.array(lines, float).reshape(-1, 2, 2))
    assert counted.tolist() == [sum(cross(start, end, *line) for line in lines) for end in ends]


def test_the_line_to_a_label_goes_round_that_of_another_label():
    named = Canvas(low=CANVAS.low, high=CANVAS.high, labels=("x", "torque_norm [N²m²s]"))
    crowd = np.array([(x, y) for x in range(0, 501, 16) for y in range(0, 391, 10)], dtype=float)
    mark, wall = np.array([15.0, 60.0]), np.array([[60.0, -40.0], [60.0, 35.0]])
    straight, detour = (joined_label_place(named, mark, "point 29", crowd, lines) for lines in (NO_LINES, wall[None]))
    assert _is_crossed(mark, straight, wall)
    assert not _is_crossed(mark, detour, wall)


def _is_crossed(mark: np.ndarray, middle: np.ndarray, wall: np.ndarray) -> bool:
    half = half_size("point 29")
    return bool(count_crossed(mark, np.clip(mark, middle - half, middle + half)[None], wall[None])[0])


@given(st.lists(st.tuples(places, places), min_size=1, max_size=4))
def test_no_label_lies_between_two_points_of_a_line(ends):
    lines = np.array(ends)
    narrow = 2 * half_size("best") + 8.0  # free space around a label
    for line in lines:
        steps = np.diff(line_points(line[None]), axis=0)
        assert (np.abs(steps) <= narrow).all()


def test_best_points_that_are_one_are_rings_around_each_other_with_both_names(tmp_path):
    ends = [(0, 4), (1, 7), (2, 4), (None, 7)]
    points = [RecordedPoint(axis=axis, id=id, objectives=np.zeros(2), motion=None) for axis, id in ends]
    at = np.array([(100.0, 100.0), (300.0, 300.0), (100.0, 100.0), (300.0, 300.0)])
    with rr.RecordingStream("paretoik-test") as stream:
        stream.save(tmp_path / "ends.rrd")
        stream.set_time("generation", sequence=1)
        log_ends(stream, ["front"], CANVAS, at, points, ("energy", "torque", "way"), at, of=" of level 1")
    entities = read(tmp_path / "ends.rrd")
    radii = rows(entities["/front/ends"], "generation", "radii")[1]
    np.testing.assert_allclose(
        -radii, [MARKS.end + MARKS.ring, MARKS.end + MARKS.ring, MARKS.end]
    )  # in pixels: negative
    assert rows(entities["/front/ends/names_0"], "generation", "labels")[1].tolist() == ["best energy\nbest way"]
    hovered = rows(entities["/front/ends"], "generation", "labels")[1].tolist()
    both = "point 4 of level 1, best energy, best way"
    assert hovered == [both, "point 7 of level 1, best torque", both]


@given(st.lists(places, min_size=2, max_size=5), st.data())
def test_the_mark_of_every_best_point_is_seen_whatever_lies_on_it(at, data):
    near = data.draw(st.lists(st.integers(0, len(at) - 1), min_size=2, max_size=4))
    at = np.array([at[place] for place in near])  # some in the same place
    marks, chosen = list(range(len(at) - 1)), [len(at) - 1]
    radii = ring_radii(at, marks, chosen)
    for row in marks:
        for above in range(row + 1, len(at)):
            if np.linalg.norm(at[row] - at[above]) == 0:
                assert radii[row] > (radii[above] if above in marks else LAYERS["chosen"][1])


@given(corners, st.lists(corners, min_size=1, max_size=5), st.lists(corners, max_size=8))
def test_a_line_that_leads_away_from_a_mark_never_touches_it(start, ends, marks):
    start, ends, marks = np.array(start, float), np.array(ends, float), np.array(marks, float).reshape(-1, 2)
    shares = np.linspace(0.0, 1.0, 2001)[:, None]
    for end, touched in zip(ends, count_touched(start, ends, marks, reach=3.0), strict=True):
        distances = np.linalg.norm((start + shares * (end - start))[:, None] - marks, axis=2)
        bound = np.minimum(3.0, distances[0])
        assert (distances.min(axis=0, initial=np.inf) < bound - 0.01).sum() <= touched
        assert touched <= (distances.min(axis=0, initial=np.inf) < bound + 0.01).sum()
        assert touched <= ((marks - start) @ (end - start) > 0).sum()


def test_the_line_to_a_label_begins_away_from_a_mark_that_touches_its_own():
    mark, neighbour = np.array([250.0, 200.0]), np.array([254.0, 204.0])
    ring = neighbour + 45.0 * np.array([(np.cos(turn), np.sin(turn)) for turn in np.linspace(0, 2 * np.pi, 40)])
    others = np.concatenate([[mark, neighbour], ring[::3]])
    middle, half = joined_label_place(CANVAS, mark, "point 130", others), half_size("point 130")
    end = np.clip(mark, middle - half, middle + half)[None]
    assert np.linalg.norm(end - mark) > MARKS.leader
    assert count_touched(mark, end, others, MARKS.end)[0] == 0
