"""Time scalings: monotone, exact at both ends, as smooth as they say, and never faster than the motion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.errors import InvalidInput
from paretoik.joint_trajectory.trajectory import TimeScaling, time_scaling

durations = st.floats(0.3, 20.0)
rates = st.sampled_from([50.0, 125.0, 300.0, 1000.0])


@given(durations, rates, st.floats(1.0, 3.0), st.just(0.0) | st.floats(0.02, 0.3))
def test_it_leads_from_0_to_the_duration_without_turning_back(duration, rate, factor, ramp):
    scaling = time_scaling(duration, rate, time_scale=factor, ramp=ramp)
    sigma, speed, _ = scaling.evaluate()
    assert (sigma[0], sigma[-1]) == (0.0, duration)
    assert np.diff(sigma).min() >= 0
    assert factor <= scaling.factor * (1 + 1e-9) <= factor + 1 / (rate * duration) + 1e-8
    assert speed.min() >= 0
    assert speed.max() <= 1 / factor + 1e-12
    np.testing.assert_allclose(np.diff(scaling.times()), 1 / rate, atol=1e-9)


@given(durations, rates, rates, st.just(0.0) | st.floats(0.05, 0.3))
def test_at_another_rate_it_is_the_same_law_of_time(duration, rate, other, ramp):
    scaling = time_scaling(duration, rate, ramp=ramp)
    times, values = scaling.times(other), scaling.evaluate(other)
    dense = np.stack([np.interp(times, scaling.times(), own) for own in scaling.evaluate()])
    assert values.shape == (3, len(times))
    assert (values[0, 0], values[0, -1]) == (0.0, duration)
    assert -1e-6 <= times[-1] - scaling.times()[-1] < 1 / other
    np.testing.assert_allclose(values[0], dense[0], atol=2 / rate**2 * (1 + 2 / max(ramp, 0.05)))
    np.testing.assert_array_equal(scaling.evaluate(rate), scaling.evaluate())


@given(durations, st.floats(0.05, 1.0))
def test_its_rates_are_its_derivatives(duration, share):
    scaling = TimeScaling(duration=duration, periods=4000, rate=4000 / duration / 1.3, ramp=share * duration)
    sigma, speed, bend = scaling.evaluate()
    step = 1 / scaling.rate
    np.testing.assert_allclose(speed[1:-1], (sigma[2:] - sigma[:-2]) / (2 * step), atol=2e-5 / share**2)
    np.testing.assert_allclose(bend[1:-1], (speed[2:] - speed[:-2]) / (2 * step), atol=2e-4 / share**3 / duration)


@given(durations, st.floats(0.05, 0.3))
def test_a_ramp_starts_and_stops_with_neither_velocity_nor_acceleration_and_costs_its_own_time(duration, ramp):
    scaling = time_scaling(duration, 1000.0, ramp=ramp)
    _, speed, bend = scaling.evaluate()
    assert np.abs([speed[[0, -1]], bend[[0, -1]]]).max() == 0.0
    assert scaling.times()[-1] == pytest.approx(duration + ramp, abs=1.01e-3)
    assert speed[np.searchsorted(scaling.times(), ramp) + 1] == pytest.approx(1 / scaling.factor, abs=1e-6)


@pytest.mark.parametrize("rate", [50.0, 300.0, 1000.0, 7.0])
def test_times_are_whole_nanoseconds_that_ros_keeps_exactly(rate):
    times = time_scaling(3.0, rate).times()
    nanoseconds = np.rint(times * 1e9).astype(int)
    np.testing.assert_array_equal(nanoseconds / 1e9, times)
    np.testing.assert_allclose(nanoseconds, np.arange(len(times)) * 1e9 / rate, atol=0.5)


def test_a_duration_of_whole_periods_keeps_its_time():
    for duration, rate in ((1.5, 1000.0), (0.3, 10.0), (2.4, 500.0)):
        assert time_scaling(duration, rate).factor == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"time_scale": 0.5}, "time_scale: 1 or more, to slow down, wanted, got 0.5"),
        ({"time_scale": np.nan}, "time_scale: must be finite, got nan"),
        ({"ramp": -0.1}, "ramp: 0, or from one period to the motion's 1 s wanted, got -0.1 s"),
        ({"ramp": 1.1}, "ramp: 0, or from one period to the motion's 1 s wanted, got 1.1 s"),
        ({"rate": 2.0}, "from 3 to 1000000 periods wanted, got 2 Hz for 1 s"),
        ({"rate": 2e6, "duration": 0.1}, "rate and time_scale: at most 1e.06 Hz, .* wanted, got 2e.06 Hz for 0.1 s"),
        ({"rate": 1e5, "duration": 60.0}, "from 3 to 1000000 periods wanted, got 100000 Hz for 60 s"),
    ],
)
def test_what_is_no_scaling_is_refused(changed, message):
    with pytest.raises(InvalidInput, match=message):
        time_scaling(**{"duration": 1.0, "rate": 100.0, **changed})
