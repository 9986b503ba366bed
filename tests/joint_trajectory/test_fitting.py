"""Fitting to a controller: what passes, what is refused and with what words, and that the advice is right."""

from __future__ import annotations

import re

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import Infeasible
from paretoik.joint_trajectory.fitting import fit_motion
from paretoik.joint_trajectory.trajectory import time_scaling
from tests.joint_trajectory.motions import MOTIONS, PANDA, SWING, bench, least_jerk, swing

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
    burst = swing(duration=2.0, samples=201, law=lambda x: least_jerk(np.clip((x - 0.5) / 0.05, 0, 1)))
    error = refusal(burst, rate=10.0)
    assert error.limit in ("acceleration", "jerk", "torque", "torque rate")
    slow, scaling, uses = fitted(burst, rate=10.0, slower=True)
    whole, own, _ = fitted(burst, slower=True)
    assert len(slow.time) == scaling.periods + 1
    np.testing.assert_allclose(np.diff(slow.time), 0.1, atol=1e-9)
    assert own.factor <= scaling.factor <= own.factor + 0.1
    assert uses[0].use <= 1 + 1e-9
    assert whole.time[-1] <= slow.time[-1] + 1e-9 <= whole.time[-1] + 0.1 + 1e-9


@pytest.mark.parametrize("rate", [3.0, 7.0, 50.0])
def test_at_a_low_rate_a_moving_end_is_refused_with_a_ramp_that_is_allowed(rate):
    moving = MOTIONS["Panda, a pose on a line"]
    error = refusal(moving, rate=rate)
    assert fitted(moving, rate=rate, **advised(error))[1].ramp >= 1 / rate


def test_a_motion_that_is_too_fast_is_refused_by_its_worst_limit_and_the_factor_that_is_advised_is_enough():
    fast = swing(duration=0.4, samples=201)
    error = refusal(fast)
    assert re.search(
        r"controller panda: (velocity|acceleration) of panda_joint\d is .* at 0\.\d+ s, its limit .*; "
        r"slowed down [\d.]+ times it keeps every limit: time_scale=[\d.]+ or slow_down=True \(--slow-down\)",
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


def test_slowing_down_leaves_alone_what_fits():
    _, scaling, _ = fitted(swing(), slower=True)
    assert scaling.factor == 1.0


def test_positions_beyond_their_limits_are_refused_before_all_else():
    beyond = swing(duration=2.0, by=np.array([0.0, 2.5, 0.0, 0.0, 0.0, 0.0, 3.0]))
    error = refusal(beyond)
    assert error.limit == "position"
    wanted = r"position of panda_joint7 is 3.8 rad at (2|1.999) s, its limit 2.8973 rad; no slowing down helps"
    assert re.search(wanted, str(error))
    assert refusal(beyond, slower=True).limit == "position"


def test_torques_that_hold_the_arm_are_no_matter_of_speed():
    error = refusal(swing(), bench(PANDA, torque=10.0))
    assert "no slowing down helps: at rest it is as much" in str(error)


def test_a_controller_that_wants_rest_alone_is_content_with_an_end_velocity_of_zero():
    ends = bench(PANDA, velocity=3.0)
    error = refusal(MOTIONS["Panda, a pose on a line"], ends)
    assert "it must start at rest" in str(error)
    assert fitted(MOTIONS["Panda, a pose on a line"], ends, ramp=0.1)
