"""Elastic inequalities: slacks, multipliers and steps satisfy the conditions that define them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.nlp.banded import elastic

exponents = st.floats(-12, 0)


def interior(seed, count=6, penalty=10.0):
    """Return random c, s, t, z and a step dc, away from all bounds, and the residuals."""
    rng = np.random.default_rng(seed)
    s, t = rng.uniform(0.1, 2.0, (2, count))
    c, z, dc = rng.normal(size=count), rng.uniform(0.1, 0.9, count) * penalty, rng.normal(size=count)
    return c, s, t, c - s + t, z, dc


@given(st.floats(-100, 100), exponents, st.floats(-2, 6))
def test_the_best_slacks_leave_no_residual_and_share_the_penalty(c, mu_exponent, penalty_exponent):
    mu, penalty = 10.0**mu_exponent, 10.0**penalty_exponent
    s, t = elastic.slacks(c, mu, penalty)
    assert min(s, t) > 0
    assert s - t == pytest.approx(c, rel=1e-12, abs=1e-12 * max(s, t))
    assert mu / s + mu / t == pytest.approx(penalty, rel=1e-5)


@given(st.integers(0, 1000))
def test_newtons_step_solves_the_linearised_conditions(seed):
    mu, penalty = 0.01, 10.0
    c, s, t, r, z, dc = interior(seed, penalty=penalty)
    stiffness, force, ds, dt = np.empty((4, len(c)))
    elastic.barrier_terms(s, t, r, z, mu, penalty, stiffness, force)
    dz = force - z - stiffness * dc
    elastic.newton_slacks(s, t, r, z, dz, dc, mu, penalty, ds, dt)
    np.testing.assert_allclose(s * z + z * ds + s * dz, mu, atol=1e-10)
    w = penalty - z
    np.testing.assert_allclose(t * w + w * dt - t * dz, mu, atol=1e-10)
    np.testing.assert_allclose(dc - ds + dt, -r, atol=1e-10)


@given(st.integers(0, 1000))
def test_the_slope_is_that_of_the_merit_and_no_slack_steps_past_its_bound(seed):
    mu, penalty, h = 0.01, 10.0, 1e-6
    _, s, t, *_ = interior(seed)
    ds, dt = np.random.default_rng(seed + 1).normal(size=(2, len(s)))
    slope, length = elastic.limit_step(s, t, ds, dt, mu, penalty, 1.0, 0.995)
    values = [elastic.merit_terms(s + k * h * ds, t + k * h * dt, mu, penalty) for k in (-1, 1)]
    assert slope == pytest.approx((values[1] - values[0]) / (2 * h), rel=1e-6, abs=1e-6)
    assert 0 < length <= 1
    assert np.concatenate([(s + length * ds) / s, (t + length * dt) / t]).min() >= 0.005 * (1 - 1e-12)
