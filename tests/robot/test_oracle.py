"""Every kernel against Pinocchio, and every derivative by a complex step against Pinocchio's analytic ones."""

from __future__ import annotations

import numpy as np
import pinocchio
import pytest

from paretoik.robot import dynamics, kinematics
from tests.robot.oracles import STEP, potential_energy

WORLD = pinocchio.LOCAL_WORLD_ALIGNED


def agree(ours, theirs, tolerance=1e-12):
    scale = np.abs(theirs).max()
    assert np.isfinite(ours).all()
    assert np.abs(ours - theirs).max() <= tolerance * scale


def slopes(function, q):
    """Return ∂f/∂q, the direction last, by one complex step per joint."""
    steps = 1j * STEP * np.eye(q.shape[-1])
    return np.stack([function(q + step).imag / STEP for step in steps], axis=-1)


def test_tool_pose_agrees_with_pinocchio(oracle, samples):
    q = samples(oracle.arm)[0]

    def peer(x):
        pinocchio.framesForwardKinematics(oracle.model, oracle.data, x)
        return oracle.data.oMf[oracle.tool].homogeneous[:3]

    theirs = oracle.over(peer, q)
    rotation, position = kinematics.forward_kinematics(oracle.arm, q)
    agree(rotation, theirs[..., :3])
    agree(position, theirs[..., 3])


def test_jacobian_agrees_with_pinocchio(oracle, samples):
    q = samples(oracle.arm)[0]
    theirs = oracle.over(
        lambda x: pinocchio.computeFrameJacobian(oracle.model, oracle.data, x, oracle.tool, WORLD).copy(), q
    )
    agree(kinematics.jacobian(oracle.arm, q), theirs)


@pytest.mark.parametrize("joint", [0, -1])
def test_origins_and_jacobians_of_a_joints_frame_agree_with_pinocchio(oracle, samples, joint):
    arm, q = oracle.arm, samples(oracle.arm)[0]
    number = oracle.model.njoints - 1 if joint else 1

    def peer(x):
        pinocchio.computeJointJacobians(oracle.model, oracle.data, x)
        jacobian = pinocchio.getJointJacobian(oracle.model, oracle.data, number, WORLD)
        return np.concatenate([oracle.data.oMi[number].translation[:, None], jacobian[:3], jacobian[3:]], axis=1)

    theirs = oracle.over(peer, q)
    frame = arm.joint_names[joint]
    np.testing.assert_allclose(arm.pose(q, frame=frame).position, theirs[..., 0], atol=1e-12)
    ours = arm.jacobian(q, frame=frame)
    np.testing.assert_allclose(np.concatenate([ours[:, :3], ours[:, 3:]], axis=-1), theirs[..., 1:], atol=1e-12)


def test_every_joint_torque_agrees_with_pinocchio_on_its_own_scale(oracle, samples):
    theirs = oracle.over(lambda *x: pinocchio.rnea(oracle.model, oracle.data, *x).copy(), *samples(oracle.arm))
    ours = dynamics.inverse_dynamics(oracle.arm, *samples(oracle.arm))
    for joint in range(oracle.arm.dof):
        agree(ours[:, joint], theirs[:, joint])


def test_inertia_matrix_agrees_with_pinocchio(oracle, samples):
    q = samples(oracle.arm)[0]

    def peer(x):
        upper = np.triu(pinocchio.crba(oracle.model, oracle.data, x))
        return upper + np.triu(upper, 1).T

    agree(dynamics.inertia_matrix(oracle.arm, q), oracle.over(peer, q))


def test_energies_agree_with_pinocchio(oracle, samples):
    q, dq, _ = samples(oracle.arm)
    kinetic = oracle.over(lambda x, v: pinocchio.computeKineticEnergy(oracle.model, oracle.data, x, v), q, dq)
    agree(dynamics.kinetic_energy(oracle.arm, q, dq), kinetic)
    if np.any(oracle.arm.gravity):
        potential = oracle.over(lambda x: pinocchio.computePotentialEnergy(oracle.model, oracle.data, x), q)
        agree(potential_energy(oracle.arm, q), potential)
    else:
        assert np.all(potential_energy(oracle.arm, q) == 0.0)


@pytest.mark.parametrize("which", [0, 1, 2])
def test_torque_derivatives_by_complex_step_agree_with_pinocchio(oracle, samples, which):
    state = list(samples(oracle.arm, 8))

    def varied(x):
        return dynamics.inverse_dynamics(oracle.arm, *state[:which], x, *state[which + 1 :])

    def peer(*x):
        result = pinocchio.computeRNEADerivatives(oracle.model, oracle.data, *x)[which].copy()
        return np.triu(result) + np.triu(result, 1).T if which == 2 else result

    agree(slopes(varied, state[which]), oracle.over(peer, *state), 1e-10)


def test_jacobian_derivative_by_complex_step_agrees_with_pinocchio(oracle, samples):
    q, dq, _ = samples(oracle.arm, 8)

    def peer(x, v):
        pinocchio.computeJointJacobiansTimeVariation(oracle.model, oracle.data, x, v)
        pinocchio.updateFramePlacements(oracle.model, oracle.data)
        return pinocchio.getFrameJacobianTimeVariation(oracle.model, oracle.data, oracle.tool, WORLD).copy()

    ours = kinematics.jacobian(oracle.arm, q + 1j * STEP * dq).imag / STEP
    agree(ours, oracle.over(peer, q, dq), 1e-10)
