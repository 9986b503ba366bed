"""The compromise of a front, and the points that pictures mark."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from paretoik.front.front import Front
from paretoik.front.preferences.knee_and_compromise import best_rows, compromise, marked_rows, score_shares
from tests.front.random_fronts import random_front

few = settings(max_examples=40)


def test_naming_an_objective_twice_does_not_move_the_compromise():
    front = random_front(4, n_obj=2)
    twice = Front(
        ids=front.ids,
        objectives=front.objectives[:, [0, 1, 1]],
        names=["a", "b", "c"],
        units=[""] * 3,
        maximised=[front.maximised[i] for i in (0, 1, 1)],
    )
    assert compromise(twice).id == compromise(front).id


# The points that pictures mark, compared with brute force.


SMALL = st.integers(0, 3).map(float)  # so that many are equal
FRONTS = st.tuples(st.integers(1, 9), st.integers(1, 4)).flatmap(lambda shape: arrays(float, shape, elements=SMALL))


@few
@given(F=FRONTS, data=st.data())
def test_the_best_of_an_objective_is_the_first_by_value_and_then_by_id(F, data):
    ids = np.array(data.draw(st.permutations(range(7, 7 + len(F)))))
    expected = [min(range(len(F)), key=lambda row: (F[row, axis], ids[row])) for axis in range(F.shape[1])]
    assert best_rows(F, ids) == expected


@few
@given(F=FRONTS, data=st.data())
def test_marked_points_are_the_best_of_every_objective_and_the_compromise_on_their_own_ranges(F, data):
    ids = np.array(data.draw(st.permutations(range(7, 7 + len(F)))))
    *best, (compromise, axis) = marked_rows(F, ids)
    assert axis is None
    assert best == ([(row, axis) for axis, row in enumerate(best_rows(F, ids))] if F.shape[1] > 1 else [])
    width = np.ptp(F, axis=0)
    shares = np.divide(F - F.min(axis=0), width, out=np.zeros_like(F), where=width > 0)
    scores = score_shares(shares)
    assert compromise == min(range(len(F)), key=lambda row: (scores[row], ids[row]))
