"""The work that shows how a cluster scales: searches by their seed, and tasks that sleep."""

from __future__ import annotations

import time

import numpy as np

import paretoik as pk
from paretoik.arrays import Objectives
from problems import tringali_2020
from problems.panda import panda


def search(generations: int, seed: int) -> Objectives:
    """Return the objectives of the front that a search of a planar arm finds."""
    problem = tringali_2020.energy_torque()
    return pk.solve(problem, population=100, generations=generations, seed=seed, stagnation=False).objectives


def load() -> None:
    """Load everything that a worker needs for any task."""
    import paretoik.runs.cluster  # noqa: F401


def sleep(shared: None, seconds: float) -> None:
    """Take some time and no processor."""
    time.sleep(seconds)


def panda_by_position(samples: int) -> pk.Tracking:
    """Return a task of a 7-DOF arm, whose starts take some hundredths of a second each."""
    path = pk.line([0.45, -0.25, 0.3], [0.45, 0.25, 0.3], duration=1.5, samples=samples)
    return pk.Tracking(panda(), path, objectives=[pk.kinetic_energy])


def motions_of(plan: pk.Plan) -> np.ndarray:
    """Return the motions of all optima of a plan."""
    return np.stack([optimum.motion.q for optimum in plan.optima])
