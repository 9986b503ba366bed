"""The state of a motion at any time: positions of at(t) and their exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik import Arm, Motion, Pose, Task, circle, line, poses, waypoints
from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot.arms import marcos_nr, tringali_3r
from paretoik.robot.pose import vector_to_quaternion
from paretoik.task.retraction import retract_nearest
from tests.formulations.problems import panda
from tests.task.test_differences import ARM, even
from tests.task.test_path_shapes import FIRST, SECOND

SAMPLES = np.linspace(0.0, 1.0, 21)
BETWEEN = np.setdiff1d(np.linspace(0.003, 0.997, 72).round(4), SAMPLES)
NODES = np.linspace(0.0, 1.0, 41)  # samples and the middles between them, where third derivatives jump
STEP = 1e-3  # of the differences, so that the projection's error, 1e-12, stays small; nodes are not crossed
SLIDING = Arm.from_dh(
    a=[0.1, 0.3, 0.0, 0.2, 0.1],
    alpha=[0.0, 1.2, -0.7, 0.9, 0.4],
    d=[0.2, 0.1, 0.3, 0.0, 0.1],
    theta=[0.0, 0.5, 0.0, -0.4, 0.2],
    types=["revolute", "revolute", "prismatic", "continuous", "revolute"],
    convention="modified",
)
POSTURES = {3: [-0.6, 0.9, 0.8], 4: [0.3, 0.6, 0.5, -0.4], 5: [0.2, 0.4, 0.3, -0.5, 0.6]}
POSTURES[7] = [0.1, -0.5, 0.2, -2.0, 0.1, 1.6, 0.5]


def pose_at(arm, frame="tool"):
    return arm.pose(POSTURES[arm.dof], frame=frame)


def turned(pose, step, turn):
    """Return a pose moved by a step and turned by a rotation vector, both in the world."""
    return Pose(pose.position + step, vector_to_quaternion(np.array(turn))) @ Pose(np.zeros(3), pose.quaternion)


def poses_line(arm, timing="raised-cosine"):
    about = (0.0, 0.0, 0.1) if arm.is_planar else (0.1, -0.2, 0.15)
    step = (-0.02, 0.01, 0.0) if arm.is_planar else (0.04, -0.03, 0.05)
    return line(pose_at(arm), turned(pose_at(arm), step, about), duration=1.0, samples=21, timing=timing)


def through_poses(arm):
    start = pose_at(arm)
    ahead = [turned(start, 0.01 * np.array([k, -k, k * k]), [0.04 * k, 0.02 * k * k, -0.03 * k]) for k in range(4)]
    return poses([0.0, 0.3, 0.6, 1.0], ahead)


def points(arm, frame="tool"):
    start = pose_at(arm, frame).position
    corners = start + 0.02 * np.array([[0, 0, 0], [1, 2, 1], [3, 1, -1], [4, 3, 0]])
    return waypoints(corners[:, :2] if arm.is_planar else corners, duration=1.0, samples=21)


PLANAR, PANDA = tringali_3r(), panda()
CASES = {
    "planar, position": (PLANAR, [Task(points(PLANAR))]),
    "planar, position and angle": (marcos_nr(4), [Task(poses_line(marcos_nr(4)))]),
    "position in a plane": (PANDA, [Task(points(PANDA), axes="xy")]),
    "position": (PANDA, [Task(points(PANDA))]),
    "position, a slide": (SLIDING, [Task(points(SLIDING))]),
    "pose on a line": (PANDA, [Task(poses_line(PANDA, "quintic"))]),
    "pose through poses": (PANDA, [Task(through_poses(PANDA))]),
    "axis through poses": (PANDA, [Task(through_poses(PANDA), axes="xyz+z-axis")]),
    "two tasks": (PANDA, [Task(points(PANDA)), Task(points(PANDA, "panda_link4"), frame="panda_link4", axes="xy")]),
}
every_case = pytest.mark.parametrize(("arm", "tasks"), CASES.values(), ids=CASES)


def motion(arm, tasks, differences="spline", seed=0, batch=()):
    """Return a motion that follows the tasks, with some self-motion if redundant."""
    tasks = tuple(task.resolve_axes(arm) for task in tasks)
    phases = np.random.default_rng(seed).uniform(0, 6, (*batch, 1, arm.dof))
    near = np.array(POSTURES[arm.dof]) + 0.05 * np.sin(4 * SAMPLES[:, None] + phases)
    targets = np.concatenate([task.targets(SAMPLES) for task in tasks], axis=1)
    retraction = retract_nearest(arm, tasks, near, targets)
    assert retraction.on_path.all()
    return Motion(arm=arm, time=SAMPLES, q=retraction.q, tasks=tasks, differences=differences)


def differences_of(curve, t):
    """Return first and second differences of a curve of time, of sixth order."""
    around = np.stack([curve(t + k * STEP) for k in range(-3, 4)])
    return np.tensordot(FIRST, around, 1) / STEP, np.tensordot(SECOND, around, 1) / STEP**2


def far_from_samples(t, samples):
    return t[np.abs(t[:, None] - samples).min(axis=1) > 3 * STEP]


@every_case
@pytest.mark.parametrize("differences", ["central", "spline"])
def test_velocities_and_accelerations_are_the_derivatives_of_the_projected_curve(arm, tasks, differences):
    moving = motion(arm, tasks, differences)
    t = far_from_samples(BETWEEN, NODES)
    q, dq, ddq = moving.state(t)
    first, second = differences_of(moving.at, t)
    np.testing.assert_array_equal(q, moving.at(t))
    np.testing.assert_allclose(dq, first, atol=1e-8 * (1 + np.abs(first).max()))
    np.testing.assert_allclose(ddq, second, atol=2e-5 * (1 + np.abs(second).max()))  # 1e-12 over STEP²


@every_case
def test_the_tool_has_the_velocity_and_acceleration_of_its_path_at_samples_too(arm, tasks):
    moving = motion(arm, tasks)
    t = np.sort(np.concatenate([BETWEEN, SAMPLES]))
    q, dq, ddq = moving.state(t)
    for task in moving.tasks:
        rates = task.path.rates(t)
        rows = task.position_rows
        jacobian = arm.jacobian(q, frame=task.frame)[:, :rows]
        drift = (arm.jacobian(q + 1e-6 * dq, frame=task.frame) - arm.jacobian(q - 1e-6 * dq, frame=task.frame)) / 2e-6
        velocity = np.einsum("tij,tj->ti", jacobian, dq)
        acceleration = np.einsum("tij,tj->ti", jacobian, ddq) + np.einsum("tij,tj->ti", drift[:, :rows], dq)
        np.testing.assert_allclose(velocity, rates.velocity[:, :rows], atol=1e-12)
        np.testing.assert_allclose(acceleration, rates.acceleration[:, :rows], atol=1e-8)
    if tasks[0].path.quaternions is not None and moving.tasks[0].axes == "pose":
        turning = np.einsum("tij,tj->ti", arm.jacobian(q)[:, 3:], dq)
        np.testing.assert_allclose(turning, moving.tasks[0].path.rates(t).angular_velocity, atol=1e-11)


@pytest.mark.parametrize("differences", ["backward", "spline"])
def test_without_tasks_or_projection_the_state_is_that_of_the_spline(differences):
    moving = motion(PANDA, CASES["position"][1], differences)
    free = Motion(arm=PANDA, time=SAMPLES, q=moving.q, differences=differences)
    t = far_from_samples(BETWEEN, SAMPLES)
    for state in (free.state(t), moving.state(t, project=False)):
        first, second = differences_of(free.at, t)
        np.testing.assert_allclose(state.dq, first, atol=1e-9)
        np.testing.assert_allclose(state.ddq, second, atol=1e-7)
    if differences == "spline":
        np.testing.assert_allclose(free.state(SAMPLES).dq, free.dq, atol=1e-12)
        np.testing.assert_allclose(free.state(SAMPLES).ddq, free.ddq, atol=1e-10)


@pytest.mark.parametrize("differences", ["central", "spline"])
def test_a_cyclic_motion_leaves_as_it_arrives(differences):
    moving = on_circle(31, True, differences=differences)
    q, dq, ddq = moving.state(np.array([0.0, 1.0]))
    for values, tolerance in ((q, 1e-10), (dq, 1e-8), (ddq, 1e-7)):
        np.testing.assert_allclose(values[0], values[1], atol=tolerance)


def test_a_motion_that_ends_at_rest_does_so_on_its_path_too():
    moving = motion(PANDA, CASES["pose on a line"][1])
    resting = Motion(arm=PANDA, time=SAMPLES, q=moving.q, tasks=moving.tasks, differences="spline", ends_at_rest=True)
    assert np.abs(resting.state(1.0).dq).max() < 1e-12
    assert np.abs(moving.state(1.0).dq).max() > 1e-3


@every_case
def test_rates_at_samples_are_those_of_the_curve(arm, tasks):
    moving = motion(arm, tasks)
    state = moving.state(SAMPLES)
    np.testing.assert_allclose(moving.dq, state.dq, atol=1e-12 * (1 + np.abs(state.dq).max()))
    np.testing.assert_allclose(moving.ddq, state.ddq, atol=1e-11 * (1 + np.abs(state.ddq).max()))
    np.testing.assert_allclose(moving.instants.q, moving.at(NODES), atol=1e-12)


def test_a_stretched_arm_has_no_velocity_and_says_so():
    arm = Arm.planar(lengths=[0.5, 0.5, 0.5])
    out = line([1.5, 0.0], [1.4, 0.0], duration=1.0, samples=3)
    moving = Motion(arm=arm, time=out.times, q=np.zeros((3, 3)), tasks=(Task(out).resolve_axes(arm),))
    with pytest.raises(Infeasible, match="at 0 s it meets a singularity of its tasks"):
        moving.state(0.0)


# The interpolant is C² and on the path, or an error says that it is not.


def on_circle(samples, cyclic=True, **settings):
    """Return a motion of the paper's arm with its tool on a circle and a prescribed direction of its last link."""
    path = circle([0.3, 0.0], 0.05, duration=1.0, samples=samples)
    turn = 0.3 * np.sin(2 * np.pi * path.times)
    wrist = path.positions - 0.1375 * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    reach = np.linalg.norm(wrist, axis=1)
    elbow = np.arccos((reach**2 - 2 * 0.176**2) / (2 * 0.176**2))
    shoulder = np.arctan2(wrist[:, 1], wrist[:, 0]) - elbow / 2
    q = np.stack([shoulder, elbow, turn - shoulder - elbow], axis=-1)
    q[-1] = q[0]
    task = Task(path).resolve_axes(ARM)
    return Motion(
        arm=ARM, time=path.times, q=q, tasks=(task,), cyclic=cyclic, **{"differences": "backward", **settings}
    )


@pytest.mark.parametrize("cyclic", [False, True])
def test_the_interpolant_returns_the_samples_at_their_times(cyclic):
    motion = on_circle(31, cyclic)
    assert motion.tracking_error.max() < 1e-12
    np.testing.assert_allclose(motion.at(motion.time), motion.q, atol=1e-11)
    free = Motion(arm=ARM, time=motion.time, q=motion.q, cyclic=cyclic, differences="backward")
    np.testing.assert_allclose(free.at(motion.time), motion.q, atol=1e-14)


@pytest.mark.parametrize("tasks", [True, False])
@pytest.mark.parametrize("cyclic", [False, True])
def test_the_interpolant_has_continuous_second_derivatives(tasks, cyclic):
    motion = on_circle(21, cyclic)
    motion = motion if tasks else Motion(arm=ARM, time=motion.time, q=motion.q, cyclic=cyclic, differences="backward")
    h = 1e-4
    around = np.arange(-2, 3) * h
    for knot in motion.time[3:-3]:
        left, right = (motion.at(knot + sign * h * 3 + around) for sign in (-1, 1))
        second = [np.diff(side, n=2, axis=0).mean(axis=0) / h**2 for side in (left, right)]
        third = np.abs(np.diff(motion.ddq, axis=0)).max() / (motion.time[1] - motion.time[0])
        assert np.abs(second[0] - second[1]).max() < 12 * h * third + 1e-3


@pytest.mark.parametrize("t", [-1e-6, 1.0 + 1e-6, np.nan, np.inf])
def test_times_outside_the_motion_are_refused(t):
    motion = Motion(arm=ARM, time=even(5), q=np.zeros((5, 3)))
    with pytest.raises(InvalidInput, match=f"at: times t:? must be (from 0 s to 1 s|finite), got {t:g}"):
        motion.at(np.array([0.5, t]))


def test_a_motion_that_has_lost_its_path_is_not_led_somewhere_else():
    far = line([5.0, 0.0], [6.0, 0.0], duration=1.0, samples=5)
    motion = Motion(arm=ARM, time=far.times, q=np.full((5, 3), 0.3), tasks=(Task(far).resolve_axes(ARM),))
    with pytest.raises(Infeasible, match=r"at: the motion must follow its path, but at 0\.25 s its tool is"):
        motion.at(np.array([0.25]))
