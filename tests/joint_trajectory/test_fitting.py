"""Fitting to a controller: what passes, what is refused with which words, and that the advice is right."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import paretoik as pk
from paretoik.errors import Infeasible
from paretoik.joint_trajectory.fitting import fit_motion, limit_uses, slow_down, unrest
from paretoik.joint_trajectory.trajectory import JointTrajectory, sample_motion, time_scaling
from tests.joint_trajectory.motions import MOTIONS, PANDA, SWING, bench, least_jerk, sampled, swing

FRANKA = pk.controllers.PANDA


def fitted(motion, controller=FRANKA, slower=False, rate=None, **scaling):
    scaled = time_scaling(float(motion.duration), controller.rate if rate is None else rate, **scaling)
    return fit_motion(motion, scaled, controller, slower=slower)


def refusal(motion, controller=FRANKA, **settings):
    with pytest.raises(Infeasible) as refused:
        fitted(motion, controller, **settings)
    assert refused.value.motion is motion
    return refused.value


def advised(error):
    """Return the settings that a refusal advises."""
    found = dict(re.findall(r"(ramp|time_scale)=([0-9.]+)", str(error)))
    return {name: float(value) for name, value in found.items()} | {"slower": "with slow_down" in str(error)}


def test_a_motion_from_rest_to_rest_within_all_limits_is_taken_as_it_is():
    trajectory, scaling, uses = fitted(swing())
    assert (len(trajectory.time), scaling.factor) == (2001, 1.0)
    assert {use.quantity for use in uses} == {
        "position", "velocity", "acceleration", "jerk", "torque", "torque rate"
    }  # fmt: skip
    assert not any(use.exceeded for use in uses)


def test_a_motion_that_moves_at_its_start_is_refused_and_the_ramp_that_is_advised_is_enough():
    moving = MOTIONS["Panda, a pose on a line"]
    error = refusal(moving)
    assert error.limit == "rest"
    assert re.search(r"controller panda: it must start at rest, but panda_joint\d starts with", str(error))
    trajectory, scaling, _ = fitted(moving, **advised(error))
    assert scaling.ramp > 0
    assert np.abs(trajectory.dq[[0, -1]]).max() == 0.0
    assert np.abs(trajectory.ddq[[0, -1]]).max() == 0.0


def test_what_a_spline_leaves_of_rest_is_judged_on_the_motion_that_was_slowed_down():
    septic = swing(duration=0.2, law=lambda x: x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3), by=2 * SWING)
    error = refusal(septic)
    assert error.limit == "rest"
    factor = advised(error)["time_scale"]
    assert "slow_down=True" in str(error)
    _, scaling, uses = fitted(septic, slower=True)
    assert scaling.factor <= factor <= scaling.factor * 1.01
    assert 0.99 < max(use.use for use in uses) <= 1 + 1e-9
    fitted(septic, time_scale=factor)


def test_at_a_lower_rate_the_limits_still_hold_for_the_motion_at_the_controllers_own():
    burst = swing(duration=1.0, samples=101, law=lambda x: least_jerk(np.clip((x - 0.5) / 0.1, 0, 1)))
    error = refusal(burst, rate=10.0)
    assert error.limit in ("acceleration", "jerk", "torque", "torque rate")
    slow, scaling, uses = fitted(burst, rate=10.0, slower=True)
    whole, own, _ = fitted(burst, slower=True)
    assert len(slow.time) == scaling.periods + 1
    np.testing.assert_allclose(np.diff(slow.time), 0.1, atol=1e-9)
    assert own.factor <= scaling.factor <= own.factor + 0.1
    assert uses[0].use <= 1 + 1e-9
    assert whole.time[-1] <= slow.time[-1] + 1e-9 <= whole.time[-1] + 0.1 + 1e-9


def test_a_motion_that_is_too_fast_is_refused_by_its_worst_limit_and_the_factor_that_is_advised_is_enough():
    fast = swing(duration=0.4, samples=201)
    error = refusal(fast)
    assert re.search(
        r"controller panda: (velocity|acceleration) of panda_joint\d is .* at 0\.\d+ s, its limit .*; "
        r"slowed down [\d.]+ times it satisfies every limit: time_scale=[\d.]+ or slow_down=True \(--slow-down\)",
        str(error),
    )
    assert error.violation > 0
    factor = advised(error)["time_scale"]
    by_factor, scaling, _ = fitted(fast, time_scale=factor)
    fewest, least, _ = fitted(fast, slower=True)
    assert least.factor <= factor <= least.factor * 1.001
    assert len(fewest.time) <= len(by_factor.time) <= len(fewest.time) + 1
    assert refusal(fast, time_scale=(least.periods - 1) / 400)
    assert scaling.ramp == 0


def test_positions_beyond_their_limits_are_refused_before_all_else():
    beyond = swing(duration=2.0, by=np.array([0.0, 2.5, 0.0, 0.0, 0.0, 0.0, 3.0]))
    error = refusal(beyond)
    assert error.limit == "position"
    wanted = r"position of panda_joint7 is 3.8 rad at (2|1.999) s, its limit 2.8973 rad; slowing down does not help"
    assert re.search(wanted, str(error))
    assert refusal(beyond, slower=True).limit == "position"


def test_torques_that_hold_the_arm_are_no_matter_of_speed():
    error = refusal(swing(), bench(PANDA, torque=10.0))
    assert "slowing down does not help: at rest it is as large" in str(error)


def test_a_controller_that_wants_rest_alone_is_content_with_an_end_velocity_of_zero():
    ends = bench(PANDA, velocity=3.0)
    error = refusal(MOTIONS["Panda, a pose on a line"], ends)
    assert "it must start at rest" in str(error)
    assert fitted(MOTIONS["Panda, a pose on a line"], ends, ramp=0.1)


# Limits, compared with a controller that is simulated one command at a time.


ARM = pk.Arm.planar(lengths=[0.3, 0.2])


def random_trajectory(seed, samples=9, rate=100.0):
    q, dq, ddq = np.random.default_rng(seed).normal(size=(3, samples, 2)) * [[[1]], [[50]], [[5000]]]
    return JointTrajectory(joint_names=ARM.joint_names, time=np.arange(samples) / rate, q=q, dq=dq, ddq=ddq)


def simulated(trajectory, limits, rate=100.0):
    """Return the largest use of every limit: a robot at rest gets a position each period, then the last one again."""
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
@settings(max_examples=15)
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


@pytest.mark.parametrize(("joint", "sign"), [(0, 1), (1, -1)])
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


# Slowing down: the fewest periods that keep the limits, compared with a search one by one.


def measure_of(motion, controller):
    return lambda scaling: limit_uses(sample_motion(motion, scaling), controller, motion.arm)


@given(st.floats(0.6, 1.3), st.floats(0.4, 1.3), st.floats(0.3, 1.3))
@settings(max_examples=3)
def test_one_period_less_would_exceed_a_limit_and_none_more_is_taken(v, a, j):
    motion = swing(duration=1.0, samples=41)
    controller = bench(PANDA, velocity=1.6 * v, acceleration=5.0 * a, jerk=50.0 * j)
    measure, own = measure_of(motion, controller), time_scaling(1.0, 50.0)
    found = slow_down(own, measure)
    periods = own.periods
    while any(use.exceeded for use in measure(replace(own, periods=periods))):
        periods += 1
    assert found.periods == periods
