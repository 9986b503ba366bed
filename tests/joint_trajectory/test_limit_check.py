"""Limits, held against a controller that is simulated one command at a time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import paretoik as pk
from paretoik.joint_trajectory.fitting import limit_uses, unrest
from paretoik.joint_trajectory.trajectory import JointTrajectory
from tests.joint_trajectory.motions import MOTIONS, PANDA, bench, sampled

ARM = pk.Arm.planar(lengths=[0.3, 0.2])
SLIDE = pk.Arm.from_dh(
    a=[0.0], alpha=[0.0], d=[0.0], theta=[0.0], types=["prismatic"], convention="modified", joint_names=["rail"]
)


def random_trajectory(seed, samples=9, rate=100.0):
    q, dq, ddq = np.random.default_rng(seed).normal(size=(3, samples, 2)) * [[[1]], [[50]], [[5000]]]
    return JointTrajectory(joint_names=ARM.joint_names, time=np.arange(samples) / rate, q=q, dq=dq, ddq=ddq)


def simulated(trajectory, limits, rate=100.0):
    """Return the largest use of every limit: a robot at rest gets a position each period, and then the last again."""
    largest = dict.fromkeys(("velocity", "acceleration", "jerk"), (0.0, 0.0))
    for joint in range(2):
        q = trajectory.q[0, joint]
        velocity = acceleration = own = 0.0
        commands = [*trajectory.q[:, joint], *[trajectory.q[-1, joint]] * 3]
        for k, command in enumerate(commands):
            before = velocity, acceleration, own
            velocity = (command - q) * rate
            acceleration = (velocity - before[0]) * rate
            jerk = (acceleration - before[1]) * rate
            inside = k < len(trajectory.time)
            own = trajectory.ddq[k, joint] if inside else 0.0
            values = {
                "velocity": [velocity, trajectory.dq[k, joint] if inside else 0.0],
                "acceleration": [acceleration, own],
                "jerk": [jerk, (own - before[2]) * rate],
            }
            for kind, pair in values.items():
                for value in pair:
                    largest[kind] = max(largest[kind], (abs(value) / limits[kind][joint], value))
            q = command
    return largest


@given(st.integers(0, 10**6))
@settings(max_examples=40)
def test_velocities_accelerations_and_jerks_are_those_that_a_controller_computes_and_the_curves_own(seed):
    rng = np.random.default_rng(seed + 1)
    limits = {kind: 10 ** rng.uniform(0, 6, 2) for kind in ("velocity", "acceleration", "jerk")}
    trajectory = random_trajectory(seed)
    expected = simulated(trajectory, limits)
    uses = limit_uses(trajectory, bench(ARM, **limits), ARM)
    assert [use.use for use in uses] == sorted((use.use for use in uses), reverse=True)
    for use in uses:
        assert use.use == pytest.approx(expected[use.quantity][0], rel=1e-9)
        assert use.value == pytest.approx(expected[use.quantity][1], rel=1e-9)
        assert use.limit == np.sign(use.value) * limits[use.quantity][ARM.joint_names.index(use.joint)]
    assert {use.quantity for use in uses} == set(limits)


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("sign", [1, -1])
def test_positions_use_their_range_from_its_middle_on(joint, sign):
    trajectory = random_trajectory(3)
    edge = sign * np.abs(trajectory.q[:, joint]).max() * 2
    q = trajectory.q.copy()
    q[5, joint] = edge
    moved = JointTrajectory(**{**vars(trajectory), "q": q})
    bounds = ([-9.0, -9.0], [9.0, 9.0])
    bounds[0 if sign < 0 else 1][joint] = edge / 1.5
    (use,) = limit_uses(moved, bench(ARM, position=bounds), ARM)
    assert (use.quantity, use.joint, use.time) == ("position", ARM.joint_names[joint], 0.05)
    assert use.exceeded
    assert use.limit == pytest.approx(edge / 1.5)
    bounds[0 if sign < 0 else 1][joint] = edge * (1 + 1e-12)
    assert not limit_uses(moved, bench(ARM, position=bounds), ARM)[0].exceeded


def test_the_violation_is_named_by_joint_quantity_time_value_and_limit():
    trajectory = sampled("without tasks")
    uses = limit_uses(trajectory, bench(PANDA, velocity=0.5), PANDA)
    peak = np.abs(trajectory.dq).max()
    assert str(uses[0]) == f"velocity of panda_joint7 is {peak:.6g} rad/s at 1 s, its limit 0.5 rad/s"
    assert uses[0].exceeded


def test_beyond_by_a_hair_is_said_as_that_and_not_as_twice_the_same_number():
    peak = np.abs(sampled("without tasks").dq).max()
    (use,) = limit_uses(sampled("without tasks"), bench(PANDA, velocity=peak * (1 - 2e-8)), PANDA)
    assert use.exceeded
    assert str(use).endswith(f"its limit {peak:.6g} rad/s, beyond it by {use.value - use.limit:.6g} rad/s")


def test_a_slide_has_metres_and_newtons():
    rail = pk.Motion(arm=SLIDE, time=np.linspace(0, 1, 11), q=np.linspace(0, 1, 11)[:, None] ** 2 * 3)
    trajectory = JointTrajectory(
        joint_names=("rail",), time=rail.time, q=rail.q, dq=6 * rail.time[:, None], ddq=np.full((11, 1), 6.0)
    )
    (use,) = limit_uses(trajectory, bench(SLIDE, velocity=1.0), SLIDE)
    assert "m/s at" in str(use)
    assert "rad" not in str(use)
    assert (
        unrest(trajectory, bench(SLIDE), SLIDE)
        == "it must end at rest (end_velocity=0 plans it so), but rail ends with 6 m/s"
    )


def test_torques_are_the_arms_own_with_gravity_and_rise_from_those_that_hold_it():
    trajectory = sampled("without tasks")
    uses = {use.quantity: use for use in limit_uses(trajectory, bench(PANDA, torque=1.0, torque_rate=1.0), PANDA)}
    dense = pk.Motion(arm=PANDA, time=trajectory.time, q=trajectory.q, differences="spline")
    assert uses["torque"].use == pytest.approx(np.abs(dense.torque).max(), rel=1e-3)
    rate = np.abs(np.gradient(dense.torque, trajectory.time, axis=0)).max()
    assert uses["torque rate"].use == pytest.approx(rate, rel=2e-2)
    weightless = pk.Arm.planar(lengths=[0.3, 0.2])
    assert limit_uses(random_trajectory(1), bench(weightless, torque=1e-9), weightless) == []


def test_near_the_end_of_a_joint_the_fr3_may_only_be_slow():
    fr3 = pk.controllers.FR3
    near = np.tile((fr3.position[:, 0] + fr3.position[:, 1]) / 2, (21, 1))
    near[:, 1] = np.linspace(1.5, 1.7, 21)
    dq = np.zeros_like(near)
    dq[:, 1] = 1.0
    trajectory = JointTrajectory(
        joint_names=PANDA.joint_names, time=np.arange(21) * 0.01, q=near, dq=dq, ddq=np.zeros_like(near)
    )
    velocity = next(use for use in limit_uses(trajectory, fr3, PANDA) if use.quantity == "velocity")
    assert velocity.joint == "panda_joint2"
    assert velocity.limit == pytest.approx(np.sqrt(5.17 * (1.7918 - 1.7)) - 0.2)
    assert velocity.exceeded


@pytest.mark.parametrize(
    ("name", "rest_acceleration", "said"),
    [
        ("without tasks", True, None),
        ("Panda, a pose on a line", False, "it must start at rest, but panda_joint"),
        ("planar", False, "it must start at rest, but joint"),
        ("cyclic", True, "it must start at rest, but joint"),
    ],
)
def test_what_moves_at_an_end_is_named(name, rest_acceleration, said):
    motion = MOTIONS[name]
    limits = {"velocity": 2.0, "acceleration": 10.0, "rest_acceleration": rest_acceleration}
    fact = unrest(sampled(name), bench(motion.arm, **limits), motion.arm)
    assert fact is None if said is None else fact.startswith(said)


def test_acceleration_at_an_end_matters_where_the_controller_says_so():
    t = np.linspace(0, 1, 101)
    speed = t * (1 - t)  # at rest at both ends, accelerated there
    falling = JointTrajectory(
        joint_names=ARM.joint_names,
        time=t,
        q=np.tile((t**2 / 2 - t**3 / 3)[:, None], (1, 2)),
        dq=np.tile(speed[:, None], (1, 2)),
        ddq=np.tile((1 - 2 * t)[:, None], (1, 2)),
    )
    assert unrest(falling, bench(ARM), ARM) is None
    fact = unrest(falling, bench(ARM, rest_acceleration=True), ARM)
    assert fact == "it must start at rest, but joint1 starts with 1 rad/s²"
