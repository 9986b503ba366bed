"""Quartic splines: through all points, with given rates at the start and rest at the end."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from paretoik.resolution.horizon import quartic_spline


@given(pieces=st.integers(1, 6), seed=st.integers(0, 1000))
def test_the_spline_goes_through_all_points_and_keeps_rates(pieces, seed):
    rng = np.random.default_rng(seed)
    points, rate, second = rng.normal(size=(pieces + 1, 2)), rng.normal(size=2), rng.normal(size=2)
    coefficients = quartic_spline(points, rate, second)

    def at(piece, u, order):
        part = np.polynomial.Polynomial
        return np.array(
            [
                part(coefficients[piece, :, j]).deriv(order)(u) if order else part(coefficients[piece, :, j])(u)
                for j in (0, 1)
            ]
        )

    for piece in range(pieces):
        np.testing.assert_allclose(at(piece, 0, 0), points[piece], atol=1e-8)
        np.testing.assert_allclose(at(piece, 1, 0), points[piece + 1], atol=1e-8)
        for order in (1, 2) if piece else ():
            np.testing.assert_allclose(at(piece - 1, 1, order), at(piece, 0, order), atol=1e-7)
    np.testing.assert_allclose([at(0, 0, 1), at(0, 0, 2)], [rate, second], atol=1e-8)
    for order in (1, 2) if pieces > 1 else (1,):
        np.testing.assert_allclose(at(pieces - 1, 1, order), 0.0, atol=1e-7)
