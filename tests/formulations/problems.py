"""Small, quick problems for the tests of the self-motion encoding."""

from __future__ import annotations

from functools import cache
from pathlib import Path as File

import numpy as np

from paretoik import Arm, Path, Pose, Tracking, joint_travel, kinetic_energy, line
from paretoik.robot.arms import marcos_nr, tringali_3r
from paretoik.robot.kinematics import forward_kinematics

PANDA = File(__file__).parents[2] / "problems" / "robots" / "panda.urdf"
OBJECTIVES = [kinetic_energy, joint_travel]
SMALL = {"bases": 4, "coefficients": 5, "objectives": OBJECTIVES, "differences": "backward"}
DOWN = (np.pi, 0.0, 0.0)


@cache
def panda() -> Arm:
    return Arm.from_urdf(PANDA, base="panda_link0", tip="panda_hand_tcp")


def random_arm(seed: int, dof: int) -> Arm:
    """Return an arm with random Denavit–Hartenberg parameters, with links about equal in length and offset."""
    rng = np.random.default_rng(seed)
    a, d = rng.uniform(0.1, 0.4, dof), rng.uniform(-0.2, 0.2, dof)
    alpha, theta = rng.uniform(-np.pi, np.pi, dof), rng.uniform(-np.pi, np.pi, dof)
    convention = "modified" if seed % 2 else "standard"
    return Arm.from_dh(a=a, alpha=alpha, d=d, theta=theta, convention=convention, name=f"random arm {seed}")


def within_reach(arm: Arm, seed: int, *, poses: bool, samples: int) -> Path:
    """Return a line of 0.1 m through the tool's place in a random posture."""
    rng = np.random.default_rng(seed)
    rotation, place = forward_kinematics(arm, rng.uniform(-2, 2, arm.dof))
    step = rng.normal(size=3)
    half = 0.05 * step / np.linalg.norm(step)
    ends = place - half, place + half
    if poses:
        ends = tuple(Pose.from_matrix(rotation, end) for end in ends)
    return line(*ends, duration=1.0, samples=samples)


def paper_3r(**settings) -> Tracking:
    path = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=21)
    return Tracking(tringali_3r(), path, **{**SMALL, **settings})


def planar_4r(**settings) -> Tracking:
    path = line([2.5, 0.5], [1.0, 2.0], duration=1.0, samples=21)
    return Tracking(marcos_nr(4), path, **{**SMALL, "objectives": [joint_travel], **settings})


def panda_position(**settings) -> Tracking:
    path = line([0.45, -0.15, 0.3], [0.45, 0.15, 0.3], duration=1.5, samples=21)
    return Tracking(panda(), path, **{**SMALL, **settings})


def panda_pose(**settings) -> Tracking:
    ends = (Pose.from_rpy((0.45, y, 0.3), DOWN) for y in (-0.15, 0.15))
    return Tracking(panda(), line(*ends, duration=1.5, samples=21), **{**SMALL, **settings})


def random_position(**settings) -> Tracking:
    arm = random_arm(1, 5)
    path = within_reach(arm, 1, poses=False, samples=21)
    return Tracking(arm, path, **{**SMALL, "objectives": [joint_travel], **settings})


def random_pose(**settings) -> Tracking:
    arm = random_arm(2, 8)
    path = within_reach(arm, 2, poses=True, samples=21)
    return Tracking(arm, path, **{**SMALL, "objectives": [joint_travel], **settings})


PROBLEMS = {
    "planar 3R": paper_3r,
    "planar 4R": planar_4r,
    "Panda, position": panda_position,
    "Panda, pose": panda_pose,
    "random 5R, position": random_position,
    "random 8R, pose": random_pose,
}


@cache
def built(name: str) -> Tracking:
    """Return a problem with its usual settings; built once."""
    return PROBLEMS[name]()
