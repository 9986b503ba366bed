"""The laws of time: from rest to rest, symmetric, and with the peaks that the papers state."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.errors import InvalidInput
from paretoik.task.curves import TIME_LAWS, progress, progress_rates

laws = st.sampled_from(TIME_LAWS)
durations = st.floats(0.01, 100.0)
shares = st.floats(0.0, 1.0)


@pytest.mark.parametrize("law", TIME_LAWS)
def test_progress_runs_from_exactly_zero_to_exactly_one(law):
    assert progress(np.array([0.0, 0.7]), 0.7, law).tolist() == [0.0, 1.0]


@given(laws, durations, st.lists(shares, min_size=2, max_size=20))
def test_progress_never_goes_back_nor_leaves_zero_to_one(law, duration, taus):
    covered = progress(np.sort(taus) * duration, duration, law)
    assert (np.diff(covered) >= -1e-15).all()
    assert covered.min() >= -1e-15
    assert covered.max() <= 1 + 1e-15


@given(laws, durations, shares)
def test_the_second_half_mirrors_the_first(law, duration, tau):
    t = np.array([tau * duration])
    assert progress(duration - t, duration, law) == pytest.approx(1 - progress(t, duration, law), abs=1e-12)


def test_raised_cosine_is_equation_19_with_its_lost_half():
    duration = 1.3
    tau, omega = duration / 2, 4 * np.pi / duration
    t = np.linspace(0, tau, 50)
    printed = (t**2 / 2 + (np.cos(omega * t) - 1) / omega**2) / tau**2
    np.testing.assert_allclose(progress(t, duration, "raised-cosine"), printed, atol=1e-15)


def test_raised_cosine_has_the_stated_peaks_and_rests_at_both_ends_and_the_middle():
    t = np.linspace(0, 2.0, 4001)
    rates = np.gradient(progress(t, 2.0, "raised-cosine"), t, edge_order=2)
    accelerations = np.gradient(rates, t, edge_order=2)
    assert rates.max() == pytest.approx(2 / 2.0, rel=1e-5)
    assert np.abs(accelerations).max() == pytest.approx(8 / 2.0**2, rel=1e-5)
    np.testing.assert_allclose(rates[[0, -1]], 0, atol=1e-5)
    np.testing.assert_allclose(accelerations[[0, 2000, -1]], 0, atol=1e-4)


def test_quintic_is_the_polynomial_of_least_jerk():
    tau = np.linspace(0, 1, 101)
    np.testing.assert_allclose(progress(3 * tau, 3.0, "quintic"), 10 * tau**3 - 15 * tau**4 + 6 * tau**5, atol=1e-14)
    change = np.diff(progress(np.array([1.5 - 1e-4, 1.5 + 1e-4]), 3.0, "quintic"))
    assert change / 2e-4 == pytest.approx(15 / 8 / 3)


def test_an_unknown_law_is_refused_with_the_names_of_the_known():
    with pytest.raises(InvalidInput, match=r"raised-cosine, quintic, uniform, got 'cubic'"):
        progress(np.array([0.1]), 1.0, "cubic")


@given(laws, durations, st.floats(0.001, 0.999))
def test_its_rates_are_its_derivatives(law, duration, share):
    step = 1e-3 * min(share, 1 - share)
    around = progress((share + step * np.arange(-1, 2)) * duration, duration, law)
    speed, acceleration = progress_rates(np.array(share * duration), duration, law)
    assert speed * duration == pytest.approx((around[2] - around[0]) / (2 * step), abs=1e-4)
    if abs(share - 0.5) > step:  # the third derivative of a raised cosine turns its sign there
        assert acceleration * duration**2 == pytest.approx(
            progress_rates(np.array((share + step) * duration), duration, law)[0] * duration / (2 * step)
            - progress_rates(np.array((share - step) * duration), duration, law)[0] * duration / (2 * step),
            abs=1e-3,
        )
