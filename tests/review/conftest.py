from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.front.front import Front
from paretoik.review.drawing.choice_layer import recording_with_choice
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


def trade_off(points: int, n_obj: int) -> np.ndarray:
    """Return points on a sphere's octant, mutually non-dominated in the user's own sign."""
    if n_obj == 1:
        return np.full((1, 1), 0.25)
    directions = np.abs(np.random.default_rng(n_obj).normal(size=(points, n_obj)))
    minimised = 2.0 - directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return minimised * np.where(MAXIMISED[:n_obj], -1.0, 1.0)


@pytest.fixture
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


@pytest.fixture
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


@pytest.fixture(scope="session")
def choice_recordings(tmp_path_factory):
    """The recordings of a short search without and with a choice; every joint quantity is limited."""
    folder = tmp_path_factory.mktemp("recordings")
    problem = pk.Tracking(
        pk.arms.tringali_3r(),
        pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=11),
        objectives=[pk.kinetic_energy, pk.torque_norm, pk.joint_travel],
        limits=pk.Limits(position=2.5, velocity=20.0, acceleration=900.0, torque=90.0, power=900.0),
    )
    front = pk.solve(problem, population=16, generations=4, seed=1, refine=False, out=folder / "run", observe=False)
    recording, chosen = folder / "run" / "review.rrd", folder / "choice.rrd"
    chosen.write_bytes(recording_with_choice(front, front[int(front.ids[0])], recording=recording))
    return recording, chosen
