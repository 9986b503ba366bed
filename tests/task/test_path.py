"""Paths: through the given points, smooth between them, independent of the sampling."""

from __future__ import annotations

import pickle
import re
import warnings

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from paretoik.errors import InvalidInput
from paretoik.robot.pose import Pose, quaternion_to_matrix, rotation_vector, vector_to_quaternion
from paretoik.task.curves import TIME_LAWS, progress
from paretoik.task.path import circle, line, poses, waypoints
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


def test_a_line_may_turn_on_the_spot():
    path = line(Pose([1.0, 0.0, 0.0]), Pose.planar(1.0, 0.0, 1.0), duration=1.0, samples=5)
    assert (path.positions == [1.0, 0.0, 0.0]).all()
    np.testing.assert_allclose(rotation_vector(quaternion_to_matrix(path.quaternions[2])), [0, 0, 0.5], atol=1e-15)


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
    [
        (None, [1, 0, 0]),
        ([0, 0, -1], [1, 0, 0]),
        ([1, 0, 0], [0, 1, 0]),
        ([-3, 0, 0], [0, 1, 0]),
        ([0, 2, 0], [1, 0, 0]),
    ],
)
def test_a_circle_counts_from_x_or_from_y_where_the_normal_is_along_x(normal, first):
    path = circle([0.0, 0.0, 0.0], 1.0, duration=1.0, normal=normal)
    np.testing.assert_allclose(path.positions[0], first, atol=1e-15)


def test_a_circle_about_a_pose_lies_in_its_plane_and_keeps_its_orientation():
    center = Pose.from_rpy([0.5, 0.1, 0.3], [0.4, -0.3, 1.1])
    path = circle(center, 0.2, duration=1.0, start_angle=0.7)
    inside = center.inverse().apply(path.positions)
    flat = circle([0.0, 0.0], 0.2, duration=1.0, start_angle=0.7)
    np.testing.assert_allclose(inside, np.pad(flat.positions, ((0, 0), (0, 1))), atol=1e-15)
    assert (path.quaternions == center.quaternion).all()
    assert path.is_closed


@pytest.mark.parametrize("points", [CORNERS, CORNERS[:, :2], CORNERS[:3], CORNERS[:2], [*CORNERS, CORNERS[0]]])
def test_waypoints_are_all_met_in_order(points):
    points = np.asarray(points)
    path = waypoints(points, duration=1.0, timing="uniform")
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    met = path.at(np.concatenate([[0.0], np.cumsum(chords) / chords.sum()]).clip(0, 1))[0]
    np.testing.assert_allclose(met, points, atol=1e-12)
    assert path.is_closed == (len(points) == 5)


def test_closed_waypoints_have_no_corner_where_they_meet():
    path = waypoints([*CORNERS, CORNERS[0]], duration=1.0, timing="uniform")
    (a, b, c), _ = path.at([0.0, 1e-6, 2e-6])
    (x, y, z), _ = path.at([1 - 2e-6, 1 - 1e-6, 1.0])
    np.testing.assert_allclose(b - a, z - y, atol=1e-10)
    np.testing.assert_allclose((c - 2 * b + a) / 1e-12, (z - 2 * y + x) / 1e-12, atol=2e-2)


def test_waypoints_of_poses_that_only_turn_go_by_angle():
    turning = [Pose.planar(1.0, 0.0, angle) for angle in (0.0, 0.5, 2.0)]
    path = waypoints(turning, duration=2.0, timing="uniform")
    assert (path.positions == [1.0, 0.0, 0.0]).all()
    np.testing.assert_allclose(rotation_vector(quaternion_to_matrix(path.at(0.5)[1])), [0, 0, 0.5], atol=1e-9)


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


def test_a_full_turn_in_timed_poses_closes_though_its_quaternion_ends_negated():
    quarter_turns = [Pose.planar(0.0, 0.0, angle) for angle in np.arange(5) * np.pi / 2]
    path = poses(np.arange(5.0), quarter_turns)
    assert path.is_closed
    np.testing.assert_allclose(path.quaternions[-1], [-1, 0, 0, 0], atol=1e-12)


START, END = [0.0, 0.0], [1.0, 0.0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: line(START, END, duration=0.0), "duration: must be positive, got 0 s"),
        (lambda: line(START, END, duration=-1.0), "duration: must be positive, got -1 s"),
        (lambda: line(START, END, duration=np.nan), "duration: must be finite, got nan"),
        (lambda: line(START, END, duration=1.0, samples=1), "samples must be an integer of at least 3, got 1"),
        (
            lambda: line(START, END, duration=1.0, timing="cubic"),
            "timing: must be one of raised-cosine, quintic, uniform",
        ),
        (lambda: line(START, START, duration=1.0), "line: start and end must be apart, got both at [0.0, 0.0]"),
        (lambda: line(Pose([0, 0, 0]), Pose([0, 0, 0]), duration=1.0), "line: start and end must be apart"),
        (lambda: line(START, [1, 0, 0], duration=1.0), "must both be 2-D or 3-D, got 2-D and 3-D"),
        (lambda: line(START, Pose([0, 0, 0]), duration=1.0), "both be poses or both be points"),
        (lambda: line([0.0, np.nan], END, duration=1.0), "line start: must be finite, got nan at index 1"),
        (lambda: line([0.0], END, duration=1.0), "line start: must be a 2-D or 3-D point, got shape (1,)"),
        (lambda: circle(START, 0.0, duration=1.0), "circle radius: must be positive, got 0 m"),
        (lambda: circle(START, 1.0, duration=1.0, turns=0), "circle turns: must not be 0"),
        (lambda: circle(START, 1.0, duration=1.0, start_angle=np.inf), "circle start_angle: must be finite, got inf"),
        (
            lambda: circle(START, 1.0, duration=1.0, normal=[0, 0, 1]),
            "circle normal: must be None unless the center is a 3-D point",
        ),
        (lambda: circle([0, 0, 0], 1.0, duration=1.0, normal=[0, 0, 0]), "circle normal: must not be zero"),
        (
            lambda: waypoints([START, END, END], duration=1.0),
            "must differ from one to the next, got the same for 1 and 2",
        ),
        (lambda: waypoints([START], duration=1.0), "waypoints: must be at least 2, got 1"),
        (lambda: waypoints([TURNED[0], START], duration=1.0), "all poses or all points, got none at index 1"),
        (
            lambda: waypoints([0.0, 1.0], duration=1.0),
            "must be poses or an array of points (n, 2) or (n, 3), got shape (2,)",
        ),
        (lambda: poses([0, 1, 1], [START, END, START]), "path times: must increase, got 1 after 1 at index 2"),
        (lambda: poses([0, 2, 1], [START, END, START]), "path times: must increase, got 1 after 2 at index 2"),
        (lambda: poses([1, 2, 3], [START, END, START]), "path times: must start at 0 s, got 1"),
        (lambda: poses([0, np.nan, 1], [START, END, START]), "path times: must be finite, got nan at index 1"),
        (lambda: poses([0, 1], [START, END]), "samples must be an integer of at least 3, got 2"),
        (lambda: poses([0], [START]), "samples must be an integer of at least 3, got 1"),
        (lambda: poses([], np.zeros((0, 2))), "samples must be an integer of at least 3, got 0"),
        (lambda: poses([[0, 1, 2]], [START, END, START]), "path times: must be one row of numbers, got shape (1, 3)"),
        (lambda: poses([0, 1, 2], [START, END]), "must be one for each time, got 2 for 3 times"),
        (lambda: poses([0, 1, 2], [START, [np.nan, 0], END]), "poses: must be finite, got nan at index (1, 0)"),
        (lambda: EVERY_KIND["waypoints"].subsample(32), "samples: must be at most the path's own 31, got 32"),
        (lambda: EVERY_KIND["waypoints"].subsample(2), "samples must be an integer of at least 3, got 2"),
        (lambda: EVERY_KIND["waypoints"].at(np.nan), "path: time t: must be finite, got nan"),
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


@pytest.mark.parametrize("seed", range(20))
def test_points_taught_twice_are_named_with_their_distance(seed):
    rng = np.random.default_rng(seed)
    points = np.cumsum(np.array([1.0, 0.0, 0.0]) + 0.3 * rng.normal(size=(6, 3)), axis=0) * 0.1
    assert said_of(waypoints, points, duration=1.0) == []
    place = int(rng.integers(6))
    offset = rng.normal(size=3)
    again = points[place] + 2e-5 * offset / np.linalg.norm(offset)
    twice = np.insert(points, place + 1, again, axis=0)
    for make, arguments, noun in (
        (waypoints, (twice,), "waypoints: points"),
        (poses, (np.linspace(0.0, 1.0, 7), twice), "poses: samples"),
    ):
        said = said_of(make, *arguments, **({"duration": 1.0} if make is waypoints else {}))
        assert said[0].startswith(f"{noun} {place} and {place + 1} are only 2e-05 m apart")


@pytest.mark.parametrize("seed", range(20))
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


def test_paths_sampled_at_rest_corners_and_dwells_are_no_warning():
    time = np.linspace(0.0, 1.0, 401)
    covered = (1 - np.cos(np.pi * time)) / 2
    assert said_of(poses, time, np.column_stack([0.4 * covered, 0.1 * np.sin(3 * covered)])) == []
    assert said_of(waypoints, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], duration=1.0) == []
    assert said_of(waypoints, [[0.0, 0.0], [0.5, 0.87], [1.0, 0.0], [1.5, 0.87]], duration=1.0) == []
    stay = [Pose([0.5, 0.0, 0.3], vector_to_quaternion(np.array([0.0, 0.0, angle]))) for angle in (0.0, 0.2, 0.5, 0.7)]
    assert said_of(poses, [0.0, 0.3, 0.6, 1.0], stay) == []
