"""Shared parts of tests of laws: random states and poses, and tolerances."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from paretoik.robot.pose import Pose

seeds = st.integers(0, 10**6)
turns = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda x: np.linalg.norm(x) > 0.1)
positions = st.lists(st.floats(-2, 2), min_size=3, max_size=3)


def pose(position, turn):
    return Pose(position, np.array(turn) / np.linalg.norm(turn))


def same(first, second, tolerance=1e-12):
    scale = max(np.abs(first).max(), np.abs(second).max(), 1e-300)
    assert np.abs(first - second).max() <= tolerance * scale


def state_of(arm, seed, count=4):
    return np.random.default_rng(seed).normal(size=(3, count, arm.dof))
