"""Colours of the picture of a search, and the reduction of fronts with more points than a picture can show."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.formulations.protocol import Timeline
from paretoik.front.hypervolume import HypervolumeCurve, HypervolumeOptions, hypervolume
from paretoik.review.drawing.search_drawing import FrontReduction, search_entries
from paretoik.review.recording.recorder import Generation, SearchedFront
from tests.review.conftest import sphere


@pytest.mark.parametrize("timeline", get_args(Timeline))
@pytest.mark.parametrize("n_obj", [2, 3, 4])
def test_no_two_things_in_the_picture_of_a_front_have_one_colour(timeline, n_obj):
    names = tuple(f"objective {number}" for number in range(n_obj))
    scene = SearchedFront(names=names, units=("",) * n_obj, maximised=(False,) * n_obj, timeline=timeline)
    colours = [colour[:3] for _, colour in search_entries(scene, None, walked=True)]
    assert len(set(colours)) == len(colours)


def generation(front: np.ndarray, **settings) -> Generation:
    return Generation(number=1, population=front, front=front, front_ids=np.arange(len(front)) + 7, **settings)


@given(seed=st.integers(0, 99))
@settings(max_examples=20)
def test_points_are_spread_no_worse_than_at_random(seed):
    F = sphere(300, 3, seed)

    def farthest(kept: np.ndarray) -> float:  # the largest distance of a point from the kept ones
        return float(np.linalg.norm(F[:, None] - kept, axis=-1).min(axis=1).max())

    at_random = F[np.random.default_rng(seed).choice(300, 30, replace=False)]
    spread = FrontReduction(maximised=(False,) * 3, points=30).reduce(generation(F)).front
    assert len(spread) == 30
    assert farthest(spread) <= farthest(at_random)


def test_small_fronts_are_kept_completely():
    reduction, whole = FrontReduction(maximised=(False, True), points=5), generation(sphere(5, 2))
    kept = reduction.reduce(whole)
    np.testing.assert_array_equal(kept.front, whole.front)
    assert kept.count == 5


def test_reduced_fronts_keep_their_ends_and_the_size_of_the_whole_front():
    front = sphere(200, 3) * [1.0, -1.0, 1.0]
    reduction = FrontReduction(maximised=(False, True, False), points=20)
    kept = reduction.reduce(generation(front))
    assert (kept.front.shape, kept.size) == ((20, 3), 200)
    np.testing.assert_array_equal(kept.front, front[kept.front_ids - 7])
    best = [front[:, 0].min(), front[:, 1].max(), front[:, 2].min()]
    assert best == [kept.front[:, 0].min(), kept.front[:, 1].max(), kept.front[:, 2].min()]


def test_the_hypervolume_is_that_of_the_whole_front():
    front, reference = sphere(200, 3) * [1.0, -1.0, 1.0], np.array([2.5, -2.5, 2.5])
    kept = FrontReduction(maximised=(False, True, False), points=20).reduce(generation(front, reference=reference))
    assert kept.hypervolume == pytest.approx(hypervolume(front * [1, -1, 1], reference * [1, -1, 1]), rel=1e-12)


def test_a_given_hypervolume_is_not_computed_and_without_a_reference_there_is_none():
    reduction = FrontReduction(maximised=(False, False), points=20)
    assert reduction.reduce(generation(sphere(9, 2), hypervolume=0.125, reference=np.ones(2))).hypervolume == 0.125
    assert reduction.reduce(generation(sphere(9, 2))).hypervolume is None


def test_hypervolumes_that_take_more_than_their_share_of_the_time_are_left_out():
    reduction = FrontReduction(maximised=(False,) * 4, points=20)
    reduction._hypervolume = HypervolumeCurve(HypervolumeOptions(share=1e-9))
    large = generation(sphere(4000, 4), reference=np.full(4, 3.0))
    assert [reduction.reduce(large).hypervolume is None for _ in range(4)] == [False, False, True, True]
