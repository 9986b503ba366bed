"""The points that are marked: by brute force, and no more work than looking at every value a few times."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from paretoik.front.preferences.compromise import best_rows, marked_rows, score_shares

SMALL = st.integers(0, 3).map(float)  # so that many are equal
FRONTS = st.tuples(st.integers(1, 9), st.integers(1, 4)).flatmap(lambda shape: arrays(float, shape, elements=SMALL))


@given(F=FRONTS, data=st.data())
def test_the_best_of_an_objective_is_the_first_by_value_and_then_by_id(F, data):
    ids = np.array(data.draw(st.permutations(range(7, 7 + len(F)))))
    expected = [min(range(len(F)), key=lambda row: (F[row, axis], ids[row])) for axis in range(F.shape[1])]
    assert best_rows(F, ids) == expected


@given(F=FRONTS, data=st.data())
def test_marked_are_the_best_of_every_objective_and_the_compromise_on_their_own_ranges(F, data):
    ids = np.array(data.draw(st.permutations(range(7, 7 + len(F)))))
    *best, (compromise, axis) = marked_rows(F, ids)
    assert axis is None
    assert best == ([(row, axis) for axis, row in enumerate(best_rows(F, ids))] if F.shape[1] > 1 else [])
    width = np.ptp(F, axis=0)
    shares = np.divide(F - F.min(axis=0), width, out=np.zeros_like(F), where=width > 0)
    scores = score_shares(shares)
    assert compromise == min(range(len(F)), key=lambda row: (scores[row], ids[row]))
