"""Every part of a motion problem is checked, and every refusal is one line."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik import Limits, Pose, Task, circle, joint_travel, kinetic_energy, line
from paretoik.errors import InvalidInput
from paretoik.robot.arms import marcos_nr
from paretoik.robot.pose import quaternion_to_matrix
from paretoik.task.retraction import retract_nearest
from paretoik.task.validation import motion_task
from problems import panda
from tests.task.tasks import LINE, POSTURE, from_posture, task

ELSEWHERE = circle([0.4, 0.0], 0.05, duration=1.0, samples=21)
LATER = line([0.3, 0.0], [0.2, 0.2], duration=2.0, samples=21)
UNNAMED = pk.objective(unit="", form="integral", name="kinetic_energy")(lambda motion: motion.q[..., 0])


def test_a_path_a_task_and_a_list_of_them_are_all_understood():
    for path in (LINE, Task(LINE), [LINE], (Task(LINE, axes="xy"),)):
        assert [one.axes for one in task(path=path).tasks] == ["xy"]


def test_a_start_on_the_path_is_taken_as_it_is():
    np.testing.assert_array_equal(task(path=from_posture(), start=POSTURE).start, POSTURE)
    np.testing.assert_array_equal(task(path=from_posture(), start=POSTURE.tolist()).start, POSTURE)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"path": []}, "must be at least one path or task, got none"),
        ({"path": None}, "path must be a Path, a Task or several of them, got None"),
        ({"path": [LINE, "line"]}, "path must be a Path, a Task or several of them, got 'line'"),
        ({"path": [LINE, LATER]}, "task 2: must be sampled at the same times as task 1"),
        (
            {"path": [LINE, ELSEWHERE]},
            "is not redundant for this task, got 3 joints for 4 equations; there must be more joints or fewer axes",
        ),
        (
            {"path": line(Pose.planar(0.4, 0, 0), Pose.planar(0.2, 0.1, 1), duration=1.0)},
            "Tringali 3R, printed masses is not redundant for this task, got 3 joints for 3 equations",
        ),
        ({"objectives": []}, "objectives must be at least one, got none"),
        (
            {"objectives": kinetic_energy},
            "or the library's, such as pk.kinetic_energy, got Objective kinetic_energy",
        ),
        (
            {"objectives": [len]},
            "such as pk.kinetic_energy, got <built-in function len> at index 0",
        ),
        (
            {"objectives": [kinetic_energy, joint_travel, UNNAMED]},
            "objectives: names must differ, got kinetic",
        ),
        ({"constraints": [len]}, "constraints must be a list of functions decorated with @constraint, got <built-in"),
        ({"cyclic": True}, "path must be closed if cyclic=True, got one that does not end where it starts"),
        ({"end_velocity": 1.0}, r"end_velocity must be None \(free\) or 0 on an open motion, got 1\.0"),
        ({"end_velocity": 0, "cyclic": True, "path": ELSEWHERE}, "or 0 on an open motion, got 0"),
        ({"start": "zero"}, "start must be 'free' or 3 joint positions, got 'zero'"),
        ({"start": [0.0, 0.0]}, r"start must be 'free' or 3 finite joint positions, got \[0\.0, 0\.0\]"),
        ({"start": [0.0, np.nan, 0.0]}, "start must be 'free' or 3 finite joint positions, got"),
        ({"start": [0.0, np.inf, 0.0]}, "start must be 'free' or 3 finite joint positions, got"),
        ({"start": None}, "start must be 'free' or 3 joint positions, got None"),
        (
            {"start": [0.0, 0.0, 0.0]},
            r"start must be at most 4\.\d+e-07 m off the path's first sample, got 0\.0217 m",
        ),
        ({"limits": Limits(velocity=-1.0)}, "velocity limit of joint1 must be lower ≤ upper"),
    ],
)
def test_what_is_no_problem_is_refused_in_one_line(changed, words, unchecked):
    with pytest.raises(InvalidInput, match=words) as refused:
        task(**changed)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("off", [2e-6, 1e-3, 1.0])
def test_a_start_off_the_path_is_refused_with_its_distance(off):
    path = from_posture()
    shifted = line(path.positions[0] + [0.0, off], path.positions[-1] + [0.0, off], duration=1.0, samples=21)
    with pytest.raises(InvalidInput, match=f"start must be at most .*, got {off:.3g} m$"):
        task(path=shifted, start=POSTURE)


def test_a_start_outside_its_limits_is_refused_with_the_joint():
    with pytest.raises(InvalidInput, match=r"start: joint2 must be within its limits -0\.5 to 0\.5, got 0\.9"):
        task(path=from_posture(), start=POSTURE, limits=Limits(position={"joint2": 0.5}))


def test_only_the_limit_at_the_start_counts_for_the_start():
    bound = np.full((21, 3), 0.1)
    bound[0] = 1.0
    assert task(path=from_posture(), start=POSTURE, limits=Limits(position=bound)).start is not None


def test_a_start_of_degrees_is_asked_after():
    with pytest.raises(
        InvalidInput, match=r"start must be at most .* m; 51\.5662 rad is 8\.21 turns; of degrees, np\.deg2rad"
    ):
        task(path=from_posture(), start=np.rad2deg(POSTURE))
    with pytest.raises(InvalidInput, match=r"start must be at most .*, got 0\.\d+ m$"):  # radians, elsewhere
        task(path=from_posture(), start=POSTURE + np.array([0.0, 0.5, 0.0]))


@pytest.mark.parametrize("height", [1e-6, -0.2])
def test_a_planar_arm_refuses_points_off_its_plane(height):
    flat = line([0.4678, 0.0, 0.0], [0.0983, 0.1526, 0.0], duration=1.0, samples=21)
    tilted = line([0.4678, 0.0, 0.0], [0.0983, 0.1526, height], duration=1.0, samples=21)
    assert [one.axes for one in task(path=flat).tasks] == ["xy"]
    wish = r"path must have points in the plane z = 0 m of Tringali 3R, printed masses, or axes='xy', got one "
    with pytest.raises(InvalidInput, match=f"{wish}{height:.3g} m off it$"):
        task(path=tilted)
    assert [one.axes for one in task(path=Task(tilted, axes="xy")).tasks] == ["xy"]


def test_the_plane_of_a_planar_arm_is_where_its_base_is():
    raised = pk.arms.tringali_3r().mounted(base=Pose([0.0, 0.0, 0.3]))
    along = line([0.4678, 0.0, 0.3], [0.0983, 0.1526, 0.3], duration=1.0, samples=21)
    assert task(arm=raised, path=along).tasks[0].axes == "xy"
    with pytest.raises(InvalidInput, match=r"in the plane z = 0\.3 m of .* got one -0\.3 m off it"):
        task(arm=raised, path=line([0.4678, 0.0, 0.0], [0.0983, 0.1526, 0.0], duration=1.0, samples=21))


def test_a_planar_arm_refuses_poses_off_its_plane_or_tilted():
    def along(*poses, **axes):
        return task(
            arm=marcos_nr(4), objectives=[joint_travel], path=Task(line(*poses, duration=1.0, samples=11), **axes)
        )

    start, end = Pose.planar(0.4, 0.0, 0.0), Pose.planar(0.3, 0.2, 1.0)
    assert along(start, end).tasks[0].axes == "xy+angle"
    high, down = Pose([0.3, 0.2, 0.5], end.quaternion), Pose.from_rpy([0.3, 0.2, 0.0], [np.pi, 0.0, 0.0])
    with pytest.raises(
        InvalidInput, match=r"path must have poses in the plane z = 0 m of Marcos 4R, .* got one 0\.5 m off"
    ):
        along(start, high)
    with pytest.raises(InvalidInput, match=r"axes='xy', got one tilted out of it by 3\.14 rad"):
        along(start, down)
    for other in (high, down):
        assert along(start, other, axes="xy").tasks[0].rows == 2


FOUR_LINKS = pk.Arm.planar(lengths=[1.0] * 4)
POSTURES = np.array([[0.3, 0.5, 0.4, 0.2], [0.5, 0.3, 0.6, 0.4]])


def checked(arm, *ends, **axes):
    return task(arm=arm, objectives=[joint_travel], path=Task(line(*ends, duration=1.0, samples=11), **axes)).tasks[0]


@pytest.mark.parametrize("rpy", [[0.3, 0.0, 0.0], [0.2, -0.7, 1.0], [np.pi, 0.0, 0.0], [np.pi - 0.4, 0.0, 0.2]])
@pytest.mark.parametrize("height", [0.0, 0.5])
def test_a_planar_arm_follows_its_own_points_and_poses_however_it_is_mounted(rpy, height):
    arm = FOUR_LINKS.mounted(base=Pose.from_rpy([0.1, 0.2, height], rpy))
    first, last = arm.pose(POSTURES)
    assert checked(arm, first, last).axes == "xy+angle"
    assert checked(arm, first.position, last.position).axes == "xy"
    assert checked(arm, *arm.pose(POSTURES, frame="joint4"), frame="joint4").axes == "xy+angle"
    normal = arm.base.rotation[:, 2]
    off = last.position + 0.25 * normal * np.sign(normal[2])
    with pytest.raises(
        InvalidInput, match=r"path must have points in the plane .*, or axes='xy', got one 0\.25 m off it$"
    ):
        checked(arm, first.position, off)
    with pytest.raises(InvalidInput, match=r"path must have poses in .*, or axes='xy\+angle', got one 0\.25 m off it$"):
        checked(arm, first, Pose(off, last.quaternion))
    with pytest.raises(
        InvalidInput, match=r"path must have poses in .*, or axes='xy', got one tilted out of it by 0\.01 rad$"
    ):
        checked(arm, first, last @ Pose.from_rpy([0.0, 0.0, 0.0], [0.01, 0.0, 0.0]))


def test_a_tilted_planar_arm_that_follows_x_and_y_follows_z_too():
    arm = FOUR_LINKS.mounted(base=Pose.from_rpy([0.0, 0.0, 0.0], [0.3, 0.0, 0.0]))
    first, last = arm.pose(POSTURES)
    followed = checked(arm, first, last)
    times = np.linspace(0.0, 1.0, 11)
    q = np.linspace(*POSTURES, 11)
    retracted = retract_nearest(arm, [followed], q, followed.targets(times))
    assert retracted.on_path.all()
    poses, (positions, quaternions) = arm.pose(retracted.q), followed.path.at(times)
    np.testing.assert_allclose(poses.position, positions, atol=1e-11)
    np.testing.assert_allclose(poses.rotation, quaternion_to_matrix(quaternions), atol=1e-11)


def test_the_plane_of_a_tilted_arm_is_printed_by_point_and_normal_and_0_without_a_sign():
    tilted = FOUR_LINKS.mounted(base=Pose.from_rpy([0.0, 0.0, 0.5], [0.3, 0.0, 0.0]))
    words = r"the plane of planar arm, through \(4, 0, 0\.5\) m with the normal \(0, -0\.29552, 0\.955336\),"
    with pytest.raises(InvalidInput, match=words):
        checked(tilted, [2.0, 1.0, 0.0], [1.5, 1.2, 0.0])
    turned_over = FOUR_LINKS.mounted(base=Pose.from_rpy([0.0, 0.0, 0.0], [np.pi, 0.0, 0.0]))
    ends = Pose.planar(2.0, 1.0, 0.1), Pose.planar(1.5, 1.2, 0.3)
    with pytest.raises(InvalidInput, match=r"in the plane z = 0 m of .*, or axes='xy', got one tilted .* by 3\.14 rad"):
        checked(turned_over, *ends)
    assert checked(turned_over, *ends, axes="xy").rows == 2


def test_poses_at_0_up_to_rounding_are_at_the_height_of_a_level_arm():
    arm = FOUR_LINKS.mounted(base=Pose([0.0, 0.0, 0.5]))
    for height in (0.0, 1e-17, -1e-12):
        assert checked(arm, Pose([2.0, 1.0, height]), Pose([1.5, 1.2, height])).axes == "xy+angle"
    with pytest.raises(InvalidInput, match=r"got one -0\.499 m off it"):
        checked(arm, Pose([2.0, 1.0, 1e-3]), Pose([1.5, 1.2, 1e-3]))


def test_a_tool_whose_z_axis_lies_in_the_plane_has_no_angle_to_follow():
    arm = FOUR_LINKS.with_tool(Pose.from_rpy([1.0, 0.0, 0.0], [np.pi / 2, 0.0, 0.0]))
    first, last = arm.pose(POSTURES)
    with pytest.raises(InvalidInput, match=r"axes='xy', got one tilted out of it by 0\.4 rad"):
        checked(arm, first, Pose(last.position, first.quaternion) @ Pose.from_rpy([0.0, 0.0, 0.0], [0.0, 0.0, 0.4]))
    with pytest.raises(
        InvalidInput, match=r"with a z axis that leaves it, or axes='xy', got poses whose z axis lies in it"
    ):
        checked(arm, first, last)
    assert checked(arm, first, last, axes="xy").rows == 2


@pytest.mark.parametrize("ends", [([2.0, 0.0], [1.0, 0.0]), ([2.0, 0.0, 1.0], [1.0, 0.0, 0.5])])
def test_x_and_y_cannot_lead_a_planar_arm_in_a_vertical_plane(ends):
    arm = FOUR_LINKS.mounted(base=Pose.from_rpy([0.0, 0.0, 0.0], [1.5708, 0.0, 0.0]))
    with pytest.raises(InvalidInput, match=r"path: the arm's plane must not be vertical, .* got planar arm in"):
        checked(arm, *ends)


def test_an_upside_down_start_is_not_taken_for_an_upright_one():
    arm = marcos_nr(4)
    q = np.array([0.3, 0.4, 0.5, 0.6])
    place = pk.Motion(arm=arm, time=np.arange(3.0), q=np.tile(q, (3, 1))).tool[0]
    path = line(Pose.planar(*place, 1.8 + np.pi), Pose.planar(*place, 1.8 + 2), duration=1.0, samples=11)
    with pytest.raises(InvalidInput, match=r"start must be at most .*, got 3\.14 rad"):
        task(arm=arm, path=path, start=q)


@pytest.mark.parametrize("seed", range(12))
def test_an_obstacle_is_refused_if_and_only_if_it_overlaps_a_link_that_no_joint_moves(seed):
    rng = np.random.default_rng(seed)
    path = pk.line([0.45, -0.25, 0.3], [0.45, 0.25, 0.3], duration=1.5, samples=5)
    radius, link_radius = rng.uniform(0.02, 0.1, 2)
    center = rng.uniform([-0.2, -0.2, -0.2], [0.2, 0.2, 0.6])
    column = np.array([0.0, 0.0, np.clip(center[2], 0.0, 0.333)])  # to the second joint, which turns at its top
    distance = np.linalg.norm(center - column) - radius - link_radius

    def build():
        motion_task(
            panda.panda(),
            path,
            objectives=[pk.joint_travel],
            obstacles=[pk.obstacles.Sphere([2.0, 0.0, 0.0], 0.1), pk.obstacles.Sphere(center, radius)],
            link_radius=float(link_radius),
        )

    if distance > 0:
        build()
        return
    with pytest.raises(
        InvalidInput, match=r"obstacle 2, a sphere, must be clear of (the base|link 1), which "
    ) as raised:
        build()
    assert f"reaches {-distance:.3g} m into it" in str(raised.value)
