from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.errors import Infeasible
from paretoik.front.front import Front
from paretoik.front.preferences.compromise import COMPROMISE_IN_WORDS, compromise
from tests.front.random_fronts import random_front


def hollow() -> Front:
    """A quarter circle bulging away from the best of everything: equal weights reach its ends alone."""
    angles = np.linspace(0.0, np.pi / 2, 21)
    return Front(
        ids=np.arange(21),
        objectives=np.stack([np.sin(angles), np.cos(angles)], axis=1),
        names=["a", "b"],
        units=["", ""],
        maximised=[False] * 2,
    )


@given(st.integers(0, 10**6))
def test_no_point_has_a_smaller_largest_share(seed):
    front = random_front(seed)
    worst = front.shares.max(axis=1)
    assert worst[compromise(front).index] <= worst.min() + 1e-4 * len(front.names)


def test_it_exists_in_the_middle_of_a_hollow_front_too():
    assert compromise(hollow()).index == 10


def test_naming_an_objective_twice_does_not_move_it():
    front = random_front(4, n_obj=2)
    twice = Front(
        ids=front.ids,
        objectives=front.objectives[:, [0, 1, 1]],
        names=["a", "b", "c"],
        units=[""] * 3,
        maximised=[front.maximised[i] for i in (0, 1, 1)],
    )
    assert compromise(twice).id == compromise(front).id


def test_of_one_objective_it_is_the_best_point():
    front = Front(ids=np.array([4]), objectives=np.ones((1, 1)), names=["a"], units=[""], maximised=[False])
    assert compromise(front).id == 4


def test_an_empty_front_has_none():
    front = Front(ids=np.empty(0, int), objectives=np.empty((0, 1)), names=["a"], units=[""], maximised=[False])
    with pytest.raises(Infeasible, match="compromise: wanted a front of at least one point"):
        compromise(front)


def test_its_reason_says_what_a_compromise_is():
    choice = compromise(hollow())
    assert COMPROMISE_IN_WORDS in choice.reason
    assert "70.7%" in choice.reason
