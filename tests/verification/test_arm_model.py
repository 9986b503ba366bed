from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.robot import dynamics, kinematics
from paretoik.verification.arm_model import build_model

ARMS = {
    "planar": pk.arms.tringali_3r(),
    "spatial": pk.arms.wan_7r(),
    "sliding": pk.Arm.from_dh(
        a=[0.1, 0.2, 0.3],
        alpha=[0.3, -0.4, 0.5],
        d=[0.1, 0.0, 0.2],
        theta=[0.0, 0.1, 0.2],
        types=["revolute", "prismatic", "revolute"],
        masses=[1.0, 2.0, 3.0],
        centers=[[0.1, 0.0, 0.0]] * 3,
        inertias=[np.diag([0.1, 0.1, 0.1])] * 3,
        convention="modified",
    ).mounted(base=pk.Pose([0.1, 0.2, 0.3])),
}


@pytest.mark.parametrize("name", ARMS)
def test_the_model_built_from_an_arms_numbers_moves_as_the_arm(name):
    arm, rng = ARMS[name], np.random.default_rng(1)
    q, dq, ddq = rng.normal(size=(3, 5, arm.dof))
    model = build_model(arm)
    np.testing.assert_allclose(model.nodes(q), kinematics.link_nodes(arm, q), atol=1e-12)
    np.testing.assert_allclose(model.torques(q, dq, ddq), dynamics.inverse_dynamics(arm, q, dq, ddq), atol=1e-9)
    np.testing.assert_allclose(model.kinetic_energies(q, dq), dynamics.kinetic_energy(arm, q, dq), atol=1e-10)


@pytest.mark.parametrize("name", ARMS)
def test_no_node_moves_farther_than_joints_reach(name):
    arm, rng = ARMS[name], np.random.default_rng(2)
    q = rng.normal(size=(10, arm.dof))
    moved = q + 1e-3 * rng.normal(size=q.shape)
    model = build_model(arm)
    distance = np.linalg.norm(model.nodes(moved) - model.nodes(q), axis=-1).max(axis=1)
    assert (distance <= np.abs(moved - q) @ model.reaches(np.concatenate([q, moved])) + 1e-12).all()
