"""Finite differences and quadrature: the papers' scheme, closed forms, and their order of convergence."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik import Motion
from paretoik.robot.arms import tringali_3r

ARM = tringali_3r()
RATES = ("dq", "ddq", "jerk")
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
    motion = Motion(arm=ARM, time=t, q=q)
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
    motion = Motion(arm=ARM, time=t, q=q, cyclic=True)
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
        ("dq", 1, "backward", even, slice(1, None), 1),
        ("dq", 1, "backward", uneven, slice(1, None), 1),
        ("ddq", 2, "backward", even, slice(2, None), 1),
        ("dq", 1, "central", even, slice(None), 2),
        ("dq", 1, "central", uneven, slice(None), 2),
        ("ddq", 2, "central", even, slice(1, -1), 2),
        ("ddq", 2, "central", uneven, slice(1, -1), 2),
        ("ddq", 2, "central", even, slice(None), 1),
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


@both
def test_weights_add_up_to_the_duration(differences):
    t = uneven(20)
    motion = Motion(arm=ARM, time=t, q=wave(t), differences=differences)
    assert motion.weights.sum() == pytest.approx(1.0, rel=1e-14)
    assert motion.weights.shape == (20,)


@settings(max_examples=40)
@given(scale=st.floats(0.1, 10), shift=st.floats(-3, 3))
def test_stretching_time_scales_every_rate(scale, shift):
    t = uneven(15)
    slow = Motion(arm=ARM, time=scale * t + shift, q=wave(t), differences="central")
    fast = Motion(arm=ARM, time=t, q=wave(t), differences="central")
    np.testing.assert_allclose(slow.dq * scale, fast.dq, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(slow.ddq * scale**2, fast.ddq, rtol=1e-7, atol=1e-8)
