"""What motors allow: speeds under a load, by the shape of their curve."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paretoik.capability.actuation import SHAPES, MotorCurve

seeds = st.integers(0, 10**6)


shapes = st.sampled_from(SHAPES)


@given(seed=seeds, shape=shapes)
def test_what_a_curve_allows_is_where_its_room_is_not_negative(seed, shape):
    rng = np.random.default_rng(seed)
    curve = MotorCurve(stall=[2.0, 0.5], fastest=[3.0, 7.0], shape=shape)
    effort, speed = curve.stall * rng.uniform(-1.2, 1.2, (50, 2)), curve.fastest * rng.uniform(-1.2, 1.2, (50, 2))
    low, high = curve.speeds(effort)
    within, room = (low <= speed) & (speed <= high), curve.slacks(effort, speed).min(axis=-1)
    assert (room[within] >= -1e-12).all()
    assert (room[~within] <= 1e-12).all()


def test_a_diamond_is_the_papers_curve_a_strip_lets_a_load_drive_the_motor():
    effort = np.array([-1.0, 0.0, 1.0])[:, None]
    speeds = {shape: MotorCurve(stall=2.0, fastest=4.0, shape=shape).speeds(effort) for shape in SHAPES}
    assert np.ravel(speeds["diamond"][1]).tolist() == [2.0, 4.0, 2.0]
    assert np.ravel(speeds["strip"][1]).tolist() == [4.0, 4.0, 2.0]
    assert np.ravel(speeds["strip"][0]).tolist() == [-2.0, -4.0, -4.0]
    assert np.ravel(speeds["box"][0]).tolist() == [-4.0, -4.0, -4.0]
