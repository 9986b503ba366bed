"""Laws of prediction: minima ahead, splines through them, and better motions."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

import paretoik as pk
from paretoik import line
from paretoik.errors import Infeasible, InvalidInput
from paretoik.resolution.predictive import follow_predictively, horizon_program, quartic_spline, schedules
from paretoik.robot import dynamics, kinematics
from paretoik.robot.arms import tringali_3r
from paretoik.task.retraction import task_errors
from paretoik.task.validation import motion_task
from tests.formulations.problems import panda
from tests.resolution.test_resolve import begun

START = np.array([0.0, 0.327, -0.754])
HOME = np.array([0.1, -0.6, 0.2, -2.2, 0.1, 1.7, 0.5])
FIRST = kinematics.forward_kinematics(tringali_3r(), START)[1][:2]
ALONG = np.array([-0.924, 0.382])


def straight(length, samples=201):
    return line(FIRST, FIRST + length * ALONG, duration=10.0, samples=samples)


def task_of(arm, path, objective):
    return motion_task(arm, path, objectives=[objective], differences="backward")


def plainly(arm, objective, q, posture, velocity, interval):
    """Return an objective over the samples ahead, from q alone."""
    q = np.vstack([posture, q])
    dq = np.diff(q, axis=0) / interval
    ddq = np.diff(np.vstack([velocity, dq]), axis=0) / interval
    if objective is pk.kinetic_energy:
        return interval * dynamics.kinetic_energy(arm, q[1:], dq).sum()
    return interval * (dynamics.inverse_dynamics(arm, q[1:], dq, ddq) ** 2).sum()


@pytest.mark.parametrize(
    ("name", "ahead", "objective"),
    [
        ("planar", 1, pk.torque_norm),
        ("planar", 4, pk.kinetic_energy),
        ("spatial", 2, pk.kinetic_energy),
        pytest.param("spatial", 4, pk.torque_norm, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_what_is_found_ahead_is_what_another_solver_finds(name, ahead, objective):
    arm, start = (tringali_3r(), START) if name == "planar" else (panda(), HOME)
    path = begun(arm, start)
    task, rng = task_of(arm, path, objective), np.random.default_rng(0)
    velocity, targets = rng.normal(scale=0.05, size=arm.dof), task.targets[8 : 8 * ahead + 1 : 8]
    solution = horizon_program(task, objective, ahead, 0.4).solve(np.tile(start, (ahead, 1)), start, velocity, targets)
    assert solution.converged
    energy = plainly(arm, objective, solution.q, start, velocity, 0.4)
    assert solution.value == pytest.approx(energy, rel=1e-10)
    left = task_errors(arm, task.tasks, solution.q, targets)[0]
    assert np.abs(left).max() < 1e-9

    def gaps(z):
        return task_errors(arm, task.tasks, z.reshape(solution.q.shape), targets)[0].T.ravel()

    other = minimize(
        lambda z: plainly(arm, objective, z.reshape(solution.q.shape), start, velocity, 0.4) / energy,
        solution.q.ravel() + rng.normal(scale=1e-3, size=solution.q.size),
        method="SLSQP",
        constraints={"type": "eq", "fun": gaps},
        options={"ftol": 1e-13, "maxiter": 300},
    )
    assert np.abs(gaps(other.x)).max() < 1e-6
    assert other.fun == pytest.approx(1.0, rel=1e-5)


def test_the_last_sample_may_count_more():
    task = task_of(tringali_3r(), straight(0.3), pk.kinetic_energy)
    targets, guess = task.targets[[20, 40]], np.tile(START, (2, 1))
    plain, more = (
        horizon_program(task, pk.kinetic_energy, 2, 1.0, terminal).solve(guess, START, np.zeros(3), targets)
        for terminal in (0.0, 5.0)
    )
    energies = [
        [plainly(tringali_3r(), pk.kinetic_energy, one.q[: k + 1], START, np.zeros(3), 1.0) for k in (0, 1)]
        for one in (plain, more)
    ]
    assert more.value == pytest.approx(energies[1][1] + 5 * (energies[1][1] - energies[1][0]), rel=1e-10)
    assert energies[1][1] - energies[1][0] < energies[0][1] - energies[0][0]
    motion = pk.resolve(
        tringali_3r(), straight(0.1), pk.methods.PredictiveKineticEnergy(terminal=np.array([0.0, 2.0])), start=START
    )
    assert np.abs(motion.q[0] - motion.q[1]).max() > 1e-4


def test_looking_ahead_costs_less_than_the_least_velocities_and_more_than_the_optimum():
    path = straight(0.1)
    problem = pk.Tracking(tringali_3r(), path, objectives=[pk.kinetic_energy], start=START, differences="backward")
    optimum = pk.plan(problem, starts=2).best.objective
    ahead, local = (
        pk.resolve(tringali_3r(), path, m, start=START)
        for m in (pk.methods.PredictiveKineticEnergy(), pk.methods.LeastSquaresVelocity())
    )
    assert optimum < pk.kinetic_energy(ahead) < 1.02 * optimum
    assert pk.kinetic_energy(local) > 1.3 * optimum


def test_prediction_passes_where_the_least_velocities_meet_a_singularity():
    path = straight(0.4)
    ahead, local = (
        pk.resolve(tringali_3r(), path, method, start=START, unreachable="track")
        for method in (pk.methods.PredictiveKineticEnergy(), pk.methods.LeastSquaresVelocity())
    )
    assert ahead.manipulability.min() > 3 * local.manipulability.min()
    assert np.abs(ahead.dq).max() < 1.0 < np.abs(local.dq).max()
    assert pk.kinetic_energy(local) > 2 * pk.kinetic_energy(ahead)


def test_every_spline_begins_as_the_arm_moves_there():
    # Tringali & Cocuzza 2021, step 6: velocities and accelerations at its start are those reached by the arm.
    begins = []

    def make_spline(points, rate, second):
        begins.append((points[0], rate, second))
        return quartic_spline(points, rate, second)

    path, method = straight(0.1, 501), pk.methods.PredictiveKineticEnergy()
    task = task_of(tringali_3r(), path, pk.kinetic_energy)
    motion = follow_predictively(task, method, START, tolerance=0.01, make_spline=make_spline)
    updates, step = motion.traces.updates, path.times[1]
    np.testing.assert_array_equal(updates, np.arange(0, 401, 25))  # as the paper has it
    _, slopes = task_errors(task.arm, task.tasks, motion.q[:-1], task.targets[:-1])
    assert np.abs(slopes @ motion.traces.projected[:, 0, :, None]).max() < 1e-14  # these leave the task alone
    unit = schedules(method, path.times, ())[0].stride * step  # s, from one prediction to the next
    assert len(begins) == len(updates)
    for k, (posture, rate, second) in zip(updates.tolist(), begins, strict=True):
        before = motion.traces.velocities[max(k - 2, 0) : k]
        expected = before[-1] if k else np.zeros(3)
        acceleration = (before[-1] - before[-2]) / step if k > 1 else np.zeros(3)
        np.testing.assert_allclose(posture, motion.q[k], atol=1e-12)
        np.testing.assert_allclose(rate, unit * expected, atol=1e-9)
        np.testing.assert_allclose(second, unit**2 * acceleration, atol=1e-6)
    assert np.abs([rate for _, rate, _ in begins]).max() > 0.1


def test_other_objectives_are_made_less_than_by_looking_at_kinetic_energy():
    path = straight(0.3)
    energy, torque = (
        pk.resolve(tringali_3r(), path, pk.methods.PredictiveKineticEnergy(objective=one, horizon=4), start=START)
        for one in (pk.kinetic_energy, pk.torque_norm)
    )
    assert pk.torque_norm(torque) < pk.torque_norm(energy)
    assert pk.kinetic_energy(energy) < pk.kinetic_energy(torque)


def test_a_spatial_arm_looks_ahead():
    motion = pk.resolve(panda(), begun(panda(), HOME), pk.methods.PredictiveKineticEnergy(feedback=10.0), start=HOME)
    assert motion.tracking_error.max() < 2e-3
    assert motion.traces.status.tolist() == ["done"] * 40


def test_nedungadis_motion_is_the_variational_one():
    path = straight(0.1, 101)
    motion = pk.resolve(tringali_3r(), path, pk.methods.Nedungadi(tolerance=1e-6), start=np.stack([START, START]))
    assert motion.q.shape == (2, 101, 3)
    assert motion.tracking_error.max() < 1e-9
    least_squares = pk.resolve(tringali_3r(), path, pk.methods.LeastSquaresVelocity(), start=START)
    assert pk.kinetic_energy(motion[0]) < pk.kinetic_energy(least_squares)
    assert np.abs(motion.dq[0, 1:] - motion.traces.velocities[0]).max() < 0.02
    with pytest.raises(Infeasible, match="no velocities satisfy the task"):
        pk.resolve(
            tringali_3r(),
            line(FIRST, [0.4895, 0.0], duration=1.0, samples=11),
            pk.methods.Nedungadi(tolerance=1e-4),
            start=START,
        )


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"horizon": 0}, "PredictiveKineticEnergy: horizon must be 1 sample or more, got 0"),
        ({"prediction_step": 0.033}, "prediction_step must be whole samples of 0.05 s, got 0.033 s"),
        ({"prediction_step": 8.0}, "horizon must be within the path's 10 s, got 2 times 8 s"),
        ({"objective": pk.peak_velocity}, "objective peak_velocity: form must be 'integral', got 'peak'"),
    ],
)
def test_what_cannot_be_used_is_refused_by_name(settings, said):
    with pytest.raises(InvalidInput, match=re.escape(said)):
        pk.resolve(tringali_3r(), straight(0.1), pk.methods.PredictiveKineticEnergy(**settings), start=START)


@given(pieces=st.integers(1, 6), seed=st.integers(0, 1000))
def test_the_spline_goes_through_all_points_and_keeps_rates(pieces, seed):
    rng = np.random.default_rng(seed)
    points, rate, second = rng.normal(size=(pieces + 1, 2)), rng.normal(size=2), rng.normal(size=2)
    coefficients = quartic_spline(points, rate, second)

    def at(piece, u, order):
        return np.array([np.polynomial.Polynomial(column).deriv(order)(u) for column in coefficients[piece].T])

    for piece in range(pieces):
        np.testing.assert_allclose(at(piece, 0, 0), points[piece], atol=1e-8)
        np.testing.assert_allclose(at(piece, 1, 0), points[piece + 1], atol=1e-8)
        for order in (1, 2) if piece else ():
            np.testing.assert_allclose(at(piece - 1, 1, order), at(piece, 0, order), atol=1e-7)
    np.testing.assert_allclose([at(0, 0, 1), at(0, 0, 2)], [rate, second], atol=1e-8)
    for order in (1, 2) if pieces > 1 else (1,):
        np.testing.assert_allclose(at(pieces - 1, 1, order), 0.0, atol=1e-7)
