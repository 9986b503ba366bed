"""The panels of pairs of objectives: no number or name covers another, for any values."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.review.drawing.axes import TEXT, text_width
from paretoik.review.drawing.scatter import Scatter, matrix
from paretoik.review.recording.recorder import Generation, SearchedFront
from tests.review.reading import drawn_labels


@pytest.mark.parametrize("count", [2, 3, 4])
def test_every_axis_has_numbers_and_none_covers_another(count):
    rng = np.random.default_rng(0)
    names = [f"objective{k} [J s]" for k in range(count)]
    for _ in range(20):
        low = rng.uniform(-1.0, 1.0, count) * 10.0 ** rng.integers(-3, 3, count)
        shown = low + 10.0 ** rng.uniform(-2.0, 2.0, count) * rng.random((5, count))
        canvases = [canvas for _, canvas in matrix(names, shown)]
        words, places = zip(*map(drawn_labels, canvases), strict=True)
        for canvas, middles in zip(canvases, places, strict=True):
            foot = canvas.origin[1] + canvas.height
            numbers = (middles[:, 1] > foot) & (middles[:, 1] < foot + TEXT.line)
            assert numbers.any() == canvas.ticked[0]
        if count < 4:
            words, middles = [word for each in words for word in each], np.concatenate(places)
            halves = 0.5 * np.array([(text_width(word), 0.9 * TEXT.line) for word in words])
            for one, other in combinations(range(len(words)), 2):
                distance = np.abs(middles[one] - middles[other])
                assert (distance >= halves[one] + halves[other] - 1e-4).any(), (words[one], words[other])


@given(first=st.floats(0.0, 1.0), second=st.floats(0.0, 1.0), maximised=st.tuples(st.booleans(), st.booleans()))
@settings(max_examples=30)
def test_the_words_of_two_crossing_bounds_are_readable(first, second, maximised):
    scene = SearchedFront(names=("energy", "torque"), units=("J s", "N²m²s"), maximised=maximised, timeline="level")
    F = np.array([[0.0, 1.0], [1.0, 0.0]])
    generation = Generation(number=0, population=F, front=F, front_ids=np.arange(2), epsilon=np.array([first, second]))
    scatter = Scatter(scene=scene, shown=F)
    (panel,) = scatter.panels
    corners = []
    for line, words, middle in scatter._bounds(panel, generation):
        half = 0.5 * np.array([text_width(words), 0.8 * TEXT.line])
        corners.append((middle - half, middle + half))
        assert (middle - half >= 0).all()
        assert (middle + half <= (panel.canvas.width, panel.canvas.height)).all()
        assert not (np.abs(line - middle) < half).all()
    (low, high), (bottom, top) = corners
    assert (np.minimum(high, top) - np.maximum(low, bottom)).min() <= 0  # the words do not cover each other
