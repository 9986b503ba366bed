"""Fitting to a controller: what passes, what is refused and with what words, and that the advice is right."""

from __future__ import annotations

import re

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import Infeasible
from paretoik.joint_trajectory.fitting import fit_motion
from paretoik.joint_trajectory.time_scaling import time_scaling
from tests.joint_trajectory.motions import MOTIONS, PANDA, bench, swing

FRANKA = pk.controllers.PANDA


def fitted(motion, controller=FRANKA, slower=False, **scaling):
    return fit_motion(
        motion, time_scaling(float(motion.duration), controller.rate, **scaling), controller, slower=slower
    )


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
