"""The benchmark of limits between samples: motions are judged by at(t) alone, and tightening is what it costs."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from studies.benchmarks.between.__main__ import GOAL, finer_grid, outcome, tightening_cost
from studies.benchmarks.between.cases import Case

LIMITS = pk.Limits(acceleration=14.0, velocity=3.5)


def case():
    path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=51)
    arm = pk.arms.tringali_3r()
    return Case(name="line", arm=arm, path=path, objective=pk.kinetic_energy, cyclic=False, limits=LIMITS, obstacles=())


def test_splines_keep_between_samples_what_differences_exceed():
    spline, central = outcome(case(), "spline"), outcome(case(), "central")
    assert spline.violation <= GOAL < 0.01 < central.violation
    assert "acceleration" in central.where
    assert 0 <= tightening_cost(case(), spline) < 0.2


def test_motions_are_judged_by_where_they_are_alone():
    problem = case().problem("spline")
    motion = problem.decode(problem.sample_starts(1, np.random.default_rng(0)))[0]
    dense = finer_grid(problem.task, motion, 10)
    np.testing.assert_array_equal(dense.q, motion.at(dense.time))
    assert dense.differences == "central"
    assert dense.tracking_error.max() == pytest.approx(0.0, abs=1e-9)
