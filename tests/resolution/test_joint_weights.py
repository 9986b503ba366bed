"""Weights of joints in their buffers, and of criteria."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paretoik.resolution.kernels import buffer_depth, clamping_weight, criterion_weight

WIDTH = 0.5


NEAR = 1e-7


@pytest.mark.parametrize("threshold", [-1.0, 1.0, -0.5, 0.5])
def test_weights_are_continuous_across_thresholds(threshold):
    before, after = (clamping_weight(buffer_depth(threshold + side, -1.0, 1.0, WIDTH)) for side in (-NEAR, NEAR))
    assert before == pytest.approx(after, abs=1e-5)


@given(place=st.floats(-3.0, 3.0))
def test_weights_fall_from_one_outside_the_buffer_to_nothing_at_the_limit(place):
    depth = buffer_depth(place, -1.0, 1.0, WIDTH)
    assert -1.0 <= depth <= 1.0
    assert depth == pytest.approx(np.sign(place) * np.clip((abs(place) - 0.5) / 0.5, 0.0, 1.0), abs=1e-12)
    assert (clamping_weight(depth) == 1.0) == (abs(depth) < 1e-3) or 0 < abs(depth) < 0.1  # tanh reaches 1 before
    assert (clamping_weight(depth) == 0.0) == (abs(depth) == 1.0) or 0.9 < abs(depth) < 1.0


def test_half_way_into_the_buffer_the_weight_is_a_half():
    assert clamping_weight(0.5) == clamping_weight(-0.5) == 0.5
    assert buffer_depth(0.3, -np.inf, np.inf, np.inf) == 0.0
    assert buffer_depth(1.0, -1.0, 1.0, 0.0) == 1.0
    assert buffer_depth(0.999, -1.0, 1.0, 0.0) == 0.0


@given(value=st.floats(0.0, 10.0), band=st.floats(0.0, 0.45))
def test_coefficients_are_the_papers_cubic(value, band):
    low, high = band, 1 - band
    denominator = low**3 - 3 * low**2 * high + 3 * low * high**2 - high**3
    a, b = -2 / denominator, (3 * low + 3 * high) / denominator
    c, d = -6 * low * high / denominator, (3 * low * high**2 - high**3) / denominator
    for normalised, sign, exponent in ((np.exp(-value), 1.0, -value), (1 - np.exp(-value), -1.0, value)):
        inside = a * normalised**3 + b * normalised**2 + c * normalised + d
        weight = 1.0 if normalised <= low else 0.0 if normalised >= high else inside
        assert criterion_weight(exponent, sign, band) == pytest.approx(weight, abs=1e-9)


def test_worse_than_tolerable_counts_fully():
    assert criterion_weight(-1.0, -1.0, 0.3) == 1.0
    assert criterion_weight(5.0, 1.0, 0.3) == 0.0
