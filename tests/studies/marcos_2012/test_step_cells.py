"""Cells of steps: their bounds are valid everywhere within them, and halves cover the cell."""

from __future__ import annotations

import numpy as np
import pytest

from studies.marcos_2012.null_space_steps import tool_error, weighted_sum, write_region
from studies.marcos_2012.step_cells import contains, halve, lower_bound, model, place_region
from tests.studies.marcos_2012.planar_steps import linearised_steps

every_arm = pytest.mark.parametrize("links", [3, 4])


def cells(links, count=40):
    """Return steps, and random cells of all sizes, near the target and far from it."""
    s, _ = linearised_steps(links)
    rng = np.random.default_rng(links)
    scale = 10 ** rng.uniform(-4, 0, size=(count, 1))
    made = np.zeros((count, 8))
    made[:, :6] = np.tile(scale * rng.normal(size=(count, 2)), (1, 3)) + 0.3 * scale * rng.normal(size=(count, 6))
    if links == 3:
        made[:, 1:6:2], made[:, 4] = 0.0, made[:, 2]
    return s, made


def points(cell, count=200):
    shares = np.random.default_rng(0).dirichlet(np.full(3, 0.5), size=count)
    return shares @ cell[:6].reshape(3, 2)


@every_arm
@pytest.mark.parametrize("weights", [(1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (30.0, 1.0), (0.01, 5.0)])
def test_no_step_of_a_cell_is_below_its_bound(links, weights):
    s, made = cells(links)
    for cell in made:
        least = min(weighted_sum(*weights, u, v, s)[0] for u, v in points(cell))
        assert lower_bound(*weights, np.inf, model(cell, s)) <= least + 1e-12


@every_arm
def test_bounds_converge_with_the_square_of_the_size(links):
    s, _ = linearised_steps(links)
    gaps = []
    for size in (0.1, 0.01, 0.001):
        cell = np.array([0.3, 0.0, 0.3 + size, 0.0, 0.3 + size, 0.0, 0.0, 0.0])
        if links == 4:
            cell[3], cell[5] = -size, size
        least = min(weighted_sum(1.0, 1.0, u, v, s)[0] for u, v in points(cell, 2000))
        gaps.append(least - lower_bound(1.0, 1.0, np.inf, model(cell, s)))
    assert gaps[1] < 0.05 * gaps[0]
    assert gaps[2] < 0.05 * gaps[1]


@every_arm
def test_a_model_is_valid_in_all_of_its_cell(links):
    s, made = cells(links)
    told = 0
    for cell in made:
        m = model(cell, s)
        hessian = np.array(weighted_sum(0.0, 1.0, m.u, m.v, s)[2])
        for u, v in points(cell, 40):
            assert contains(cell, u, v, s)
            if m.change < np.inf:
                other = np.array(weighted_sum(0.0, 1.0, u, v, s)[2])
                assert np.abs(other - hessian).max() <= m.change * (1 + 1e-9)
                told += 1
            if m.invertible:
                xu, xv, yu, yv = tool_error(u, v, s)[2]
                assert xu * yv - xv * yu != 0
    assert told > 0


@every_arm
def test_the_cells_of_a_region_and_their_halves_are_all_of_it(links):
    s, _ = linearised_steps(links, longest=0.2)
    corners = write_region(0.5, s)
    count = place_region(corners, s)
    y = points(np.concatenate([s.corners[0, [0, corners // 2, corners - 1]].ravel()]), 300)
    for _ in range(2):
        assert all(any(contains(cell, u, v, s) for cell in s.cells[:count]) for u, v in y)
        for i in range(count):
            u, v = halve(i, count + i, s)
            assert contains(s.cells[i], u, v, s)
            assert contains(s.cells[count + i], u, v, s)
        count *= 2
