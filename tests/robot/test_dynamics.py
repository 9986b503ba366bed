"""Energies, torques and inertia: laws of every arm; test_oracle compares them with Pinocchio."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings

from paretoik.robot import dynamics, kinematics
from tests.robot.laws import pose, positions, same, seeds, state_of, turns
from tests.robot.oracles import jacobian_rate


@given(seed=seeds)
@settings(max_examples=15, deadline=None)
def test_inertia_matrix_is_symmetric_positive_and_gives_the_kinetic_energy(anyarm_of, seed):
    arm = anyarm_of(seed)
    q, dq, _ = state_of(arm, seed)
    inertia = dynamics.inertia_matrix(arm, q)
    assert np.array_equal(inertia, np.swapaxes(inertia, -1, -2))
    assert np.linalg.eigvalsh(inertia).min() > 0
    same(np.einsum("ni,nij,nj->n", dq, inertia, dq) / 2, dynamics.kinetic_energy(arm, q, dq))


@given(seed=seeds, place=positions, turn=turns)
@settings(max_examples=15, deadline=None)
def test_turning_base_and_gravity_together_leaves_torques_and_kinetic_energy(anyarm_of, seed, place, turn):
    arm, base = anyarm_of(seed), pose(place, turn)
    turned = arm.mounted(base=base @ arm.base, gravity=base.rotation @ arm.gravity)
    q, dq, ddq = state_of(arm, seed)
    same(dynamics.inverse_dynamics(arm, q, dq, ddq), dynamics.inverse_dynamics(turned, q, dq, ddq))
    same(dynamics.kinetic_energy(arm, q, dq), dynamics.kinetic_energy(turned, q, dq))
    same(dynamics.inertia_matrix(arm, q), dynamics.inertia_matrix(turned, q))
    rotation, position = kinematics.forward_kinematics(arm, q)
    same(kinematics.forward_kinematics(turned, q)[0], base.rotation @ rotation)
    same(kinematics.forward_kinematics(turned, q)[1], base.apply(position))
    twist = np.kron(np.eye(2), base.rotation)
    same(kinematics.jacobian(turned, q), twist @ kinematics.jacobian(arm, q))


@given(seed=seeds)
@settings(max_examples=15, deadline=None)
def test_a_point_payload_adds_its_own_newton_law_through_the_jacobian(anyarm_of, seed):
    arm = anyarm_of(seed)
    q, dq, ddq = state_of(arm, seed)
    jacobian = kinematics.jacobian(arm, q)[:, :3]
    push = np.einsum("nij,nj->ni", jacobian, ddq) + jacobian_rate(arm, q, dq)[:, :3] - arm.gravity
    extra = 2.5 * np.einsum("nij,ni->nj", jacobian, push)
    loaded = dynamics.inverse_dynamics(arm.with_payload(2.5), q, dq, ddq)
    same(loaded, dynamics.inverse_dynamics(arm, q, dq, ddq) + extra, 1e-11)
