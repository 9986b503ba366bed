"""Steps of a planar arm for tests, and the same in plain NumPy."""

from __future__ import annotations

import numpy as np

from paretoik.closed_loop.null_space_steps import PlanarSteps, linearise
from paretoik.closed_loop.obstacle_tables import tabulate, tabulate_balls
from tests.closed_loop.planar_geometry import joints_of

HOME = {3: np.array([0.3, 0.65, 1.0]), 4: np.array([0.3, 0.5, 0.8, 1.0])}


def tool(q):
    """Return the tool positions (..., 2) of arms of unit links."""
    tip = joints_of(q)[..., -1]
    return np.stack([tip.real, tip.imag], axis=-1)


def planar_steps(links, *, away=(0.02, -0.01), obstacles=(), cells=200):
    """Return the steps from HOME to a target so far from the tool, linearised, and the target."""
    reach = np.arange(links, 0, -1.0)  # of all links from a joint on
    s = PlanarSteps(
        lengths=np.ones(links),
        base=np.zeros(links),
        null_space=np.zeros((links, links - 2)),
        center=np.zeros(links - 2),
        target=np.zeros(2),
        obstacles=tabulate(list(obstacles)),
        bounding=tabulate_balls(list(obstacles)),
        required=0.0,
        reach=reach,
        reference=np.zeros(links),
        margin=np.zeros(1),
        nodes=np.zeros((3 * (links + 1), cells)),
        cells=np.zeros(cells, np.int64),
        distances=np.zeros(cells),
    )
    target = tool(HOME[links]) + away
    linearise(HOME[links], HOME[links] - 0.1, target, s)
    return s, target


def step(s, rho, theta):
    """Return the joint positions after a step of this radius and angle about the center."""
    if s.null_space.shape[1] == 1:
        offset = np.array([rho if theta < 1.0 else -rho])
    else:
        offset = rho * np.array([np.cos(theta), np.sin(theta)])
    return s.base + s.null_space @ (s.center + offset)
