"""Steps of a planar arm for tests, and the same steps in plain NumPy."""

from __future__ import annotations

import numpy as np

from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.robot.arm import Arm
from paretoik.task.path import line
from studies.marcos_2012.exact_loop import OPTIONS, planar_steps
from studies.marcos_2012.null_space_steps import linearise
from tests.closed_loop.planar_geometry import joints_of

HOME = {3: np.array([0.3, 0.65, 1.0]), 4: np.array([0.3, 0.5, 0.8, 1.0])}


def tool(q):
    """Return the tool positions (..., 2) of arms of unit links."""
    tip = joints_of(q)[..., -1]
    return np.stack([tip.real, tip.imag], axis=-1)


def linearised_steps(links, *, away=(0.02, -0.01), longest=np.inf):
    """Return the linearised steps from HOME to a target at a distance from the tool, and the target."""
    q = HOME[links]
    path = line(tool(q), tool(q) + away, duration=1.0, samples=3, timing="uniform")
    task = ClosedLoop(Arm.planar(lengths=np.ones(links)), path, start=q).task
    s = planar_steps(task, np.ones(links), False, 0.0, OPTIONS)
    s.start.previous[:], s.constraints.lower[:], s.constraints.upper[:] = q, -longest, longest
    linearise(q - 0.1, tool(q) + away, s)
    return s, tool(q) + away


def step(s, y):
    """Return the joint positions (..., dof) after steps y (..., 2)."""
    return s.origin + np.asarray(y) @ s.null_space.T
