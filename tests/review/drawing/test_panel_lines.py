"""The bounds ε of a panel: what each is stands beside its line, off the other line and its words."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.review.drawing.axes import TEXT, Canvas, text_width
from paretoik.review.drawing.front_panels import bounds_in

NAMES = (("energy", "J s"), ("torque", "N²m²s"))
shares = st.floats(0.0, 1.0)


def corners(bound) -> tuple[np.ndarray, np.ndarray]:
    half = 0.5 * np.array([text_width(bound.words), 0.8 * TEXT.line])
    return bound.middle - half, bound.middle + half


@pytest.mark.parametrize("size", [(500.0, 390.0), (240.0, 180.0)])
@given(first=shares, second=shares, maximised=st.tuples(st.booleans(), st.booleans()))
def test_what_two_crossing_bounds_are_is_read_whatever_they_are(size, first, second, maximised):
    canvas = Canvas(low=np.zeros(2), high=np.ones(2), labels=("x", "y"), width=size[0], height=size[1])
    bounds = bounds_in(canvas, np.array([first, second]), NAMES, maximised)
    (low, high), (bottom, top) = map(corners, bounds)
    assert (np.minimum(high, top) - np.maximum(low, bottom)).min() <= 0  # neither words cover the others
    for bound, (least, most) in zip(bounds, map(corners, bounds), strict=True):
        assert (least >= 0).all()
        assert (most <= size).all()
        for axis, line in enumerate(bounds if size[0] == 500.0 else ()):  # a narrow panel has no room off the lines
            assert not least[axis] < line.ends[0, axis] < most[axis], (bound.words, line.words)
