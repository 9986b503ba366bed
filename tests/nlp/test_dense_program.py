"""Small dense programs: derivatives of their rows."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.nlp.dense.traced_rows import trace_rows


def test_derivatives_are_those_of_the_rows():
    def rows(z, parameters):
        return [np.sin(z[0]) * z[1] - parameters[0]], [np.exp(z[1]) / z[0], z[0] ** 3 - z[1]]

    program, z, weights = trace_rows(2, 1, rows).at([0.0]), np.array([0.7, -0.4]), np.array([1.3, -0.2, 0.8])
    step = 1e-6 * np.eye(2)
    slopes = (
        np.array([np.concatenate(program.rows(z + d)) - np.concatenate(program.rows(z - d)) for d in step]).T / 2e-6
    )
    assert program.jacobian(z) == pytest.approx(slopes, rel=1e-8)
    bends = np.array([weights @ (program.jacobian(z + d) - program.jacobian(z - d)) for d in step]) / 2e-6
    assert program.hessian(z, weights) == pytest.approx(bends, rel=1e-7)
