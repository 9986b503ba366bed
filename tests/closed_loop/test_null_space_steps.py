"""Steps of planar arms beside NumPy: the shortest, those around it, and which of them are clear of obstacles."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.closed_loop.null_space_steps import ERROR, RADIUS, SUM, evaluate_grid, merit
from paretoik.task.obstacles import Circle
from tests.closed_loop.planar_geometry import meets
from tests.closed_loop.planar_steps import HOME, planar_steps, step, tool

every_arm = pytest.mark.parametrize("links", [3, 4])


def jacobian(q, h=1e-6):
    return np.array([(tool(q + h * unit) - tool(q - h * unit)) / (2 * h) for unit in np.eye(len(q))]).T


@every_arm
def test_the_base_is_the_shortest_step_to_the_target_and_others_differ_by_the_null_space(links):
    s, target = planar_steps(links)
    J = jacobian(HOME[links])
    np.testing.assert_allclose(s.base, HOME[links] + np.linalg.pinv(J) @ (target - tool(HOME[links])), atol=1e-8)
    np.testing.assert_allclose(s.null_space.T @ s.null_space, np.eye(links - 2), atol=1e-14)
    np.testing.assert_allclose(J @ s.null_space, 0.0, atol=1e-8)


@every_arm
def test_the_displacement_grows_with_the_radius_alone(links):
    s, _ = planar_steps(links)
    home = HOME[links] - 0.1

    def displacement(q):  # Marcos et al. 2012, Eq. 17, times Δt²
        return ((q - HOME[links]) ** 2).sum() + ((q - home) ** 2).sum()

    least = displacement(step(s, 0.0, 0.0))
    for theta in (0.0, 2.0, 4.0):
        assert displacement(step(s, 0.3, theta)) == pytest.approx(least + 2 * 0.3**2, rel=1e-12)


@every_arm
def test_a_grid_holds_the_error_of_every_step_and_infinity_where_the_arm_meets_something(links):
    obstacles = [Circle([0.9, 0.75], 0.2)]
    s, target = planar_steps(links, obstacles=obstacles)
    radii, angles = np.array([0.0, 0.1, 0.5, 2.0]), np.array([0.0, np.pi])
    errors, q = np.empty((4, 2)), np.empty(links)
    evaluate_grid(radii, angles, s, q, errors)
    steps = np.array([[step(s, rho, theta) for theta in angles] for rho in radii])
    blocked = meets(steps, obstacles)
    assert 0 < blocked.sum() < blocked.size
    expected = np.where(blocked, np.inf, np.linalg.norm(tool(steps) - target, axis=-1))
    np.testing.assert_allclose(errors, expected, rtol=1e-12, atol=1e-12)


def test_what_is_minimised_is_the_error_the_radius_or_the_weighted_sum_of_their_shares():
    ranges = (0.25, 2.0, 0.1, 0.5)  # weight, largest radius, smallest error, its range
    assert merit(1.0, 0.3, ERROR, ranges) == 0.3
    assert merit(1.0, 0.3, RADIUS, ranges) == 1.0
    assert merit(1.0, 0.3, SUM, ranges) == pytest.approx(0.25 * 0.25 + 0.75 * 0.4)
    assert merit(1.0, np.inf, RADIUS, ranges) == np.inf
