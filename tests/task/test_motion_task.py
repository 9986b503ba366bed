"""Motion tasks: what they are made of, what limits they name, and every refusal in one line."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik import Limits, Pose, Task, circle, joint_travel, kinetic_energy, line
from paretoik.errors import InvalidInput
from paretoik.robot.arms import marcos_nr, tringali_3r
from paretoik.task.motion_task import MotionTask
from paretoik.task.motion_task_validation import motion_task
from paretoik.task.obstacles import Circle

ARM = tringali_3r()
LINE = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=21)
POSTURE = np.array([-0.6, 0.9, 0.8])


def task(path=LINE, arm=ARM, **changed) -> MotionTask:
    defaults = {
        "objectives": [kinetic_energy],
        "limits": None,
        "constraints": (),
        "obstacles": (),
        "link_radius": 0.0,
        "start": "free",
        "end_velocity": None,
        "cyclic": False,
        "differences": "backward",
    }
    return motion_task(arm, path, **{**defaults, **changed})


def from_posture(q=POSTURE, arm=ARM, samples=21):
    """Return a line that begins where the arm's tool is at posture q."""
    place = pk.Motion(arm=arm, time=np.arange(3.0), q=np.tile(q, (3, 1))).tool[0]
    return line(place, place + np.array([-0.05, 0.05]), duration=1.0, samples=samples)


def test_a_motion_task_knows_its_times_equations_and_redundancy():
    found = task(arm=marcos_nr(4), path=line(Pose.planar(2, 1, 0), Pose.planar(1, 2, 1), duration=2.0, samples=11))
    assert (found.rows, found.redundancy, found.ends_at_rest, found.start) == (3, 1, False, None)
    np.testing.assert_array_equal(found.times, np.linspace(0, 2, 11))
    assert found.targets.shape == (11, 11)


def test_motions_of_a_task_carry_all_that_the_task_says():
    post = Circle([0.2, 0.3], 0.05)
    path = circle([0.4178, 0.0], 0.05, duration=1.0, samples=21)
    found = task(path=path, obstacles=[post], link_radius=0.02, cyclic=True, differences="central")
    motion = found.motion(np.zeros((2, 21, 3)))
    assert (motion.cyclic, motion.differences, motion.link_radius, motion.obstacles) == (True, "central", 0.02, (post,))
    assert motion.tasks == found.tasks
    np.testing.assert_array_equal(motion.time[0], path.times)


def test_a_path_a_task_and_a_list_of_them_are_all_understood():
    for given in (LINE, Task(LINE), [LINE], (Task(LINE, axes="xy"),)):
        assert [one.axes for one in task(path=given).tasks] == ["xy"]


def test_the_arm_of_the_task_carries_the_position_limits_that_hold():
    declared = pk.Arm.planar(lengths=[0.2] * 3, position_limits=[1.0, 2.0, 3.0])
    narrow = task(arm=declared, limits=Limits(position={"joint2": 0.5})).arm
    np.testing.assert_array_equal(narrow.position_limits, [[-1, 1], [-0.5, 0.5], [-3, 3]])
    varying = (np.linspace(-1, 0, 21)[:, None] * np.ones(3), np.linspace(1, 3, 21)[:, None] * np.ones(3))
    np.testing.assert_array_equal(
        task(arm=declared, limits=Limits(position=varying)).arm.position_limits, [[-1, 3]] * 3
    )
    np.testing.assert_array_equal(
        task(arm=declared, limits=Limits(position=np.inf)).arm.position_limits, [[-np.inf, np.inf]] * 3
    )


def test_limits_are_named_in_the_order_of_their_columns():
    @pk.constraint(unit="m", lower=0.0)
    def above_ground(motion):
        return motion.tool[..., 1]

    limits = Limits(position=[1.0, np.inf, 2.0], torque={"joint2": 0.5}, clearance=0.01)
    found = task(limits=limits, obstacles=[Circle([1, 1], 0.1)], constraints=[above_ground])
    assert found.limit_names == (
        "position of joint1",
        "position of joint3",
        "torque of joint2",
        "clearance",
        "above_ground",
    )


def test_violations_are_the_worst_of_every_limit():
    @pk.constraint(unit="m", lower=0.05, upper=0.25)
    def height(motion):
        return motion.tool[..., 1]

    post = Circle([0.3, 0.3], 0.1)
    limits = Limits(position=(-1.0, [1.0, np.inf, 2.0]), velocity=3.0, clearance=0.02)
    found = task(limits=limits, obstacles=[post], link_radius=0.01, constraints=[height])
    motions = found.motion(np.random.default_rng(0).normal(size=(5, 21, 3)))
    columns = dict(zip(found.limit_names, found.violations(motions).T, strict=True))
    q, v = motions.q, motions.dq
    np.testing.assert_allclose(columns["position of joint1"], np.maximum(q[..., 0] - 1, -1 - q[..., 0]).max(axis=1) / 2)
    np.testing.assert_allclose(columns["position of joint2"], (-1 - q[..., 1]).max(axis=1))
    np.testing.assert_allclose(columns["velocity of joint3"], (np.abs(v[..., 2]).max(axis=1) - 3) / 6)
    np.testing.assert_allclose(columns["clearance"], (0.02 - motions.clearance.min(axis=1)) / 0.02)
    y = motions.tool[..., 1]
    np.testing.assert_allclose(columns["height"], np.maximum(y - 0.25, 0.05 - y).max(axis=1) / 0.2)
    np.testing.assert_allclose(found.violations(motions[3]), found.violations(motions)[3], rtol=1e-12)


def test_limits_along_the_path_hold_each_at_its_own_sample():
    bound = np.full((21, 3), 2.0)
    bound[7] = 0.1
    found = task(limits=Limits(position=bound))
    q = np.full((2, 21, 3), 0.05)
    q[0, 8] = 0.3
    q[1, 7] = 0.3
    violations = found.violations(found.motion(q))
    assert (violations[0] <= 0).all()
    np.testing.assert_allclose(violations[1], 0.2 / 0.2)


def test_a_task_without_limits_has_no_violations():
    found = task()
    assert found.limit_names == ()
    assert found.violations(found.motion(np.zeros((4, 21, 3)))).shape == (4, 0)
    assert found.describe_violation(found.motion(np.zeros((21, 3)))) == ""


def test_the_binding_limit_is_told_with_joint_share_sample_and_time():
    found = task(limits=Limits(position=1.0, velocity=50.0))
    q = np.zeros((21, 3))
    assert found.describe_violation(found.motion(q)) == ""
    q[5, 1] = 1.5
    assert (
        found.describe_violation(found.motion(q))
        == "position of joint2 is exceeded by 25 % of its range at sample 5 (0.25 s)"
    )
    q[5, 1] = 1.5 + 1e-9
    q[11, 2] = -9.0
    told = found.describe_violation(found.motion(q))
    assert told == "position of joint3 is exceeded by 400 % of its range at sample 11 (0.55 s)"


def test_limits_that_are_violated_alike_are_told_together():
    found = task(limits=Limits(position=1.0, velocity=500.0))
    q = np.zeros((21, 3))
    q[5, 1], q[7, 2] = 1.5, -1.5
    told = found.describe_violation(found.motion(q))
    assert told.startswith("position of joint2 is exceeded by 25 % of its range at sample 5 (0.25 s); so is")
    assert told.endswith("so is position of joint3 at sample 7 (0.35 s)")


def test_a_binding_clearance_is_told_by_its_name():
    found = task(obstacles=[Circle([0.2, 0.0], 0.05)], limits=Limits(clearance=0.01))
    assert found.describe_violation(found.motion(np.zeros((21, 3)))).startswith("clearance is 0.06 m short at sample 0")


def test_a_start_on_the_path_is_taken_as_it_is():
    np.testing.assert_array_equal(task(path=from_posture(), start=POSTURE).start, POSTURE)
    np.testing.assert_array_equal(task(path=from_posture(), start=POSTURE.tolist()).start, POSTURE)


ELSEWHERE = circle([0.4, 0.0], 0.05, duration=1.0, samples=21)
LATER = line([0.3, 0.0], [0.2, 0.2], duration=2.0, samples=21)
UNNAMED = pk.objective(unit="", form="integral", name="kinetic_energy")(lambda motion: motion.q[..., 0])


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"path": []}, "wants at least one path or task, got none"),
        ({"path": None}, "path wants a Path, a Task or several of them, got None"),
        ({"path": [LINE, "line"]}, "path wants a Path, a Task or several of them, got 'line'"),
        ({"path": [LINE, LATER]}, "task 2: must be sampled at the same times as task 1"),
        ({"path": [LINE, ELSEWHERE]}, "is not redundant for this task: 3 joints for 4 equations; ask for fewer axes"),
        (
            {"path": line(Pose.planar(0.4, 0, 0), Pose.planar(0.2, 0.1, 1), duration=1.0)},
            "Tringali 3R, printed masses is not redundant for this task: 3 joints for 3 equations; ask for fewer axes",
        ),
        ({"objectives": []}, "objectives: wants at least one, got none"),
        ({"objectives": kinetic_energy}, "objectives: wants a list, got Objective kinetic_energy"),
        ({"objectives": [len]}, "objectives: wants functions decorated with @objective, got <built-in function len>"),
        (
            {"objectives": [kinetic_energy, joint_travel, UNNAMED]},
            "objectives: names must differ, got kinetic",
        ),
        ({"constraints": [len]}, "constraints: wants functions decorated with @constraint, got <built-in"),
        ({"cyclic": True}, "cyclic=True wants a closed path, but the path does not end where it starts"),
        ({"end_velocity": 1.0}, r"end_velocity must be None \(free\) or 0 on an open motion, got 1\.0"),
        ({"end_velocity": 0, "cyclic": True, "path": ELSEWHERE}, "or 0 on an open motion, got 0"),
        ({"start": "zero"}, "start must be 'free' or 3 joint positions, got 'zero'"),
        ({"start": [0.0, 0.0]}, r"start must be 'free' or 3 finite joint positions, got \[0\.0, 0\.0\]"),
        ({"start": [0.0, np.nan, 0.0]}, "start must be 'free' or 3 finite joint positions, got"),
        ({"start": [0.0, np.inf, 0.0]}, "start must be 'free' or 3 finite joint positions, got"),
        ({"start": None}, "start must be 'free' or 3 finite joint positions, got None"),
        ({"start": [0.0, 0.0, 0.0]}, r"start is 0\.0217 m \(or rad\) off the path's first sample; wants at most 1e-06"),
        ({"limits": Limits(velocity=-1.0)}, "velocity limit of joint1: wants lower ≤ upper"),
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
    with pytest.raises(InvalidInput, match=f"start is {off:.3g} m "):
        task(path=shifted, start=POSTURE)


def test_a_start_outside_its_limits_is_refused_with_the_joint():
    with pytest.raises(InvalidInput, match=r"start: joint2 at 0\.9 is outside its limits -0\.5 to 0\.5"):
        task(path=from_posture(), start=POSTURE, limits=Limits(position={"joint2": 0.5}))


def test_only_the_limit_at_the_start_counts_for_the_start():
    bound = np.full((21, 3), 0.1)
    bound[0] = 1.0
    assert task(path=from_posture(), start=POSTURE, limits=Limits(position=bound)).start is not None


def test_an_upside_down_start_is_not_taken_for_an_upright_one():
    arm = marcos_nr(4)
    q = np.array([0.3, 0.4, 0.5, 0.6])
    place = pk.Motion(arm=arm, time=np.arange(3.0), q=np.tile(q, (3, 1))).tool[0]
    path = line(Pose.planar(*place, 1.8 + np.pi), Pose.planar(*place, 1.8 + 2), duration=1.0, samples=11)
    with pytest.raises(InvalidInput, match=r"start is 3\.14 m \(or rad\) off"):
        task(arm=arm, path=path, start=q)
