"""Problems give the same bits in a worker as in the process that made them."""

from __future__ import annotations

import io

import cloudpickle
import numpy as np
import pytest

import paretoik as pk
from problems import kim_2021, marcos_2012, panda, tringali_2020

PROBLEMS = [
    kim_2021.directions_dam,
    marcos_2012.first_step,
    panda.across_the_table,
    tringali_2020.simulation_5,
]


@pytest.mark.parametrize("dof", [3, 5, 6])
def test_a_problem_has_the_same_bits_in_a_worker(dof):
    """A worker unpickles arrays as contiguous ones; sums over views would have another order, and other last bits."""
    arm = pk.Arm.planar(lengths=[0.3] * dof, masses=[1.0] * dof)
    path = pk.line([0.5, 0.1], [0.4, 0.4], duration=1.0, samples=9)
    problem = pk.Tracking(arm, path, objectives=[pk.kinetic_energy], bases=2)
    genes = np.random.default_rng(0).uniform(problem.xl, problem.xu, (8, problem.n_var))
    there = cloudpickle.loads(cloudpickle.dumps(problem))
    np.testing.assert_array_equal(there.decode(genes).q, problem.decode(genes).q)
    np.testing.assert_array_equal(there.evaluate(genes)[0], problem.evaluate(genes)[0])


@pytest.mark.parametrize("make", PROBLEMS)
def test_no_array_of_a_problem_is_a_view_with_gaps(make):
    gaps = list[tuple[int, ...]]()

    class Pickler(cloudpickle.Pickler):
        def reducer_override(self, value):
            if isinstance(value, np.ndarray) and not (value.flags.c_contiguous or value.flags.f_contiguous):
                gaps.append(value.strides)
            return super().reducer_override(value)

    Pickler(io.BytesIO()).dump(make())
    assert not gaps
