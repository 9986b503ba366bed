"""Paths: through the given points, smooth between them, independent of the sampling."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from paretoik.errors import InvalidInput
from paretoik.robot.pose import Pose, quaternion_to_matrix, rotation_vector, vector_to_quaternion
from paretoik.task.path import circle, line, poses, waypoints
from paretoik.task.path_shapes import TIME_LAWS, progress
from tests.task.paths import CORNERS, EVERY_KIND, TURNED

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
        assert fine < coarse / 6 or coarse < 1e-14  # halving the step: 8 with bounded jerk, 4 at a jump


@every_kind
def test_any_sampling_is_of_the_same_path(path):
    fine = path.resample(173)
    assert fine.samples == 173
    assert fine.duration == path.duration
    np.testing.assert_allclose(fine.at(path.times)[0], path.positions, atol=1e-15)
    coarse = path.subsample(3)
    assert coarse.times.tolist() == path.times[[0, round((path.samples - 1) / 2), -1]].tolist()
    np.testing.assert_allclose(coarse.at(path.times)[0], path.positions, atol=1e-15)


# Lines, circles, waypoints and timed poses: through the given points, and refusals


@pytest.mark.parametrize("timing", TIME_LAWS)
def test_a_line_covers_its_length_by_the_law_and_meets_its_ends_exactly(timing):
    path = line([0.4678, 0.0], [0.0983, 0.1526], duration=2.0, samples=41, timing=timing)
    assert path.positions[0].tolist() == [0.4678, 0.0]
    np.testing.assert_allclose(path.positions[-1], [0.0983, 0.1526], atol=1e-16)
    covered = np.linalg.norm(path.positions - path.positions[0], axis=1) / np.hypot(0.4678 - 0.0983, 0.1526)
    np.testing.assert_allclose(covered, progress(path.times, 2.0, timing), atol=1e-14)


@given(places, rotation_vectors, places, rotation_vectors, st.floats(0, 1))
def test_a_line_of_poses_turns_about_one_axis_in_step_with_its_place(here, spin, there, other_spin, t):
    start, end = Pose.from_rpy(here, spin), Pose.from_rpy(there, other_spin)
    assume(np.abs(start.matrix - end.matrix).max() > 1e-8)
    path = line(start, end, duration=1.0, samples=5, timing="uniform")
    position, quaternion = path.at(t)
    np.testing.assert_allclose(position, (1 - t) * start.position + t * end.position, atol=1e-14)
    whole = rotation_vector(start.rotation.T @ end.rotation)
    np.testing.assert_allclose(
        quaternion_to_matrix(quaternion),
        start.rotation @ quaternion_to_matrix(vector_to_quaternion(t * whole)),
        atol=1e-13,
    )
    last = quaternion_to_matrix(path.quaternions[-1])
    np.testing.assert_allclose(rotation_vector(last.swapaxes(-1, -2) @ end.rotation), 0, atol=1e-12)


@given(st.floats(-6, 6), st.sampled_from([-2, -0.25, 0.5, 1, 3]), st.floats(0.01, 10))
def test_a_circle_keeps_its_radius_and_closes_after_whole_turns(start_angle, turns, radius):
    path = circle([0.3, -0.2], radius, duration=1.5, start_angle=start_angle, turns=turns)
    np.testing.assert_allclose(np.linalg.norm(path.positions - [0.3, -0.2], axis=1), radius, rtol=1e-12)
    assert path.is_closed == (turns == int(turns))
    first = [0.3 + radius * np.cos(start_angle), -0.2 + radius * np.sin(start_angle)]
    np.testing.assert_allclose(path.positions[0], first, atol=1e-14)


def test_a_circle_goes_counter_clockwise_about_its_normal_and_back_with_negative_turns():
    normal = np.array([1.0, 2.0, -0.5])
    for turns in (1, -1):
        path = circle([0.1, 0.2, 0.3], 0.4, duration=1.0, normal=normal, turns=turns)
        spokes = path.positions - [0.1, 0.2, 0.3]
        np.testing.assert_allclose(spokes @ normal, 0, atol=1e-15)
        assert (np.cross(spokes[30:60], spokes[31:61]) @ normal * turns > 0).all()
    assert spokes[0] @ [0.0, -0.5, -2.0] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    ("normal", "first"),
    [(None, [1, 0, 0]), ([0, 0, -1], [1, 0, 0]), ([-3, 0, 0], [0, 1, 0])],
)
def test_a_circle_counts_from_x_or_from_y_where_the_normal_is_along_x(normal, first):
    path = circle([0.0, 0.0, 0.0], 1.0, duration=1.0, normal=normal)
    np.testing.assert_allclose(path.positions[0], first, atol=1e-15)


@pytest.mark.parametrize("points", [CORNERS, CORNERS[:, :2], CORNERS[:3], CORNERS[:2], [*CORNERS, CORNERS[0]]])
def test_waypoints_are_all_met_in_order(points):
    points = np.asarray(points)
    path = waypoints(points, duration=1.0, timing="uniform")
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    met = path.at(np.concatenate([[0.0], np.cumsum(chords) / chords.sum()]).clip(0, 1))[0]
    np.testing.assert_allclose(met, points, atol=1e-12)
    assert path.is_closed == (len(points) == 5)


def test_timed_poses_are_met_at_their_times_even_where_they_wait():
    times = np.array([0.0, 0.3, 0.35, 1.0, 1.2])
    requested = [*TURNED, TURNED[-1]]
    with pytest.warns(RuntimeWarning, match="samples 0 and 1: the curve runs 0.239 m backwards"):
        path = poses(times, requested)
    assert (path.times == times).all()
    np.testing.assert_allclose(path.positions, [pose.position for pose in requested], atol=1e-15)
    rotations = np.stack([pose.rotation for pose in requested])
    np.testing.assert_allclose(
        rotation_vector(quaternion_to_matrix(path.quaternions).swapaxes(-1, -2) @ rotations), 0, atol=1e-12
    )


START, END = [0.0, 0.0], [1.0, 0.0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: line(START, END, duration=0.0), "duration: must be positive, got 0 s"),
        (
            lambda: line(START, END, duration=1.0, timing="cubic"),
            "timing: must be one of raised-cosine, quintic, uniform",
        ),
        (lambda: line(START, START, duration=1.0), "line: start and end must differ, got both at [0.0, 0.0]"),
        (lambda: line([0.0], END, duration=1.0), "line start: must be a 2-D or 3-D point, got shape (1,)"),
        (lambda: circle(START, 1.0, duration=1.0, turns=0), "circle |turns| must be above 0"),
        (
            lambda: waypoints([START, END, END], duration=1.0),
            "must differ from one to the next, got the same for 1 and 2",
        ),
        (lambda: poses([0, 2, 1], [START, END, START]), "path times: must increase, got 1 after 2 at index 2"),
        (lambda: poses([0, 1, 2], [START, [np.nan, 0], END]), "poses: must be finite, got nan at index (1, 0)"),
    ],
)
def test_what_makes_no_path_is_refused_with_name_wish_and_fact(make, message):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        make()


def said_of(make, *arguments, **settings):
    """Return the warnings while a path is made."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        make(*arguments, **settings)
    return [str(warning.message) for warning in caught]


@pytest.mark.parametrize("seed", range(4))
def test_a_curve_that_runs_backwards_is_measured_as_on_a_fine_grid(seed):
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.choice([0.1, 1.0], 6))])
    along = np.concatenate([[0.0], np.cumsum(rng.choice([0.02, 0.3], 6))])  # not in proportion to the times
    points = np.column_stack([along, np.full(7, 0.2), np.zeros(7)])
    path_warnings = said_of(poses, times, points)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = poses(times, points)
    fine = [path.at(np.linspace(*times[k : k + 2], 4001))[0][:, 0] for k in range(6)]
    backwards = np.array([(np.maximum.accumulate(x) - x).max() for x in fine])
    said = [re.search(r"samples (\d) and \d: the curve runs ([\d.e-]+) m backwards", text) for text in path_warnings]
    assert len(said) == (backwards.max() > 0.01 * np.median(np.diff(along)))
    for match in said:
        assert float(match[2]) == pytest.approx(backwards.max(), rel=0.02, abs=1e-5)
        assert backwards[int(match[1])] == pytest.approx(backwards.max(), abs=1e-5)
