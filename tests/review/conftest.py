from __future__ import annotations

import numpy as np
import pytest

from paretoik.front.front import Front
from paretoik.review.recording.recorder import Generation
from paretoik.robot.arm import Arm
from paretoik.task.motion import Motion

NAMES = ("kinetic_energy", "torque_norm", "manipulability", "jerk", "$cost$")
UNITS = ("J s", "N²m²s", "", "rad²/s⁵", "€")
MAXIMISED = (False, False, True, False, False)


def swinging_arm(planar: bool, dof: int = 3) -> Arm:
    """Return an arm of equal links in the plane, or in space with a sliding joint."""
    if planar:
        links = [1.0] * dof
        return Arm.planar(lengths=links, masses=links, centers=[0.5] * dof, inertias=[0.1] * dof)
    return Arm.from_dh(
        a=[0.0] + [1.0] * (dof - 1),
        alpha=[0.0, np.pi / 2] + [0.0] * (dof - 2),
        d=[0.0] * dof,
        theta=[0.0] * dof,
        convention="modified",
        types=("revolute",) * (dof - 1) + ("prismatic",),
        masses=[1.0] * dof,
    )


def swing(points: int, *, planar: bool, dof: int = 3, samples: int = 11) -> Motion:
    time = np.linspace(0.0, 1.0, samples)
    spread = np.linspace(0.2, 1.0, points)[:, None, None]
    q = spread * np.sin(time)[:, None] * np.linspace(0.3, 1.0, dof)
    return Motion(arm=swinging_arm(planar, dof), time=time, q=q, differences="backward")


def sphere(points: int, n_obj: int, seed: int = 0) -> np.ndarray:
    directions = np.abs(np.random.default_rng(seed).normal(size=(points, n_obj)))
    return 2.0 - directions / np.linalg.norm(directions, axis=1, keepdims=True)


def trade_off(points: int, n_obj: int) -> np.ndarray:
    """Return points on a sphere's octant, mutually non-dominated in the user's own sign."""
    if n_obj == 1:
        return np.full((1, 1), 0.25)
    return sphere(points, n_obj, n_obj) * np.where(MAXIMISED[:n_obj], -1.0, 1.0)


@pytest.fixture(scope="session")
def make_front():
    def make(n_obj: int, *, points: int = 12, planar: bool = True, moving: bool = True) -> Front:
        objectives = trade_off(points, n_obj)
        motions = swing(len(objectives), planar=planar) if moving else None
        return Front(
            ids=np.arange(len(objectives)) + 100,
            objectives=objectives,
            names=NAMES[:n_obj],
            units=UNITS[:n_obj],
            maximised=MAXIMISED[:n_obj],
            motions=motions,
        )

    return make


@pytest.fixture(scope="session")
def make_generations():
    def make(n_obj: int, *, count: int = 4, points: int = 12) -> list[Generation]:
        sign = np.where(MAXIMISED[:n_obj], -1.0, 1.0)
        generations = []
        for number in range(count):
            front = trade_off(points, n_obj) + sign * (count - 1 - number)
            population = np.concatenate([front + sign, np.full((1, n_obj), np.nan)])
            ids = np.arange(len(front)) + 100
            generations.append(
                Generation(
                    number=number, population=population, front=front, front_ids=ids, hypervolume=number + 0.5, failed=1
                )
            )
        return generations

    return make
