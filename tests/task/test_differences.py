"""Finite differences and quadrature: the papers' scheme, closed forms, and their order of convergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

import paretoik as pk
from paretoik import Motion
from paretoik.robot.arms import tringali_3r
from paretoik.task.differences import fit_spline
from paretoik.task.motion_task import finer_motion
from tests.task.tasks import task

ARM = tringali_3r()
both = pytest.mark.parametrize("differences", ["backward", "central"])


def uneven(samples, seed=0):
    """Return times from 0 to 1 whose steps vary smoothly by a factor of about three."""
    t = np.linspace(0, 1, samples)
    return t + 0.08 * np.sin(2 * np.pi * t)


def wave(t, order=0):
    """Return the derivative of this order of the motion sin(w t + p), with a w and p for every joint."""
    w, p = np.array([2.0, 3.0, 5.0]), np.array([0.1, 1.0, -0.5])
    return w**order * np.sin(np.multiply.outer(t, w) + p + order * np.pi / 2)


def round_wave(t, order=0):
    w, p = 2 * np.pi * np.array([1.0, 2.0, 3.0]), np.array([0.1, 1.0, -0.5])
    return w**order * np.sin(np.multiply.outer(t, w) + p + order * np.pi / 2)


def order_of(errors, factor=2):
    return np.log(errors[0] / errors[1]) / np.log(factor)


def error_at(samples, quantity, order, where=slice(None), grid=uneven, shape=wave, **settings):
    t = grid(samples)
    motion = Motion(arm=ARM, time=t, q=shape(t), **settings)
    return np.abs(getattr(motion, quantity)[where] - shape(t, order)[where]).max()


def even(samples):
    return np.linspace(0, 1, samples)


def test_backward_differences_are_the_papers_scheme():
    t = np.array([0.0, 0.1, 0.3, 0.4, 0.8])
    q = np.random.default_rng(0).normal(size=(5, 3))
    motion = Motion(arm=ARM, time=t, q=q, differences="backward")
    v, a = np.zeros((5, 3)), np.zeros((5, 3))
    for i in range(1, 5):
        v[i] = (q[i] - q[i - 1]) / (t[i] - t[i - 1])
        a[i] = (v[i] - v[i - 1]) / (t[i] - t[i - 1])
    np.testing.assert_array_equal(motion.dq, v)
    np.testing.assert_array_equal(motion.ddq, a)
    assert (motion.dq[0] == 0).all()
    assert (motion.ddq[0] == 0).all()
    values = np.arange(5.0) ** 2
    assert motion.integral(values) == pytest.approx(1 * 0.1 + 4 * 0.2 + 9 * 0.1 + 16 * 0.4, rel=1e-15)


def test_backward_differences_of_a_cycle_go_round_the_seam():
    t = np.array([0.0, 0.1, 0.3, 0.4, 0.8])
    q = np.random.default_rng(0).normal(size=(5, 3))
    q[-1] = q[0]
    motion = Motion(arm=ARM, time=t, q=q, cyclic=True, differences="backward")
    step = np.diff(t)[:, None]
    v = np.diff(q, axis=0) / step
    np.testing.assert_array_equal(motion.dq, np.concatenate([v[-1:], v]))
    a = np.diff(motion.dq, axis=0) / step
    np.testing.assert_array_equal(motion.ddq, np.concatenate([a[-1:], a]))


def test_central_differences_are_exact_for_parabolas_even_on_uneven_times():
    t, c = uneven(12), np.random.default_rng(1).normal(size=(3, 3))
    motion = Motion(
        arm=ARM, time=t, q=c[0] + np.multiply.outer(t, c[1]) + np.multiply.outer(t**2, c[2]), differences="central"
    )
    np.testing.assert_allclose(motion.dq, c[1] + 2 * np.multiply.outer(t, c[2]), atol=1e-12)
    np.testing.assert_allclose(motion.ddq, np.broadcast_to(2 * c[2], (12, 3)), atol=1e-10)
    np.testing.assert_allclose(motion.jerk, 0.0, atol=1e-8)


@pytest.mark.parametrize(
    ("quantity", "derivative", "differences", "grid", "where", "expected"),
    [
        ("dq", 1, "backward", uneven, slice(1, None), 1),
        ("ddq", 2, "backward", even, slice(2, None), 1),
        ("dq", 1, "central", uneven, slice(None), 2),
        ("ddq", 2, "central", uneven, slice(1, -1), 2),
        ("jerk", 3, "central", even, slice(2, -2), 2),
    ],
)
def test_differences_converge_at_their_order(quantity, derivative, differences, grid, where, expected):
    errors = [error_at(n, quantity, derivative, where, grid, differences=differences) for n in (201, 401)]
    assert order_of(errors) == pytest.approx(expected, abs=0.15)


@pytest.mark.parametrize(("quantity", "derivative"), [("dq", 1), ("ddq", 2), ("jerk", 3)])
@pytest.mark.parametrize(("differences", "expected"), [("backward", 1), ("central", 2)])
def test_differences_of_a_cycle_converge_at_their_order_at_every_sample(quantity, derivative, differences, expected):
    errors = [
        error_at(n, quantity, derivative, grid=even, shape=round_wave, differences=differences, cyclic=True)
        for n in (401, 801)
    ]
    assert order_of(errors) == pytest.approx(expected, abs=0.15)


@both
def test_a_cycle_ends_with_the_velocity_and_acceleration_it_starts_with(differences):
    t = uneven(30)
    q = np.random.default_rng(3).normal(size=(4, 30, 3))
    q[:, -1] = q[:, 0]
    motion = Motion(arm=ARM, time=t, q=q, cyclic=True, differences=differences)
    for values in (motion.q, motion.dq, motion.ddq, motion.jerk):
        np.testing.assert_array_equal(values[:, 0], values[:, -1])


@pytest.mark.parametrize(("differences", "expected"), [("backward", 1), ("central", 2)])
def test_integrals_converge_at_their_order(differences, expected):
    errors = []
    for samples in (101, 201):
        t = uneven(samples)
        motion = Motion(arm=ARM, time=t, q=wave(t), differences=differences)
        errors.append(abs(motion.integral(np.exp(t)) - (np.e - 1)))
    assert order_of(errors) == pytest.approx(expected, abs=0.1)


# The spline near samples, compared with SciPy's, parabolas and at(t)


ENDS = {"free": (False, False), "at rest": (False, True), "cyclic": (True, False)}
ends = pytest.mark.parametrize(("cyclic", "at_rest"), ENDS.values(), ids=ENDS)


def uneven_times(samples, rng):
    """Return times that increase unevenly from 0."""
    time = np.linspace(0, 1, samples) + 0.3 / samples * rng.uniform(-1, 1, samples)
    return time - time[0]


def fitted(samples, cyclic, at_rest, seed=0):
    """Return a spline of random samples at uneven times, and the samples."""
    rng = np.random.default_rng(seed)
    time, q = uneven_times(samples, rng), rng.normal(size=(samples, 2))
    if cyclic:
        q[-1] = q[0]
    return fit_spline(q, time, cyclic=cyclic, ends_at_rest=at_rest), q


@ends
@given(samples=st.integers(3, 12), seed=st.integers(0, 99))
def test_a_fitted_spline_is_cubic_with_knots_at_the_samples(cyclic, at_rest, samples, seed):
    spline, q = fitted(samples, cyclic, at_rest, seed)
    t = np.linspace(0, spline.time[-1], 301)
    pieces = [BSpline(*one, 3) for one in _interpolated(spline)]
    for order, values in enumerate(spline.at(t)[:3]):
        theirs = np.stack([piece(t, nu=order) for piece in pieces], axis=1)
        np.testing.assert_allclose(values, theirs, atol=1e-8 * max(1.0, np.abs(theirs).max()))
    if not cyclic:
        np.testing.assert_allclose(spline.position[[0, -1]], q[[0, -1]], atol=1e-10)
    if at_rest:
        np.testing.assert_allclose(spline.velocity[-1], 0.0, atol=1e-10)


def _interpolated(spline):
    """Return scipy's clamped splines through the knots, from their end velocities."""
    from scipy.interpolate import make_interp_spline

    for column in range(spline.position.shape[1]):
        ends = [[(1, spline.velocity[k, column])] for k in (0, -1)]
        yield make_interp_spline(spline.time, spline.position[:, column], bc_type=tuple(ends)).tck[:2]


@ends
def test_velocity_and_acceleration_lie_between_what_is_limited(cyclic, at_rest):
    spline, _ = fitted(9, cyclic, at_rest)
    t = np.linspace(0, spline.time[-1], 999)
    _, velocity, acceleration, _ = spline.at(t)
    hull = np.concatenate([spline.velocity, spline.inner_velocity])
    assert np.all(velocity <= hull.max(axis=0) + 1e-12)
    assert np.all(velocity >= hull.min(axis=0) - 1e-12)
    assert np.abs(acceleration).max() <= np.abs(spline.acceleration).max() + 1e-9


def spline_motion(samples=31):
    """Return a motion on a path whose curve is a spline."""
    made = task(path=pk.line([0.45, 0.1], [0.35, 0.2], duration=1.0, samples=samples), differences="spline")
    problem = pk.Tracking(
        made.arm, made.tasks, objectives=made.objectives, differences="spline", bases=1, coefficients=4
    )
    return problem.decode(problem.sample_starts(1, np.random.default_rng(0)))


def test_integrals_are_simpsons_with_the_middles_between_samples():
    motion = spline_motion()
    dense = motion.instants
    assert dense.q.shape[1] == 61
    assert dense.instants is dense
    np.testing.assert_allclose(dense.weights.sum(axis=-1), 1.0)
    fine = finer_motion(replace(motion, tasks=()), 40)
    exact = np.trapezoid(fine.kinetic_energy, fine.time, axis=-1)
    np.testing.assert_allclose(pk.kinetic_energy(motion), exact, rtol=2e-3)
    np.testing.assert_allclose(dense.q[:, ::2], motion.at(motion.time[0]), atol=1e-12)


def test_rates_on_a_finer_grid_are_those_of_the_projected_curve_at_knots_and_ends_too():
    motion, step = spline_motion()[0], 1e-4
    finer = finer_motion(motion)
    for t, sign in ((0.0, 1), (motion.time[7], 1), (motion.time[7], -1), (motion.time[-1], -1)):
        f = motion.at(np.sort(t + sign * step * np.arange(5)))[::sign]  # differences that lie within one interval
        velocity = sign * (-25 * f[0] + 48 * f[1] - 36 * f[2] + 16 * f[3] - 3 * f[4]) / (12 * step)
        acceleration = (35 * f[0] - 104 * f[1] + 114 * f[2] - 56 * f[3] + 11 * f[4]) / (12 * step**2)
        k = int(np.argmin(np.abs(finer.time - t)))
        np.testing.assert_allclose(finer.dq[k], velocity, atol=1e-6)
        np.testing.assert_allclose(finer.ddq[k], acceleration, atol=1e-3)
