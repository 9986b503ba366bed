"""Tasks: axes of paths, errors and their Jacobian on planar and spatial arms, and refusals."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from paretoik import Arm, Path, Pose, Task, line, poses
from paretoik.errors import InvalidInput
from paretoik.robot.arms import marcos_nr
from paretoik.robot.kinematics import characteristic_length, forward_kinematics, link_frames
from paretoik.robot.pose import quaternion_to_matrix, rotation_vector
from paretoik.task.retraction import retract_nearest, task_errors
from tests.formulations.problems import panda, random_arm
from tests.robot.urdf_text import joint, link
from tests.trajectory.scaled_problems import Units, on_a_rail

SLIDING = Arm.from_dh(
    a=[0.1, 0.2, 0.3, 0.2, 0.1, 0.1, 0.05],
    alpha=[0.3, -1.2, 0.7, 1.5, -0.4, 1.0, 0.2],
    d=[0.3, 0.0, 0.1, 0.2, 0.1, 0.0, 0.1],
    theta=[0.0] * 7,
    types=["revolute", "prismatic", "revolute", "revolute", "prismatic", "revolute", "revolute"],
    convention="modified",
    name="arm with slides",
)
PLANAR, SPATIAL = marcos_nr(4), random_arm(4, 7)
GANTRY = on_a_rail(Units(), objectives=["kinetic_energy"]).task.arm
POINTS_2D = line([0.3, 0.2], [0.1, 0.4], duration=1.0, samples=5)
POINTS_3D = line([0.3, 0.2, 0.4], [0.1, 0.4, 0.2], duration=1.0, samples=5)
ENDS = Pose.from_rpy((0.3, 0.2, 0.4), (0.1, 0.2, 0.3)), Pose.from_rpy((0.1, 0.4, 0.2), (1, -1, 2))
POSES = line(*ENDS, duration=1.0, samples=5)
FLAT_POSES = line(Pose.planar(0.3, 0.2, 0.1), Pose.planar(0.1, 0.4, 2.0), duration=1.0, samples=5)
KINDS = [
    (PLANAR, "xy", POINTS_2D),
    (PLANAR, "xy+angle", FLAT_POSES),
    (SPATIAL, "xy", POINTS_3D),
    (SPATIAL, "xyz+z-axis", POSES),
    (SLIDING, "pose", POSES),
    (panda(), "xyz", POINTS_3D),
    (panda(), "pose", POSES),
]
every_kind = pytest.mark.parametrize(("arm", "axes", "path"), KINDS, ids=[f"{a.name}-{x}-{p}" for a, x, p in KINDS])


def through(arm, q, path, frame="tool", axes="pose"):
    """Return a path of the given kind through the frame's places at postures q."""
    rotations, places = forward_kinematics(arm, q, frame)
    poses = [Pose.from_matrix(rotation, position) for rotation, position in zip(rotations, places, strict=True)]
    quaternions = np.stack([pose.quaternion for pose in poses])
    points = places[:, : path.positions.shape[1]]
    return Path(np.arange(float(len(q))), points, None if path.quaternions is None else quaternions, path.curve)


def targets_at(task, path):
    """Return targets of the samples of a path whose curve is meaningless."""
    size = 2 if task.axes in ("xy", "xy+angle") else 3
    expected = [path.positions[:, :size]]
    if task.axes in ("xy+angle", "xyz+z-axis", "pose"):
        expected.append(quaternion_to_matrix(path.quaternions).reshape(-1, 9))
    return np.concatenate(expected, axis=1)


@pytest.mark.parametrize(
    ("arm", "path", "axes"),
    [
        (PLANAR, POINTS_2D, "xy"),
        (PLANAR, FLAT_POSES, "xy+angle"),
        (SPATIAL, POINTS_3D, "xyz"),
        (SPATIAL, POSES, "pose"),
    ],
)
def test_a_task_without_axes_takes_what_the_path_gives(arm, path, axes):
    resolved = Task(path).resolve_axes(arm)
    assert resolved.axes == axes
    assert resolved.rows == {"xy": 2, "xy+angle": 3, "xyz": 3, "pose": 6}[axes]
    assert resolved.targets(path.times).shape == (5, resolved.target_size)


@every_kind
def test_on_the_path_what_a_target_travels_is_the_error_to_the_next(arm, axes, path):
    q = np.random.default_rng(0).uniform(-1, 1, (6, arm.dof))
    rotations, places = forward_kinematics(arm, q)
    frames = [Pose.from_matrix(rotation, position) for rotation, position in zip(rotations, places, strict=True)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # random poses may make a curve that runs backwards
        path = poses(np.arange(6.0), frames)
    task = Task(path, axes=axes).resolve_axes(arm)
    travels, targets = task.displacements(task.path.times), task.targets(task.path.times)
    assert travels.shape == (6, task.displacement_size)
    assert (travels[-1] == 0).all()
    error, _ = task_errors(arm, [task], q[:-1], targets[1:])
    going = task.displacement_components(arm, link_frames(arm, list(q[:-1].T)), list(travels[:-1].T))
    np.testing.assert_allclose(np.broadcast_arrays(*going, np.zeros(5))[:-1], error.T, atol=1e-10)


@every_kind
def test_the_error_is_what_is_wanted_less_what_is_there(arm, axes, path):
    q = np.random.default_rng(1).uniform(-1, 1, (40, arm.dof))
    elsewhere = np.random.default_rng(2).uniform(-1, 1, (40, arm.dof))
    task = Task(path, axes=axes).resolve_axes(arm)
    targets = targets_at(task, through(arm, elsewhere, path))
    error, _ = task_errors(arm, [task], q, targets)
    rotation, position = forward_kinematics(arm, q)
    size = min(task.rows, 2 if axes in ("xy", "xy+angle") else 3)
    np.testing.assert_allclose(error[:, :size], targets[:, :size] - position[:, :size], atol=1e-14)
    if task.rows > size:
        between = np.swapaxes(rotation, -1, -2) @ targets[:, size:].reshape(-1, 3, 3)
        if axes == "xyz+z-axis":
            axis = between[:, :, 2]
            turn = np.cross([0.0, 0.0, 1.0], axis)
            turn *= (np.arctan2(np.linalg.norm(turn, axis=1), axis[:, 2]) / np.linalg.norm(turn, axis=1))[:, None]
            expected = turn[:, :2]
        else:
            expected = rotation_vector(between)[:, [2] if axes == "xy+angle" else [0, 1, 2]]
        np.testing.assert_allclose(error[:, size:], expected, atol=1e-9)


@every_kind
@pytest.mark.parametrize("frame", ["tool", "joint3"])
def test_the_jacobian_is_the_slope_of_the_error(arm, axes, path, frame):
    frame = frame if frame in ("tool", *arm.joint_names) else arm.joint_names[2]
    q = np.random.default_rng(3).uniform(-1, 1, (8, arm.dof))
    task = Task(path, frame=frame, axes=axes).resolve_axes(arm)
    targets = targets_at(task, through(arm, q, path, frame))
    _, slopes = task_errors(arm, [task], q, targets)
    assert slopes.shape == (8, task.rows, arm.dof)
    h = 1e-6
    for number in range(arm.dof):
        step = np.zeros(arm.dof)
        step[number] = h
        forth, _ = task_errors(arm, [task], q + step, targets)
        back, _ = task_errors(arm, [task], q - step, targets)
        np.testing.assert_allclose(slopes[..., number], (back - forth) / (2 * h), atol=1e-8)
    if frame != "tool":
        assert (slopes[..., 3:] == 0).all()


@pytest.mark.parametrize("axes", ["xy+angle", "xyz+z-axis", "pose"])
def test_half_a_turn_is_as_far_as_it_gets_and_never_taken_for_none(axes):
    arm = PLANAR if axes == "xy+angle" else SPATIAL
    path = FLAT_POSES if axes == "xy+angle" else POSES
    q = np.random.default_rng(6).uniform(-1, 1, (1, arm.dof))
    rotation, position = forward_kinematics(arm, q)
    task = Task(path, axes=axes).resolve_axes(arm)
    about = (0, 0, np.pi) if axes == "xy+angle" else (np.pi, 0, 0)
    size = 2 if axes == "xy+angle" else 3
    for off in (0.0, 1e-13, -1e-13, 1e-9, 1e-6):
        turned = rotation[0] @ Pose.from_rpy((0, 0, 0), tuple(np.array(about) * (1 - off))).rotation
        error, _ = task_errors(arm, [task], q, np.concatenate([position[0, :size], turned.ravel()])[None])
        assert np.linalg.norm(error[0, size:]) == pytest.approx(np.pi, abs=1e-5)


def test_errors_of_several_tasks_stand_one_below_the_other():
    arm, q = random_arm(4, 7), np.random.default_rng(7).uniform(-1, 1, (5, 7))
    first = Task(POINTS_3D).resolve_axes(arm)
    second = Task(POSES, frame="joint5", axes="xyz+z-axis").resolve_axes(arm)
    targets = [task.targets(np.linspace(0, 1, 5)) for task in (first, second)]
    error, slopes = task_errors(arm, [first, second], q, np.concatenate(targets, axis=1))
    for task, expected, rows in ((first, targets[0], slice(0, 3)), (second, targets[1], slice(3, 8))):
        single, slope = task_errors(arm, [task], q, expected)
        np.testing.assert_array_equal(error[:, rows], single)
        np.testing.assert_array_equal(slopes[:, rows], slope)


@pytest.mark.parametrize(
    ("path", "axes", "words"),
    [
        (POSES, "xz", r"axes must be one of xy, xy\+angle, xyz, xyz\+z-axis, pose, got 'xz'"),
        (POINTS_3D, "pose", "path must have poses for axes 'pose', got points"),
        (POINTS_2D, "xyz", "path must have 3-D points for axes 'xyz', got 2-D ones; axes='xy' leaves z free"),
    ],
)
def test_axes_that_the_path_says_nothing_about_are_refused(path, axes, words, unchecked):
    with pytest.raises(InvalidInput, match=words):
        Task(path, axes=axes)


def test_an_arm_in_space_takes_2d_points_only_where_axes_leave_z_free():
    with pytest.raises(InvalidInput, match=r"path must have 3-D points, as .* moves in space, got 2-D .* z free$"):
        Task(POINTS_2D).resolve_axes(SPATIAL)
    assert Task(POINTS_2D, axes="xy").resolve_axes(SPATIAL).rows == 2
    assert Task(POINTS_2D).resolve_axes(GANTRY).axes == "xy"
    assert Task(POINTS_3D).resolve_axes(GANTRY).axes == "xyz"


def test_a_frame_that_is_not_on_the_arm_is_refused_with_those_that_are():
    with pytest.raises(InvalidInput, match=r"frame must be one of .*: tool, base, joint1, .* got 'elbow'"):
        Task(POINTS_2D, frame="elbow").resolve_axes(PLANAR)


# Arms in space follow 2-D points if their frame keeps its height, up to rounded angles of a URDF.


def gantry(tmp_path, slope=1.5708):
    """Return a planar arm on a rail along x; the z axes of its links are along x up to the rounding of ``slope``."""
    links = [link(name) for name in ("rail", "cart", "upper", "fore", "hand")]
    bounds = '<limit lower="-9" upper="9" velocity="3" effort="4"/>'
    joints = [
        joint("slide", "rail", "cart", "prismatic", f'<origin rpy="0 {slope} 0"/><axis xyz="0 0 1"/>{bounds}'),
        joint("turn", "cart", "upper", "revolute", f'<axis xyz="-1 0 0"/>{bounds}'),
        joint("bend", "upper", "fore", "revolute", f'<origin xyz="0 0 0.4"/><axis xyz="-1 0 0"/>{bounds}'),
        joint("grip", "fore", "hand", "fixed", '<origin xyz="0 0 0.3"/>'),
    ]
    file = tmp_path / "gantry.urdf"
    file.write_text(f'<robot name="gantry">{"".join([*links, *joints])}</robot>', encoding="utf-8")
    return Arm.from_urdf(file)


def test_a_gantry_of_rounded_angles_follows_2d_points_and_keeps_its_height(tmp_path):
    arm = gantry(tmp_path)
    task = Task(POINTS_2D).resolve_axes(arm)
    assert task.axes == "xy"
    times, length = np.linspace(0.0, 1.0, 21), characteristic_length(arm)
    targets = task.targets(times)
    q = np.repeat([[0.1, 0.4, 0.5]], len(times), axis=0)
    retracted = retract_nearest(arm, [task], q, targets)
    assert retracted.on_path.all()
    position = arm.pose(retracted.q).position
    np.testing.assert_allclose(position[:, :2], targets, rtol=0.0, atol=1e-12 * length)
    np.testing.assert_allclose(position[:, 2], 0.0, rtol=0.0, atol=1e-4 * length)
    assert np.abs(position[:, 2]).max() > 0.0


@pytest.mark.parametrize("base", [(0.0, 0.0, 0.0), (1e3, 0.0, 0.0)])
def test_a_frame_that_rises_by_more_than_rounded_angles_do_is_refused_wherever_it_stands(tmp_path, base):
    arm = gantry(tmp_path, slope=1.57).mounted(base=Pose(base))
    with pytest.raises(InvalidInput, match="path must have 3-D points"):
        Task(POINTS_2D).resolve_axes(arm)
