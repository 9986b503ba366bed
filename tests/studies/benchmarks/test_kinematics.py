"""Robot kernels and Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.robot.arms import tringali_3r
from paretoik.robot.dynamics import inverse_dynamics
from studies.benchmarks import kinematics


def test_the_peer_is_given_the_same_arm():
    pinocchio = pytest.importorskip("pinocchio", reason="the peer, Pinocchio, comes with the extra bench")
    for arm in (tringali_3r(), kinematics.panda()):
        model = kinematics.pinocchio_model(arm)
        data = model.createData()
        q, dq, ddq = np.random.default_rng(1).normal(size=(3, 4, arm.dof))
        torques = [pinocchio.rnea(model, data, *sample) for sample in zip(q, dq, ddq, strict=True)]
        np.testing.assert_allclose(inverse_dynamics(arm, q, dq, ddq), torques, rtol=1e-10, atol=1e-12)
