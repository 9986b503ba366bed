"""Integration of motions: known solutions, independent motions, and refused starts."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik import kinetic_energy, line
from paretoik.errors import InvalidInput
from paretoik.resolution.variational import check_tolerance, equation_of_motion, integrate, starts_on_path
from paretoik.robot import dynamics, kinematics
from paretoik.robot.arms import tringali_3r
from paretoik.robot.kinematics import forward_kinematics
from tests.task.test_random_starts import task_of

TIMES = np.linspace(0.0, 2.0, 11)
START = np.array([[1.0, 0.0], [0.0, 3.0], [0.5, -0.5]])


def oscillator(t, state):
    """x'' = −4 x."""
    return np.stack([state[:, 1], -4.0 * state[:, 0]], axis=1)


def exact(start, t):
    x, v = start[:, None, 0], start[:, None, 1]
    return np.stack([x * np.cos(2 * t) + v / 2 * np.sin(2 * t), v * np.cos(2 * t) - 2 * x * np.sin(2 * t)], axis=-1)


@pytest.mark.usefixtures("unchecked")  # the oscillator is no EquationOfMotion
def test_an_oscillator_is_integrated_the_better_the_finer_the_tolerance():
    coarse, fine = (
        np.abs(integrate(oscillator, START, TIMES, tolerance) - exact(START, TIMES)).max()
        for tolerance in (1e-5, 1e-11)
    )
    assert coarse < 1e-3
    assert fine < 1e-9 < coarse


@pytest.mark.usefixtures("unchecked")
def test_a_motion_ends_where_its_rates_grow_without_bound():
    states = integrate(lambda t, y: y**2, np.array([[1.0], [0.1]]), TIMES, 1e-9)  # y = y₀ / (1 − y₀ t)
    assert np.isfinite(states[0, :5]).all()
    assert np.isnan(states[0, 6:]).all()
    np.testing.assert_allclose(states[1, :, 0], 0.1 / (1 - 0.1 * TIMES), rtol=1e-7)


def test_starts_off_the_path_and_tolerances_out_of_range_are_refused_and_others_lie_on_it():
    q = np.array([0.0, 0.327, -0.754])
    first = forward_kinematics(tringali_3r(), q)[1][:2]
    task = task_of(tringali_3r(), line(first, first - 0.05, duration=1.0, samples=11), objectives=[kinetic_energy])
    near = starts_on_path(task, q + 1e-8)
    np.testing.assert_allclose(forward_kinematics(tringali_3r(), near)[1][:2], first, atol=1e-11)
    with pytest.raises(InvalidInput, match=r"start 1 must be .* off the path"):
        starts_on_path(task, np.stack([q, q + 0.1]))
    with pytest.raises(InvalidInput, match="tolerance must be"):
        check_tolerance(np.array([1e-6, 0.1]))


# The equation of motion compared with dynamics: terms by differences, the solution by Gauss' principle


PATH = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=26)
ARM = tringali_3r()
POSTURES = np.random.default_rng(0).uniform(-1.5, 1.5, (4, 3))
VELOCITIES = np.random.default_rng(1).normal(size=(4, 3))
EQUATION_TIMES = np.array([0.0, 0.2, 0.5, 1.0])


@pytest.fixture(scope="module")
def equation():
    return equation_of_motion(task_of(ARM, PATH, objectives=[kinetic_energy]))


def tool(q):
    return kinematics.forward_kinematics(ARM, q)[1][..., :2]


def test_terms_are_inertia_coriolis_torques_and_what_the_path_asks_for(equation):
    terms, h = equation.terms(EQUATION_TIMES, POSTURES, VELOCITIES), 1e-5
    np.testing.assert_allclose(terms.inertia, dynamics.inertia_matrix(ARM, POSTURES), rtol=1e-12, atol=1e-15)
    flat = ARM.mounted(gravity=(0.0, 0.0, 0.0))
    torque = dynamics.inverse_dynamics(flat, POSTURES, VELOCITIES, np.zeros_like(POSTURES))
    np.testing.assert_allclose(terms.torque, torque, rtol=1e-10, atol=1e-14)
    rates = (tool(POSTURES + h * VELOCITIES) - tool(POSTURES - h * VELOCITIES)) / (2 * h)
    np.testing.assert_allclose((terms.jacobian @ VELOCITIES[..., None])[..., 0], rates, atol=1e-9)
    before, after = np.maximum(EQUATION_TIMES - h, 0.0), np.minimum(EQUATION_TIMES + h, 1.0)
    travel = (PATH.at(after)[0] - PATH.at(before)[0]) / (after - before)[:, None]
    np.testing.assert_allclose(terms.velocity, travel, atol=1e-4)
    second = (tool(POSTURES + h * VELOCITIES) - 2 * tool(POSTURES) + tool(POSTURES - h * VELOCITIES)) / h**2
    np.testing.assert_allclose(equation.targets[2](EQUATION_TIMES) - terms.acceleration, second, atol=1e-4)


def test_accelerations_follow_the_path_and_no_torque_drives_the_self_motion(equation):
    terms = equation.terms(EQUATION_TIMES, POSTURES, VELOCITIES)
    ddq = equation(EQUATION_TIMES, np.concatenate([POSTURES, VELOCITIES], axis=1))[:, 3:]
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
