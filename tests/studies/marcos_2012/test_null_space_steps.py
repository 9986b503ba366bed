"""Steps of planar arms compared with NumPy: the shortest, its neighbours, the tool's error, and bounds."""

from __future__ import annotations

import numpy as np
import pytest

from studies.marcos_2012.null_space_steps import error_at, tool_error, weighted_sum, write_region
from tests.studies.marcos_2012.planar_steps import HOME, linearised_steps, step, tool

every_arm = pytest.mark.parametrize("links", [3, 4])


def drawn(links, count, size=1.0):
    y = np.random.default_rng(0).uniform(-size, size, size=(count, 2))
    y[:, links - 2 :] = 0.0
    return y


def jacobian(q, h=1e-6):
    return np.array([(tool(q + h * unit) - tool(q - h * unit)) / (2 * h) for unit in np.eye(len(q))]).T


@every_arm
def test_steps_reach_the_target_to_first_order_and_differ_by_the_null_space(links):
    s, target = linearised_steps(links)
    J, N = jacobian(HOME[links]), s.null_space[:, : links - 2]
    np.testing.assert_allclose(J @ (s.origin - HOME[links]), target - tool(HOME[links]), atol=1e-8)
    np.testing.assert_allclose(N.T @ N, np.eye(links - 2), atol=1e-14)
    np.testing.assert_allclose(J @ N, 0.0, atol=1e-8)


@every_arm
def test_the_displacement_grows_with_the_distance_from_the_origin_alone(links):
    s, _ = linearised_steps(links)
    y = drawn(links, 20)
    home = HOME[links] - 0.1

    def displacement(q):  # Marcos et al. 2012, Eq. 17, times Δt²
        return ((q - HOME[links]) ** 2).sum(axis=-1) + ((q - home) ** 2).sum(axis=-1)

    grown = displacement(step(s, y)) - displacement(s.origin)
    np.testing.assert_allclose(grown, 2 * (y**2).sum(axis=1), rtol=1e-12, atol=1e-14)


@every_arm
def test_the_error_of_the_tool_and_its_derivatives_are_those_of_numpy(links):
    s, target = linearised_steps(links)
    h = 1e-5
    for u, v in drawn(links, 5):
        x, y, first, second = tool_error(u, v, s)
        np.testing.assert_allclose([x, y], tool(step(s, [u, v])) - target, atol=1e-14)
        assert error_at(u, v, s) == pytest.approx(np.hypot(x, y))
        after = [tool_error(u + h, v, s), tool_error(u - h, v, s), tool_error(u, v + h, s), tool_error(u, v - h, s)]
        by_u, by_v = ((after[k][2][m] - after[k + 1][2][m]) / (2 * h) for k, m in ((0, 0), (2, 1)))
        assert first[0] == pytest.approx((after[0][0] - after[1][0]) / (2 * h), abs=1e-8)
        assert first[3] == pytest.approx((after[2][1] - after[3][1]) / (2 * h), abs=1e-8)
        assert second[0] == pytest.approx(by_u, abs=1e-8)
        assert second[2] == pytest.approx(by_v, abs=1e-8)


@every_arm
def test_the_weighted_sum_has_the_derivatives_of_its_differences(links):
    s, _ = linearised_steps(links)
    h = 1e-5
    for u, v in drawn(links, 5):
        value, gradient, hessian = weighted_sum(0.3, 0.7, u, v, s)
        assert value == pytest.approx(0.3 * (u * u + v * v) + 0.7 * error_at(u, v, s))
        ahead, behind = weighted_sum(0.3, 0.7, u + h, v, s), weighted_sum(0.3, 0.7, u - h, v, s)
        assert gradient[0] == pytest.approx((ahead[0] - behind[0]) / (2 * h), abs=1e-7)
        assert hessian[0] == pytest.approx((ahead[1][0] - behind[1][0]) / (2 * h), abs=1e-6)
        assert hessian[1] == pytest.approx((ahead[1][1] - behind[1][1]) / (2 * h), abs=1e-6)


@every_arm
@pytest.mark.parametrize("longest", [0.02, 0.1, np.inf])
def test_the_region_has_the_steps_within_the_bounds_of_the_joints_and_no_others(links, longest):
    s, _ = linearised_steps(links, longest=longest)
    count = write_region(0.5, s)
    corners = s.corners[0, :count]
    y = drawn(links, 2000, size=0.5)
    within = (np.abs(step(s, y) - HOME[links]) <= longest).all(axis=1)
    assert within.any()
    if links == 3:
        inside = (y[:, 0] >= corners[0, 0]) & (y[:, 0] <= corners[1, 0])
    else:
        edges = np.roll(corners, -1, axis=0) - corners
        offsets = y[:, None] - corners
        inside = (edges[:, 0] * offsets[..., 1] - edges[:, 1] * offsets[..., 0] >= 0).all(axis=1)
    np.testing.assert_array_equal(inside, within)


def test_bounds_that_no_step_keeps_leave_no_region():
    s, _ = linearised_steps(3, away=(0.3, 0.3), longest=0.01)
    assert write_region(8.0, s) == 0
