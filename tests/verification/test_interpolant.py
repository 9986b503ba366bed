from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.task.motion import Motion
from paretoik.verification.measured_motion import quadrature, rates, rebuild

OPEN = [(samples, False, rest) for samples in (3, 4, 5, 6, 7, 12) for rest in (False, True)]
CYCLIC = [(samples, True, False) for samples in (5, 6, 7, 12)]


@pytest.mark.parametrize("differences", ["spline", "backward", "central"])
@pytest.mark.parametrize(("samples", "cyclic", "rest"), OPEN + CYCLIC)
def test_the_curve_rebuilt_from_its_definition_is_that_of_the_motion(samples, cyclic, rest, differences):
    rng = np.random.default_rng(samples)
    time = np.append(0.0, np.cumsum(rng.uniform(0.5, 1.5, samples - 1)))
    q = rng.normal(size=(samples, 3))
    q[-1] = q[0] if cyclic else q[-1]
    options = {"differences": differences, "cyclic": cyclic}
    motion = Motion(arm=pk.arms.tringali_3r(), time=time, q=q, ends_at_rest=rest, **options)
    curve, instants = rebuild(time, q, ends_at_rest=rest, **options), motion.instants
    t = np.linspace(0.0, time[-1], 50)
    np.testing.assert_allclose(curve(t), motion.at(t, project=False), atol=1e-10)
    for ours, theirs in zip(rates(curve, time, q, **options), (instants.dq, instants.ddq, instants.jerk), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)
    np.testing.assert_allclose(quadrature(time, differences), instants.weights, atol=1e-12)
