"""The equation of motion beside dynamics: its terms by differences, its solution by Gauss' principle."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik import kinetic_energy, line
from paretoik.errors import InvalidInput
from paretoik.resolution.variational import equation_of_motion
from paretoik.robot import dynamics, kinematics
from paretoik.robot.arms import tringali_3r
from tests.self_motion.test_motion_starts import task_of

PATH = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=26)
ARM = tringali_3r()
POSTURES = np.random.default_rng(0).uniform(-1.5, 1.5, (4, 3))
VELOCITIES = np.random.default_rng(1).normal(size=(4, 3))
TIMES = np.array([0.0, 0.2, 0.5, 1.0])


@pytest.fixture(scope="module")
def equation():
    return equation_of_motion(task_of(ARM, PATH, objectives=[kinetic_energy]))


def tool(q):
    return kinematics.forward_kinematics(ARM, q)[1][..., :2]


def test_terms_are_inertia_coriolis_torques_and_what_the_path_asks_for(equation):
    terms, h = equation.terms(TIMES, POSTURES, VELOCITIES), 1e-5
    np.testing.assert_allclose(terms.inertia, dynamics.inertia_matrix(ARM, POSTURES), rtol=1e-12, atol=1e-15)
    flat = ARM.mounted(gravity=(0.0, 0.0, 0.0))
    torque = dynamics.inverse_dynamics(flat, POSTURES, VELOCITIES, np.zeros_like(POSTURES))
    np.testing.assert_allclose(terms.torque, torque, rtol=1e-10, atol=1e-14)
    rates = (tool(POSTURES + h * VELOCITIES) - tool(POSTURES - h * VELOCITIES)) / (2 * h)
    np.testing.assert_allclose((terms.jacobian @ VELOCITIES[..., None])[..., 0], rates, atol=1e-9)
    before, after = np.maximum(TIMES - h, 0.0), np.minimum(TIMES + h, 1.0)
    travel = (PATH.at(after)[0] - PATH.at(before)[0]) / (after - before)[:, None]
    np.testing.assert_allclose(terms.velocity, travel, atol=1e-4)
    second = (tool(POSTURES + h * VELOCITIES) - 2 * tool(POSTURES) + tool(POSTURES - h * VELOCITIES)) / h**2
    np.testing.assert_allclose(equation.targets[2](TIMES) - terms.acceleration, second, atol=1e-4)


def test_accelerations_follow_the_path_and_no_torque_drives_the_self_motion(equation):
    terms = equation.terms(TIMES, POSTURES, VELOCITIES)
    ddq = equation(TIMES, np.concatenate([POSTURES, VELOCITIES], axis=1))[:, 3:]
    np.testing.assert_allclose(np.einsum("mrj,mj->mr", terms.jacobian, ddq), terms.acceleration, atol=1e-9)
    torque = np.einsum("mij,mj->mi", terms.inertia, ddq) + terms.torque
    null = np.linalg.svd(terms.jacobian)[2][:, 2]
    np.testing.assert_allclose(np.einsum("mj,mj->m", null, torque), 0.0, atol=1e-12)


def test_first_rates_have_the_least_kinetic_energy_of_all_that_follow_the_path(equation):
    rates, terms = equation.initial_rates(POSTURES), equation.terms(np.zeros(4), POSTURES, np.zeros((4, 3)))
    np.testing.assert_allclose(np.einsum("mrj,mj->mr", terms.jacobian, rates), terms.velocity, atol=1e-10)
    null = np.linalg.svd(terms.jacobian)[2][:, 2]
    np.testing.assert_allclose(np.einsum("mj,mij,mi->m", null, terms.inertia, rates), 0.0, atol=1e-12)
    again = equation.project(np.zeros(4), POSTURES, rates + 0.3 * null)
    shift = np.einsum("mj,mij,mi->m", null, terms.inertia, again - rates - 0.3 * null)
    np.testing.assert_allclose(shift, 0.0, atol=1e-12)


def test_arms_with_a_joint_that_moves_no_mass_are_refused():
    massless = pk.Arm.planar(lengths=[0.2] * 3, masses=[1.0, 1.0, 0.0], centers=[0.1] * 3, inertias=[0.01, 0.01, 0.0])
    with pytest.raises(InvalidInput, match="every joint moves a mass"):
        equation_of_motion(task_of(massless, PATH, objectives=[kinetic_energy]))
