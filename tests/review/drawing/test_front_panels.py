"""The panels of pairs of objectives: no number or name covers another, for any values."""

from __future__ import annotations

from itertools import chain, combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.review.drawing.axes import TEXT, Canvas, text_width
from paretoik.review.drawing.front_panels import Panels, bounds_in
from tests.review.view_sizes import label_halves


def boxes(canvases) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Return the words of all panels with the corners of the areas that they cover."""
    each, places = zip(*(canvas._labels(*canvas._ticks()) for canvas in canvases), strict=True)
    words, middles = list(chain.from_iterable(each)), np.concatenate(places)
    halves = label_halves(words)
    return list(zip(words, middles - halves, middles + halves, strict=True))


def random_points(rng: np.random.Generator, count: int) -> np.ndarray:
    low = rng.uniform(-1.0, 1.0, count) * 10.0 ** rng.integers(-3, 3, count)
    return low + 10.0 ** rng.uniform(-2.0, 2.0, count) * rng.random((5, count))


@pytest.mark.parametrize("count", [2, 3])
def test_no_number_or_name_of_a_panel_covers_another(count):
    rng = np.random.default_rng(0)
    panels = Panels(labels=tuple(f"objective{k} [J s]" for k in range(count)))
    for _ in range(200):
        covers = boxes(panels.canvases(random_points(rng, count)))
        for (word, low, high), (other, bottom, top) in combinations(covers, 2):
            assert (np.minimum(high, top) - np.maximum(low, bottom)).min() <= 1e-9, (word, other)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_an_axis_has_numbers_one_for_every_line_of_its_grid(count):
    rng = np.random.default_rng(2)
    panels = Panels(labels=tuple(f"objective{k} [J s]" for k in range(count)))
    for _ in range(200):
        for canvas in panels.canvases(random_points(rng, count)):
            across, _ = ticks = canvas._ticks()
            _, places = canvas._labels(*ticks)
            lines = canvas.place(np.stack([across, np.full(len(across), canvas.low[1])], axis=-1))[:, 0]
            foot = canvas.origin[1] + canvas.height
            numbers = places[(places[:, 1] > foot) & (places[:, 1] < foot + TEXT.line), 0]
            assert len(lines)
            assert numbers.tolist() == (lines.tolist() if canvas.ticked[0] else [])


def test_a_panel_of_two_objectives_has_a_number_at_the_edge_of_its_frame():
    (canvas,) = Panels(labels=("energy [J s]", "torque [N m]")).canvases(np.array([[0.03914, 1.0], [0.04198, 2.0]]))
    across, _ = canvas._ticks()
    np.testing.assert_allclose(across, [0.039, 0.04, 0.041, 0.042])


# The bounds ε of a panel: the words of each are next to its line, off the other line and its words.


NAMES = (("energy", "J s"), ("torque", "N²m²s"))
shares = st.floats(0.0, 1.0)


def corners(bound) -> tuple[np.ndarray, np.ndarray]:
    half = 0.5 * np.array([text_width(bound.words), 0.8 * TEXT.line])
    return bound.middle - half, bound.middle + half


@pytest.mark.parametrize("size", [(500.0, 390.0), (240.0, 180.0)])
@given(first=shares, second=shares, maximised=st.tuples(st.booleans(), st.booleans()))
def test_the_words_of_two_crossing_bounds_are_readable(size, first, second, maximised):
    canvas = Canvas(low=np.zeros(2), high=np.ones(2), labels=("x", "y"), width=size[0], height=size[1])
    bounds = bounds_in(canvas, np.array([first, second]), NAMES, maximised)
    (low, high), (bottom, top) = map(corners, bounds)
    assert (np.minimum(high, top) - np.maximum(low, bottom)).min() <= 0  # the words do not cover each other
    for bound, (least, most) in zip(bounds, map(corners, bounds), strict=True):
        assert (least >= 0).all()
        assert (most <= size).all()
        for axis, line in enumerate(bounds if size[0] == 500.0 else ()):  # a narrow panel has no space off the lines
            assert not least[axis] < line.ends[0, axis] < most[axis], (bound.words, line.words)
