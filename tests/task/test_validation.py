"""Every part of a motion problem is checked, and every refusal is one line."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik import Limits, Pose, Task, circle, joint_travel, kinetic_energy, line
from paretoik.errors import InvalidInput
from paretoik.task.validation import motion_task
from problems import panda
from tests.task.tasks import LINE, POSTURE, from_posture, task

ELSEWHERE = circle([0.4, 0.0], 0.05, duration=1.0, samples=21)
LATER = line([0.3, 0.0], [0.2, 0.2], duration=2.0, samples=21)
UNNAMED = pk.objective(unit="", form="integral", name="kinetic_energy")(lambda motion: motion.q[..., 0])


def test_a_path_a_task_and_a_list_of_them_are_all_understood():
    for path in (LINE, Task(LINE), [LINE], (Task(LINE, axes="xy"),)):
        assert [one.axes for one in task(path=path).tasks] == ["xy"]


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"path": None}, "path must be a Path, a Task or a list of these, got None"),
        ({"path": [LINE, LATER]}, "task 2: must be sampled at the same times as task 1"),
        (
            {"path": [LINE, ELSEWHERE]},
            "must have at least 5 joints for 4 equations, got 3; drop axes or add joints",
        ),
        (
            {"objectives": kinetic_energy},
            "or the library's, such as pk.kinetic_energy, got Objective kinetic_energy",
        ),
        (
            {"objectives": [kinetic_energy, joint_travel, UNNAMED]},
            "objectives: names must differ, got kinetic",
        ),
        ({"cyclic": True}, "path must be closed if cyclic=True, got one that does not end where it starts"),
        ({"start": [0.0, 0.0]}, r"start must be 'free' or 3 finite joint positions, got \[0\.0, 0\.0\]"),
        ({"limits": Limits(velocity=-1.0)}, "velocity limit of joint1 must be lower ≤ upper"),
    ],
)
def test_what_is_no_problem_is_refused_in_one_line(changed, words, unchecked):
    with pytest.raises(InvalidInput, match=words) as refused:
        task(**changed)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("off", [2e-6, 1.0])
def test_a_start_off_the_path_is_refused_with_its_distance(off):
    path = from_posture()
    shifted = line(path.positions[0] + [0.0, off], path.positions[-1] + [0.0, off], duration=1.0, samples=21)
    with pytest.raises(InvalidInput, match=f"start must be at most .*, got {off:.3g} m$"):
        task(path=shifted, start=POSTURE)


def test_a_start_outside_its_limits_is_refused_with_the_joint():
    with pytest.raises(InvalidInput, match=r"start: joint2 must be within its limits -0\.5 to 0\.5, got 0\.9"):
        task(path=from_posture(), start=POSTURE, limits=Limits(position={"joint2": 0.5}))


def test_a_start_of_degrees_is_asked_after():
    with pytest.raises(
        InvalidInput,
        match=r"start must be at most .* m; 51\.5662 rad is 8\.21 turns; if it is in degrees, convert",
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


FOUR_LINKS = pk.Arm.planar(lengths=[1.0] * 4)
POSTURES = np.array([[0.3, 0.5, 0.4, 0.2], [0.5, 0.3, 0.6, 0.4]])


def checked(arm, *ends, **axes):
    return task(arm=arm, objectives=[joint_travel], path=Task(line(*ends, duration=1.0, samples=11), **axes)).tasks[0]


@pytest.mark.parametrize(("rpy", "height"), [([0.2, -0.7, 1.0], 0.0), ([np.pi, 0.0, 0.0], 0.5)])
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
        InvalidInput, match=r"path must have poses in .*, or axes='xy', got a pose tilted by 0\.01 rad$"
    ):
        checked(arm, first, last @ Pose.from_rpy([0.0, 0.0, 0.0], [0.01, 0.0, 0.0]))


@pytest.mark.parametrize("seed", range(4))
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
