"""Small dense programs: derivatives of their rows, and a known minimum."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.nlp.dense.dense_program import DenseProgram
from paretoik.nlp.dense.traced_rows import trace_rows
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import CONVERGED, InteriorPointOptions

OPTIONS = InteriorPointOptions(radius=0.1, iterations=200, tolerance=1e-9)


def minimise_by_sqp(program, cost, start):
    dense = DenseProgram(rows=program, costs=cost[None])
    return minimise(dense, start[None], np.ones((1, 1)), options=OPTIONS, solver="sqp")


def sphere(z, parameters):
    return [z[0] * z[0] + z[1] * z[1] + z[2] * z[2] - parameters[0]], [z[2] - 0.1]


def test_sphere_above_a_plane_has_its_known_lowest_point():
    program = trace_rows(3, 1, sphere).at([1.0])
    solution = minimise_by_sqp(program, np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.6, 0.8]))
    assert solution.status == [CONVERGED]
    assert solution.x[0] == pytest.approx([-np.sqrt(0.99), 0.0, 0.1], abs=1e-7)


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
