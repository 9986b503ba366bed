"""Motion tasks: what they are made of, and the limits that they name."""

from __future__ import annotations

import numpy as np

import paretoik as pk
from paretoik import Limits, Pose, circle, line
from paretoik.robot.arms import marcos_nr
from paretoik.task.obstacles import Circle
from paretoik.task.starts import rollout_starts
from tests.task.tasks import task


def test_a_motion_task_knows_its_times_equations_and_redundancy():
    result = task(
        arm=marcos_nr(4),
        objectives=[pk.joint_travel],
        path=line(Pose.planar(2, 1, 0), Pose.planar(1, 2, 1), duration=2.0, samples=11),
    )
    assert (result.rows, result.redundancy, result.ends_at_rest, result.start) == (3, 1, False, None)
    np.testing.assert_array_equal(result.times, np.linspace(0, 2, 11))
    assert result.targets.shape == (11, 11)


def test_motions_of_a_task_carry_all_that_the_task_says():
    post = Circle([0.2, 0.3], 0.05)
    path = circle([0.4178, 0.0], 0.05, duration=1.0, samples=21)
    result = task(path=path, obstacles=[post], link_radius=0.02, cyclic=True, differences="central")
    motion = result.motion(np.zeros((2, 21, 3)))
    assert (motion.cyclic, motion.differences, motion.link_radius, motion.obstacles) == (True, "central", 0.02, (post,))
    assert motion.tasks == result.tasks
    np.testing.assert_array_equal(motion.time[0], path.times)


def test_the_arm_of_the_task_carries_the_position_limits_that_hold():
    declared = pk.Arm.planar(lengths=[0.2] * 3, position_limits=[1.0, 2.0, 3.0])
    narrow = task(arm=declared, objectives=[pk.joint_travel], limits=Limits(position={"joint2": 0.5})).arm
    np.testing.assert_array_equal(narrow.position_limits, [[-1, 1], [-0.5, 0.5], [-3, 3]])
    varying = (np.linspace(-1, 0, 21)[:, None] * np.ones(3), np.linspace(1, 3, 21)[:, None] * np.ones(3))
    np.testing.assert_array_equal(
        task(arm=declared, objectives=[pk.joint_travel], limits=Limits(position=varying)).arm.position_limits,
        [[-1, 3]] * 3,
    )
    np.testing.assert_array_equal(
        task(arm=declared, objectives=[pk.joint_travel], limits=Limits(position=np.inf)).arm.position_limits,
        [[-np.inf, np.inf]] * 3,
    )


def test_limits_that_vary_are_linear_between_the_samples_of_other_paths():
    velocity = np.linspace(1.0, 3.0, 21)[:, None] * np.ones(3)
    velocity[:5, 1] = np.inf
    coarse = task(limits=Limits(velocity=velocity))
    finer = coarse.with_midpoints()
    np.testing.assert_array_equal(finer.bounds["velocity"][::2], coarse.bounds["velocity"])
    upper = finer.bounds["velocity"][..., 1]
    np.testing.assert_allclose(upper[:, 0], np.linspace(1.0, 3.0, 41))
    assert np.isinf(upper[:10, 1]).all()
    np.testing.assert_allclose(upper[10:, 1], np.linspace(1.5, 3.0, 31))
    for other in (finer.subsample(21), finer.resample(21)):
        np.testing.assert_allclose(other.bounds["velocity"], coarse.bounds["velocity"])


def test_limits_are_named_in_the_order_of_their_columns():
    @pk.constraint(unit="m", lower=0.0)
    def above_ground(motion):
        return motion.tool[..., 1]

    limits = Limits(position=[1.0, np.inf, 2.0], torque={"joint2": 0.5}, clearance=0.01)
    result = task(limits=limits, obstacles=[Circle([1, 1], 0.1)], constraints=[above_ground])
    assert result.limit_names == (
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
    result = task(limits=limits, obstacles=[post], link_radius=0.01, constraints=[height])
    motions = result.motion(np.random.default_rng(0).normal(size=(5, 21, 3)))
    columns = dict(zip(result.limit_names, result.violations(motions).T, strict=True))
    q, v = motions.q, motions.dq
    np.testing.assert_allclose(columns["position of joint1"], np.maximum(q[..., 0] - 1, -1 - q[..., 0]).max(axis=1) / 2)
    np.testing.assert_allclose(columns["position of joint2"], (-1 - q[..., 1]).max(axis=1))
    np.testing.assert_allclose(columns["velocity of joint3"], (np.abs(v[..., 2]).max(axis=1) - 3) / 6)
    np.testing.assert_allclose(columns["clearance"], (0.02 - motions.clearance.min(axis=1)) / 0.02)
    y = motions.tool[..., 1]
    np.testing.assert_allclose(columns["height"], np.maximum(y - 0.25, 0.05 - y).max(axis=1) / 0.2)
    np.testing.assert_allclose(result.violations(motions[3]), result.violations(motions)[3], rtol=1e-12)


def test_limits_along_the_path_hold_each_at_its_own_sample():
    bound = np.full((21, 3), 2.0)
    bound[7] = 0.1
    result = task(limits=Limits(position=bound))
    q = np.full((2, 21, 3), 0.05)
    q[0, 8] = 0.3
    q[1, 7] = 0.3
    violations = result.violations(result.motion(q))
    assert (violations[0] <= 0).all()
    np.testing.assert_allclose(violations[1], 0.2 / 0.2)


def test_a_task_without_limits_has_no_violations():
    result = task()
    assert result.limit_names == ()
    assert result.violations(result.motion(np.zeros((4, 21, 3)))).shape == (4, 0)
    assert result.describe_violation(result.motion(np.zeros((21, 3)))) == ""


def test_the_binding_limit_is_told_with_joint_share_sample_and_time():
    result = task(limits=Limits(position=1.0, velocity=50.0))
    q = np.zeros((21, 3))
    assert result.describe_violation(result.motion(q)) == ""
    q[5, 1] = 1.5
    assert (
        result.describe_violation(result.motion(q))
        == "position of joint2 is above its upper limit by 25 % of its range at sample 5 (0.25 s)"
    )
    q[5, 1] = 1.5 + 1e-9
    q[11, 2] = -9.0
    message = result.describe_violation(result.motion(q))
    assert message == "position of joint3 is below its lower limit by 400 % of its range at sample 11 (0.55 s)"


def test_limits_that_are_violated_alike_are_told_together():
    result = task(limits=Limits(position=1.0, velocity=500.0))
    q = np.zeros((21, 3))
    q[5, 1], q[7, 2] = 1.5, -1.5
    message = result.describe_violation(result.motion(q))
    assert message.startswith(
        "position of joint2 is above its upper limit by 25 % of its range at sample 5 (0.25 s); so is"
    )
    assert message.endswith("so is position of joint3 at sample 7 (0.35 s)")


def test_a_binding_clearance_is_told_by_its_name():
    result = task(obstacles=[Circle([0.2, 0.0], 0.05)], limits=Limits(clearance=0.01))
    assert result.describe_violation(result.motion(np.zeros((21, 3)))).startswith(
        "clearance is 0.06 m short at sample 0"
    )


def test_a_motion_that_leaves_its_path_between_samples_is_infinitely_off_and_no_other():
    """Where the first joint turns once around between two samples, the curve passes far from the path."""
    limited = task(limits=Limits(velocity=2.0), path=line([0.35, 0.0], [0.3, 0.1], duration=1.0, samples=11))
    (smooth,) = rollout_starts(limited, 1, np.random.default_rng(0))
    turning = smooth + 2 * np.pi * np.outer(np.arange(11) % 2, [1.0, 0.0, 0.0])
    alone = limited.violation_between(limited.motion(smooth[None]))
    both = limited.violation_between(limited.motion(np.stack([smooth, turning])))
    np.testing.assert_array_equal(both, [alone[0], np.inf])
