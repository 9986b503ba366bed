"""Postures from random starts reach their sample; angles are compared in the nearest turn."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik import Limits, arms, circle
from paretoik.task.retraction import task_errors
from paretoik.task.starts import order_by_neighbour, posture_distance, sample_postures, wrap_difference
from tests.task.tasks import task

ARM = arms.tringali_3r()
PERIODIC = np.array([True, False, True])
differences = st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=3).map(np.array)


@settings(max_examples=50)
@given(differences)
def test_whole_turns_of_periodic_joints_are_taken_off_and_of_no_others(difference):
    wrapped = wrap_difference(difference, PERIODIC)
    assert wrapped[1] == difference[1]
    assert np.abs(wrapped[PERIODIC]).max() <= np.pi + 1e-12
    turns = (difference - wrapped) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)


@pytest.mark.parametrize("sample", [0, 7, 20])
def test_postures_reach_their_sample_in_more_than_one_way(sample):
    along = task(circle([0.3, 0.0], 0.05, duration=1.0, samples=21))
    q = sample_postures(along, 40, np.random.default_rng(0), sample=sample)
    assert len(q) > 20
    error = task_errors(along.arm, along.tasks, q, along.targets[sample])[0]
    assert np.abs(error).max() < 1e-9
    assert (q[:, 1] > 0).any()
    assert (q[:, 1] < 0).any()
    assert np.abs(q).max() <= np.pi


def test_nothing_reaches_what_is_beyond_the_arm():
    beyond = task(circle([0.9, 0.0], 0.05, duration=1.0, samples=21), limits=Limits(velocity=9.0))
    assert len(sample_postures(beyond, 20, np.random.default_rng(0))) == 0


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 12))
def test_each_comes_after_the_nearest_of_those_that_are_left(seed, count):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 3))
    ordered = order_by_neighbour(ARM, q)
    np.testing.assert_array_equal(ordered[0], q[0])
    np.testing.assert_array_equal(np.sort(ordered, axis=0), np.sort(q, axis=0))
    for k in range(count - 1):
        distance = posture_distance(ARM, ordered[k + 1 :], ordered[k])
        assert distance[0] == distance.min()
