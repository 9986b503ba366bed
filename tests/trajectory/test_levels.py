"""Levels of samples, coarse to fine, and the motions that continue on the next."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import Infeasible
from paretoik.trajectory import levels
from paretoik.trajectory.levels import level_samples
from problems import tringali_2020


def test_levels_halve_down_to_the_coarsest():
    assert level_samples(101) == [26, 51, 101]
    assert level_samples(401) == [26, 51, 101, 201, 401]
    assert level_samples(26) == [26]


def test_a_motion_that_leaves_the_path_between_coarse_samples_is_left_out():
    problem = tringali_2020.simulation_1()
    coarse, finer = problem.task.subsample(26), problem.task
    good = pk.plan(problem, starts=4).best.motion.q[::4]
    whirling = good.copy()
    whirling[1::2, 0] += 2 * np.pi  # the same postures, but a whole turn between each and the next
    resampled = levels.resample(coarse, np.stack([whirling, good]), finer)
    assert resampled.shape == (1, 101, 3)
    with pytest.raises(Infeasible, match="no motion found on 26 samples follows the path between them"):
        levels.resample(coarse, whirling[None], finer)
