"""Cells cut by obstacles: no clear step is cut away, bounds converge with the square of the size."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.closed_loop.admissible_steps import clearance_at_start
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.robot.arm import Arm
from paretoik.robot.pose import Pose
from paretoik.task.obstacles import Box, Capsule, Circle, Sphere
from paretoik.task.path import line
from studies.benchmarks.closed_loop.exactness import WEIGHTS, dense_search, objectives, random_steps
from studies.marcos_2012.exact_loop import OPTIONS, exact_step, planar_steps
from studies.marcos_2012.null_space_steps import is_admissible as is_clear
from studies.marcos_2012.null_space_steps import linearise, weighted_sum
from studies.marcos_2012.obstacle_cuts import bound_polygon, cut_cell, may_be_clear
from studies.marcos_2012.step_cells import ADMISSIBLE, contains, model
from tests.studies.marcos_2012.planar_steps import HOME, tool

OBSTACLES = {
    "circle": [Circle([0.6, 1.7], 0.6)],
    "box": [Box([0.2, 2.4], [0.4, 0.3])],
    "turned box": [Box(Pose.planar(0.3, 1.9, angle=0.6), [0.4, 0.3])],
    "capsule": [Capsule([0.1, 2.2, 0.1], [0.4, 1.9, -0.1], 0.3)],
    "sphere": [Sphere([0.7, 1.8, 0.2], 0.5)],
    "two": [Circle([1.2, 1.5], 0.2), Box([0.2, 2.4], [0.4, 0.3])],
}
every_obstacle = pytest.mark.parametrize("obstacles", OBSTACLES.values(), ids=OBSTACLES)


def steps_beside(obstacles, *, swept):
    """Return the linearised steps of four links near obstacles."""
    q = HOME[4]
    target = tool(q) + np.array([0.02, -0.01])
    path = line(tool(q), target, duration=1.0, samples=3, timing="uniform")
    task = ClosedLoop(Arm.planar(lengths=np.ones(4)), path, start=q, obstacles=obstacles, link_radius=0.02).task
    s = planar_steps(task, np.ones(4), swept, 0.01 if swept else 0.0, OPTIONS)
    s.start.previous[:], s.constraints.lower[:], s.constraints.upper[:] = q, -np.inf, np.inf
    linearise(q - 0.1, target, s)
    s.clearance[0] = clearance_at_start(s.start, s.constraints, s.workspace)
    return s


def cut(cell, s):
    """Return the corners, from the middle, of the part of a cell that may be clear, its model, and the number of cuts.

    There are no corners if nothing may be clear.
    """
    m = model(cell, s)
    possible, interval = may_be_clear(cell, m, OPTIONS, s)
    corners, cuts = (
        cut_cell(cell, m, interval, OPTIONS.witnesses, s) if possible and not cell[ADMISSIBLE] > 0.0 else (3, 0)
    )
    return s.polygons[0, :corners].copy() if possible else np.empty((0, 5)), m, cuts


def is_within(polygon, u, v, *, tolerance):
    """Return whether a convex polygon contains a point."""
    along = np.roll(polygon[:, :2], -1, axis=0) - polygon[:, :2]
    turns = along[:, 0] * (v - polygon[:, 1]) - along[:, 1] * (u - polygon[:, 0])
    return len(polygon) > 0 and ((turns >= -tolerance).all() or (turns <= tolerance).all())


@every_obstacle
@pytest.mark.parametrize("swept", [False, True])
def test_no_clear_step_of_a_cell_is_cut_away(obstacles, swept):
    s, rng, cells_cut = steps_beside(obstacles, swept=swept), np.random.default_rng(0), 0
    for _ in range(400):
        size = 10 ** rng.uniform(-3, -0.3)
        cell = np.append((rng.uniform(-1.5, 1.5, 2) + size * rng.normal(size=(3, 2))).ravel(), [0.0, 0.0])
        shares = rng.dirichlet(np.full(3, 0.5), size=30)
        clear = [y for y in shares @ cell[:6].reshape(3, 2) if is_clear(*y, s)]
        polygon, m, cuts = cut(cell, s)
        cells_cut += bool(clear) and cuts > 0
        if cell[ADMISSIBLE] > 0.0:
            assert len(clear) == len(shares)
        else:
            assert all(is_within(polygon, u - m.u, v - m.v, tolerance=1e-12 * size) for u, v in clear)
    assert cells_cut > 0


@pytest.mark.parametrize("obstacles", [OBSTACLES["circle"], OBSTACLES["box"]], ids=["circle", "box"])
def test_bounds_near_obstacles_converge_with_the_square_of_the_size(obstacles):
    s, weights = steps_beside(obstacles, swept=False), (1.0, 0.3)
    angle = np.linspace(0, 2 * np.pi, 400)
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inside = next(d for d in way if not is_clear(*(1.2 * d), s) and is_clear(0.0, 0.0, s))
    clear, blocked = 0.0, 1.2
    for _ in range(60):
        middle = 0.5 * (clear + blocked)
        clear, blocked = (middle, blocked) if is_clear(*(middle * inside), s) else (clear, middle)
    edge, gaps = clear * inside, []
    for size in (0.03, 0.003, 0.0003):
        corners = edge + size * np.array([[1.0, 0.2], [-0.6, 0.7], [-0.4, -0.9]])
        cell = np.append(corners.ravel(), [0.0, 0.0])
        best, least, rng = edge, weighted_sum(*weights, *edge, s)[0], np.random.default_rng(0)
        for spread in size * 0.5 ** np.arange(12):
            for u, v in best + spread * rng.normal(size=(300, 2)):
                if contains(cell, u, v, s) and is_clear(u, v, s) and weighted_sum(*weights, u, v, s)[0] < least:
                    best, least = np.array([u, v]), weighted_sum(*weights, u, v, s)[0]
        polygon, m, _ = cut(cell, s)
        gaps.append((least - bound_polygon(*weights, len(polygon), m, OPTIONS.directions, s)[0]) / size)
    assert all(gap > 0 for gap in gaps)
    assert gaps[2] < 0.1 * gaps[0]


@pytest.mark.parametrize(
    ("longest", "seed", "index"), [(np.inf, 5, 3), (np.inf, 12, 3), (np.inf, 16, 1), (0.1, 9, 0), (0.1, 6, 1)]
)
def test_no_step_near_obstacles_is_better_than_the_exact_one(longest, seed, index):
    step = list(random_steps(4, seed, index + 1, longest, blocked=True))[index]
    F = objectives(step, np.stack([exact_step(step, weight=weight) for weight in WEIGHTS]))
    weights = np.array([[weight, 1.0 - weight] for weight in WEIGHTS]) / np.abs(F[0] - F[-1])
    assert (np.einsum("wk,wk->w", F, weights) <= dense_search(step, weights, 0) + 1e-6).all()
