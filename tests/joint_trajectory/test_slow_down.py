"""Slowing down: the fewest periods that keep the limits, as a search one by one finds them."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.joint_trajectory.fitting import limit_uses, slow_down
from paretoik.joint_trajectory.trajectory import sample_motion, time_scaling
from tests.joint_trajectory.motions import MOTIONS, PANDA, bench, swing


def measure_of(motion, controller):
    return lambda scaling: limit_uses(sample_motion(motion, scaling), controller, motion.arm)


@given(st.floats(0.6, 1.3), st.floats(0.4, 1.3), st.floats(0.3, 1.3))
@settings(max_examples=8)
def test_one_period_less_would_exceed_a_limit_and_none_more_is_taken(v, a, j):
    motion = swing(duration=1.0, samples=41)
    controller = bench(PANDA, velocity=1.6 * v, acceleration=5.0 * a, jerk=50.0 * j)
    measure, own = measure_of(motion, controller), time_scaling(1.0, 50.0)
    found = slow_down(own, measure)
    periods = own.periods
    while any(use.exceeded for use in measure(replace(own, periods=periods))):
        periods += 1
    assert found.periods == periods


def test_it_is_what_the_peaks_say():
    motion = swing(duration=1.0)
    peak = max(use.value for use in measure_of(motion, bench(PANDA, velocity=1.0))(time_scaling(1.0, 1000.0)))
    found = slow_down(time_scaling(1.0, 1000.0), measure_of(motion, bench(PANDA, velocity=peak / 1.5)))
    assert found.factor == pytest.approx(1.5, rel=1e-3)
    found = slow_down(time_scaling(1.0, 1000.0), measure_of(motion, bench(PANDA, velocity=2 * peak)))
    assert found.factor == 1.0


def test_what_gravity_asks_for_no_slowing_down_takes_away():
    motion = swing(duration=0.5, samples=51)
    assert slow_down(time_scaling(0.5, 100.0), measure_of(motion, bench(PANDA, torque=10.0))) is None


def test_positions_are_no_matter_of_time():
    motion = MOTIONS["planar"]
    found = slow_down(time_scaling(1.0, 100.0), measure_of(motion, bench(motion.arm, position=0.1)))
    assert found.factor == 1.0
