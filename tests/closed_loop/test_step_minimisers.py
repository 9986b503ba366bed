"""Minimisers over the steps of planar arms beside a fine scan."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from paretoik.closed_loop.exact_loop import OPTIONS
from paretoik.closed_loop.null_space_steps import ERROR
from paretoik.closed_loop.step_minimisers import minimise_along, newton
from tests.closed_loop.planar_steps import planar_steps, step, tool

NONE = (0.0, 1.0, 0.0, 1.0)  # ranges, of which the error alone needs none


def test_where_newtons_method_ends_the_tool_is_at_its_target():
    s, target = planar_steps(4, away=(-0.5, -0.5))
    starts = itertools.product((0.3, 1.0, 3.0, 5.0), np.linspace(0.0, 2 * np.pi, 12, endpoint=False))
    ends = [newton(rho, theta, OPTIONS, s) for rho, theta in starts]
    hits = [step(s, rho, theta) for error, rho, theta in ends if error < OPTIONS.error_tolerance]
    assert hits
    np.testing.assert_allclose(tool(np.array(hits)), np.tile(target, (len(hits), 1)), atol=1e-12)


@pytest.mark.parametrize("theta", [0.0, np.pi])
def test_a_golden_section_finds_the_least_of_a_fine_scan(theta):
    s, target = planar_steps(3, away=(0.3, 0.2))
    low, high = 0.0, 0.6
    radii = np.linspace(low, high, 20001)
    scan = np.linalg.norm(tool(np.array([step(s, rho, theta) for rho in radii])) - target, axis=1)
    value, rho = minimise_along(low, high, theta, ERROR, NONE, OPTIONS, s, np.empty(3))
    assert value <= scan.min() + 1e-9
    assert rho == pytest.approx(radii[scan.argmin()], abs=1e-3)
