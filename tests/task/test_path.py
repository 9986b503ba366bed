"""Paths: through what was asked, smooth between, the same at any sampling."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import strategies as st

from paretoik.errors import InvalidInput
from paretoik.robot.pose import Pose
from paretoik.task.path import line
from tests.task.paths import EVERY_KIND

coordinates = st.floats(-3, 3)
angles = st.floats(-3, 3)
places = st.tuples(coordinates, coordinates, coordinates)
rotation_vectors = st.tuples(angles, angles, angles)
every_kind = pytest.mark.parametrize("path", EVERY_KIND.values(), ids=EVERY_KIND.keys())


@every_kind
def test_the_samples_are_the_path_at_their_times(path):
    positions, quaternions = path.at(path.times)
    np.testing.assert_allclose(positions, path.positions, atol=1e-15)
    assert (quaternions is None) == (path.quaternions is None)
    if quaternions is not None:
        np.testing.assert_allclose(quaternions, path.quaternions, atol=1e-15)


@every_kind
def test_orientations_are_unit_quaternions_whose_signs_are_continued(path):
    _, between = path.at(np.linspace(0.0, path.duration, 500))
    for quaternions in (path.quaternions, between):
        if quaternions is not None:
            np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=1e-14)
            assert ((quaternions[1:] * quaternions[:-1]).sum(axis=1) > 0).all()


@every_kind
def test_velocity_and_acceleration_are_continuous(path):
    def third_differences(steps):
        samples = path.at(np.linspace(0.0, path.duration, steps + 1))
        return [np.abs(np.diff(values, 3, axis=0)).max() for values in samples if values is not None]

    for coarse, fine in zip(third_differences(700), third_differences(1400), strict=True):
        assert fine < coarse / 6 or coarse < 1e-14  # halving the step: 8 where the jerk is bounded, 4 at a jump


@every_kind
def test_any_sampling_is_of_the_same_path(path):
    fine = path.resample(173)
    assert fine.samples == 173
    assert fine.duration == path.duration
    np.testing.assert_allclose(fine.at(path.times)[0], path.positions, atol=1e-15)
    coarse = path.subsample(3)
    assert coarse.times.tolist() == path.times[[0, round((path.samples - 1) / 2), -1]].tolist()
    np.testing.assert_allclose(coarse.at(path.times)[0], path.positions, atol=1e-15)


@every_kind
def test_a_path_with_midpoints_has_its_samples_and_the_middles_between_them(path):
    finer = path.with_midpoints()
    np.testing.assert_array_equal(finer.times[::2], path.times)
    np.testing.assert_allclose(finer.times[1::2], (path.times[1:] + path.times[:-1]) / 2, rtol=1e-15)
    np.testing.assert_allclose(finer.positions, path.at(finer.times)[0], atol=1e-15)
    if path.quaternions is not None:
        np.testing.assert_allclose(finer.quaternions, path.at(finer.times)[1], atol=1e-15)


@every_kind
def test_a_path_takes_times_of_any_shape(path):
    positions, quaternions = path.at(np.full((2, 5), 0.3))
    single, turned = path.at(0.3)
    assert positions.shape == (2, 5, path.positions.shape[1])
    np.testing.assert_allclose(positions[1, 4], single, atol=1e-15)
    if quaternions is not None:
        np.testing.assert_allclose(quaternions[1, 4], turned, atol=1e-15)


@every_kind
def test_a_path_is_frozen_and_travels_to_other_processes(path):
    with pytest.raises(ValueError, match="read-only"):
        path.positions[0] = 0.0
    travelled = pickle.loads(pickle.dumps(path))
    assert (travelled.at(0.33)[0] == path.at(0.33)[0]).all()


def test_a_path_names_its_kind():
    assert repr(EVERY_KIND["line of poses"]) == "Path(31 poses, 0.7 s)"
    assert repr(EVERY_KIND["circle of points"]) == "Path(31 2-D points, 0.7 s)"


def test_a_path_that_turns_but_returns_to_its_place_is_not_closed():
    assert not line(Pose([1.0, 0.0, 0.0]), Pose.planar(1.0, 0.0, 1.0), duration=1.0, samples=5).is_closed


def test_rounding_past_the_ends_is_forgiven_and_no_more():
    path = EVERY_KIND["line of points"]
    assert path.at(path.duration * (1 + 1e-12))[0].tolist() == path.positions[-1].tolist()
    for late in (path.duration * (1 + 1e-6), -1e-6):
        with pytest.raises(InvalidInput, match=r"must lie in \[0, 0\.7\] s, got"):
            path.at([0.1, late])
