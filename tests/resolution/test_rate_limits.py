"""Laws of rates that leave room to brake: whoever keeps to them keeps every limit, and can go on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.resolution.constrained import RateLimits, highest_rate, intersection

STEPS = 25


def random_limits(rng, *, braking=True):
    spans, accelerations = rng.uniform(0.1, 2.0, (3, 2)), rng.uniform(0.5, 20.0, (3, 2))
    if not braking:
        accelerations[0] = np.inf
    sides, shape = np.array([-1.0, 1.0]), (STEPS, 3, 2)
    return RateLimits(
        position=np.broadcast_to(spans * sides, shape),
        velocity=rng.uniform(0.5, 3.0, (STEPS, 1, 1)) * sides * np.ones(shape),
        acceleration=np.broadcast_to(accelerations * sides, shape),
        steps=rng.uniform(0.01, 0.1, STEPS),
    )


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), braking=st.booleans(), share=st.sampled_from([0.0, 1.0, None]))
def test_any_rates_within_bounds_keep_every_limit_and_leave_others(seed, braking, share):
    rng = np.random.default_rng(seed)
    limits = random_limits(rng, braking=braking)
    q, rates = np.zeros(3), np.zeros(3)
    for k, dt in enumerate(limits.steps):
        bounds = limits.bounds(k, q, rates)
        lower, upper = bounds[..., 0].max(axis=0), bounds[..., 1].min(axis=0)
        assert (lower <= upper + 1e-9).all()
        np.testing.assert_allclose(intersection(bounds), np.stack([lower, upper], axis=-1), atol=1e-9)
        before, rates = rates, lower + (rng.uniform(size=3) if share is None else share) * (upper - lower)
        q = q + dt * rates
        for values, allowed in (
            (q, limits.position[k]),
            (rates, limits.velocity[k]),
            ((rates - before) / dt, limits.acceleration[k]),
        ):
            assert (values >= allowed[:, 0] - 1e-9).all()
            assert (values <= allowed[:, 1] + 1e-9).all()


@pytest.mark.parametrize("slack", [1e-3, 0.1, 2.0])
def test_the_highest_rate_brakes_just_before_the_limit(slack):
    steps, braking = np.linspace(0.01, 0.05, 200), np.full((200, 1), 3.0)
    braking[0] = 0.0
    rate = highest_rate(np.array([[slack]]), braking, steps)[0]
    rates = np.maximum(rate - np.cumsum(braking[:, 0] * steps), 0.0)
    assert np.sum(rates * steps) == pytest.approx(slack, rel=1e-12)


def test_what_contradicts_keeps_the_first_kinds():
    bounds = np.array([[[-1.0, 1.0]], [[2.0, 3.0]], [[-5.0, -4.0]]])
    assert intersection(bounds).tolist() == [[1.0, 1.0]]


def test_a_distance_may_shrink_as_fast_as_joints_can_brake_it():
    limits = random_limits(np.random.default_rng(3), braking=True)
    gradient = np.array([0.5, -1.0, 0.0])
    braking = 0.5 * limits.acceleration[0, 0, 1] - 1.0 * limits.acceleration[0, 1, 0]
    column = np.concatenate([[[0.0]], np.full((STEPS - 1, 1), braking)])
    expected = highest_rate(np.array([[0.2]]), column, limits.steps)
    np.testing.assert_allclose(limits.approach(0, np.array([0.2]), gradient[None]), expected, rtol=1e-12)
    free = random_limits(np.random.default_rng(3), braking=False)
    assert free.approach(0, np.array([0.2]), gradient[None]) == pytest.approx(0.2 / free.steps[0])
