"""Postures from random starts reach their sample; angles are compared in the nearest turn."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import strategies as st

from paretoik import Arm, Pose, Task, arms, circle, joint_travel, line, poses
from paretoik.errors import Infeasible, OutOfReach
from paretoik.robot.arms import marcos_nr, tringali_3r
from paretoik.task.random_starts import MOTION_OPTIONS as OPTIONS
from paretoik.task.random_starts import (
    perturbed_starts,
    recombined_starts,
    rollout_starts,
    sample_postures,
    travelling_starts,
)
from paretoik.task.retraction import task_errors
from paretoik.task.self_motion import build_charts
from tests.formulations.problems import panda, random_arm, within_reach
from tests.task.tasks import task

ARM = arms.tringali_3r()
differences = st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=3).map(np.array)


# Postures, candidate motions, coordinates of the self-motion manifold, and refusals


REACH = 0.4895  # m, of the paper's arm, 0.176 + 0.176 + 0.1375
WITHIN = (0.3, 0.1)


def task_of(arm, path, **changed):
    return task(path, arm, **{"objectives": [joint_travel], **changed})


def paper(samples=21, **changed):
    return task_of(tringali_3r(), line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=samples), **changed)


def round_trip(**changed):
    return task_of(tringali_3r(), circle([0.4178, 0.0], 0.05, duration=1.0, samples=31), cyclic=True, **changed)


def across(samples=21):
    """Return a line of poses across the Panda's table."""
    return line(*(Pose.from_rpy((0.45, y, 0.3), (3.1, 0, 0)) for y in (-0.15, 0.15)), duration=1.0, samples=samples)


TASKS = {
    "3R around a circle": round_trip,
    "4R with its angle": lambda: task_of(
        marcos_nr(4), line(Pose.planar(2.0, 1.0, 0.5), Pose.planar(1.0, 2.0, 1.5), duration=1.0, samples=21)
    ),
    "Panda, position": lambda: task_of(panda(), Task(across(), axes="xyz")),
    "Panda, position and axis": lambda: task_of(panda(), Task(across(), axes="xyz+z-axis")),
    "random 8R, pose": lambda: task_of(random_arm(2, 8), within_reach(random_arm(2, 8), 2, poses=True, samples=21)),
}
every_task = pytest.mark.parametrize("make", TASKS.values(), ids=TASKS.keys())


def chance(seed=0):
    return np.random.default_rng(seed)


@every_task
def test_postures_reach_their_sample(make):
    task = make()
    for sample in (0, 7):
        q = sample_postures(task, 40, chance(), sample=sample)
        error, _ = task_errors(task.arm, task.tasks, q, task.targets[sample])
        assert len(q) > 10
        assert np.abs(error).max() < 1e-9


@every_task
def test_candidates_are_continuous_motions_on_the_path(make):
    task = make()
    q = rollout_starts(task, 60, chance())
    assert len(q) > 20
    assert task.motion(q).tracking_error.max() < 1e-9
    assert np.abs(np.diff(q, axis=1)).max() <= OPTIONS.longest_jump


@every_task
def test_perturbed_motions_stay_on_the_path_and_leave_their_origins(make):
    task = make()
    q = rollout_starts(task, 80, chance())
    away = perturbed_starts(task, q, chance(1))
    assert len(away) > 5
    assert task.motion(away).tracking_error.max() < 1e-9
    assert np.abs(np.diff(away, axis=1)).max() <= OPTIONS.longest_jump + np.abs(np.diff(q, axis=1)).max()
    apart = np.abs(away[:, None] - q[None]).max(axis=(2, 3)).min(axis=1)
    assert np.median(apart) > 0.1


@pytest.mark.parametrize("of", [perturbed_starts, travelling_starts])
def test_motions_that_move_more_keep_a_given_start_and_close_cycles_to_the_bit(of):
    def moved(task):
        return (
            travelling_starts(task, 100, chance(1))
            if of is travelling_starts
            else perturbed_starts(task, rollout_starts(task, 100, chance()), chance(1))
        )

    start = sample_postures(paper(), 40, chance())[0]
    away = moved(paper(start=start))
    np.testing.assert_array_equal(away[:, 0], np.tile(start, (len(away), 1)))
    assert np.ptp(away[:, -1], axis=0).max() > 0.05
    closed = moved(round_trip())
    assert len(closed) > 5
    np.testing.assert_array_equal(closed[:, 0], closed[:, -1])


@every_task
def test_recombined_motions_stay_on_the_path_and_are_like_the_one_then_like_the_other(make):
    task = make()
    q = rollout_starts(task, 120, chance())[:40]
    first, second = np.repeat(np.arange(len(q)), 4), np.tile(np.arange(len(q)), 4)
    mixed = recombined_starts(task, q[first], q[second], chance(1))
    assert len(mixed) > 3
    assert task.motion(mixed).tracking_error.max() < 1e-9
    far = np.abs(mixed[:, None] - q[None]).max(axis=3)  # at every sample
    assert (far.min(axis=(1, 2)) < 1e-9).mean() > 0.5  # somewhere just like one of both
    assert (far.max(axis=2).min(axis=1) > 0.1).any()  # and not everywhere
    if task.cyclic:
        np.testing.assert_array_equal(mixed[:, 0], mixed[:, -1])


@every_task
def test_charts_span_everything_turn_slowly_and_return_the_coordinates_that_they_were_given(make):
    task = make()
    base = rollout_starts(task, 20, chance())[:3]
    around = build_charts(task, base)
    both = np.concatenate([around.null_space, around.row_space], axis=-1)
    np.testing.assert_allclose(np.swapaxes(both, -1, -2) @ both - np.eye(task.arm.dof), 0, atol=1e-10)
    jacobian = task_errors(task.arm, task.tasks, base, task.targets)[1]
    assert np.abs(jacobian @ around.null_space).max() < 1e-10
    step = np.abs(np.diff(base, axis=1)).max(axis=(2,), keepdims=True)[..., None]
    assert (np.abs(np.diff(around.null_space, axis=1)) < 6 * step + 1e-2).all()
    if task.cyclic:
        np.testing.assert_array_equal(around.null_space[:, 0], around.null_space[:, -1])
    which = np.array([2, 0, 1, 1])
    y = chance(3).uniform(-0.1, 0.1, (4, 1, task.redundancy)) * np.sin(np.linspace(0, np.pi, len(task.times)))[:, None]
    q, on_path = around.at(task, which, y)
    assert on_path.all()
    assert task.motion(q).tracking_error.max() < 1e-9
    np.testing.assert_allclose(around.coordinates(task, which, q), y, atol=1e-12)


def test_a_sample_that_jumps_to_another_sheet_is_off_the_path():
    task = TASKS["Panda, position"]()
    around = build_charts(task, rollout_starts(task, 60, chance())[:4])
    y = chance(1).uniform(-1.8, 1.8, (400, 3, 4))
    weights = np.stack([np.interp(np.linspace(0, 2, 21), [0, 1, 2], row) for row in np.eye(3)], axis=-1)
    q, on_path = around.at(task, np.arange(400) % 4, np.einsum("tk,pkr->ptr", weights, y))
    whole = on_path.all(axis=1)
    assert 50 < whole.sum() < 400
    assert np.abs(np.diff(q[whole], axis=1)).max() < 1.6


def stretched_to(radius, sample):
    """Return a path of points that leaves the circle of 0.3 m for one of ``radius``, reached at ``sample`` of 21."""
    angle = np.linspace(0, 1, 21)
    share = np.maximum(0, 1 - np.abs(np.arange(21) - sample) / 5)
    distance = 0.3 + (radius - 0.3) * share
    return poses(angle, np.stack([distance * np.cos(angle), distance * np.sin(angle)], axis=-1))


@pytest.mark.parametrize(("beyond", "sample"), [(1e-9, 10), (1e-3, 0), (1e-3, 20)])
def test_a_path_just_out_of_reach_is_refused_with_sample_distance_and_nearest_point(beyond, sample):
    path = stretched_to(REACH + beyond, sample)
    with pytest.raises(OutOfReach) as refused:
        rollout_starts(task_of(tringali_3r(), path), 60, chance())
    assert refused.value.sample == sample
    message = str(refused.value)
    place, gap, nearest = re.search(
        r"(\[.*?\]) m is (\S+) m from the nearest point found, (\[.*\]) m", message
    ).groups()
    assert message.startswith(f"path leaves reach at sample {sample} (")
    assert float(gap) == pytest.approx(beyond, rel=0.01)
    np.testing.assert_allclose(eval(place), path.positions[sample], atol=1e-6)
    np.testing.assert_allclose(eval(nearest), REACH * np.array([np.cos(sample / 20), np.sin(sample / 20)]), atol=2e-6)


def test_a_path_through_the_hole_around_the_base_is_refused():
    arm = Arm.planar(lengths=[1.0, 0.3, 0.3])
    path = line([-0.8, 0.05], [0.8, 0.05], duration=1.0, samples=41)
    with pytest.raises(OutOfReach) as refused:
        rollout_starts(task_of(arm, path), 60, chance())
    distances = np.linalg.norm(path.positions, axis=1)
    assert refused.value.sample == int(np.argmax(distances < 0.4))
    assert f" m is {0.4 - distances[refused.value.sample]:.3g} m from" in str(refused.value)


def test_an_orientation_out_of_reach_is_refused_with_what_is_missing_of_it():
    path = line(Pose.planar(3.5, 0, 0), Pose.planar(3.5, 0.1, 3.0), duration=1.0, samples=21)
    with pytest.raises(OutOfReach, match=r"m and 0.01\d* rad from the nearest pose") as refused:
        rollout_starts(task_of(marcos_nr(4), path), 60, chance())
    w, z = path.quaternions[:, 0], path.quaternions[:, 3]
    wrist = path.positions[:, :2] - np.stack([1 - 2 * z**2, 2 * w * z], axis=-1)
    assert refused.value.sample == int(np.argmax(np.linalg.norm(wrist, axis=1) > 3.0))


def test_leaving_a_stretched_posture_is_refused_with_the_condition_number():
    task = task_of(tringali_3r(), line([REACH, 0.0], WITHIN, duration=1.0, samples=21))
    with pytest.raises(Infeasible, match=r"condition number of the Jacobian there: \d+"):
        rollout_starts(task, 60, chance())


def test_a_cycle_that_only_closes_after_a_whole_turn_is_refused():
    path = circle([0.0, 0.0], 0.3, duration=1.0, samples=61, timing="uniform")
    with pytest.raises(Infeasible, match="no cyclic motion was found"):
        rollout_starts(task_of(tringali_3r(), path, cyclic=True), 60, chance())
