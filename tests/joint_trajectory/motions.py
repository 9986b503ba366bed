"""Motions that tests send to robots: with and without tasks, planar and spatial, cyclic, fast and slow."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import paretoik as pk
from paretoik.joint_trajectory.controllers import Controller
from paretoik.joint_trajectory.trajectory import JointTrajectory, TimeScaling, sample_motion
from tests.task.test_joint_curve import CASES, motion, on_circle

URDF = Path(__file__).parents[2] / "problems" / "robots" / "panda.urdf"
PANDA = pk.Arm.from_urdf(URDF, base="panda_link0", tip="panda_hand_tcp")
HOME = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
SWING = np.array([0.6, 0.3, -0.5, 0.4, 0.7, -0.4, 0.9])


def least_jerk(x):
    return x**3 * (10 - 15 * x + 6 * x**2)


def swing(duration=2.0, samples=201, arm=PANDA, home=HOME, by=SWING, law=least_jerk):
    """Return a motion without tasks from rest to rest, by a law of the share of time."""
    t = np.linspace(0.0, duration, samples)
    x = t[:, None] / duration
    return pk.Motion(arm=arm, time=t, q=home + by * law(x), differences="central")


MOTIONS = {
    "Panda, a pose on a line": motion(*CASES["pose on a line"]),
    "Panda, two tasks": motion(*CASES["two tasks"], differences="central"),
    "planar": motion(*CASES["planar, position"]),
    "without tasks": swing(),
    "cyclic": on_circle(31, True, differences="spline"),
}


def sampled(name="without tasks", rate=200.0, ramp=0.0, factor=1.0, **metadata) -> JointTrajectory:
    moving = MOTIONS[name]
    periods = round((float(moving.duration) + ramp) * rate * factor)
    scaling = TimeScaling(duration=float(moving.duration), periods=periods, rate=rate, ramp=ramp)
    trajectory = sample_motion(moving, scaling)
    return JointTrajectory(**{**vars(trajectory), "metadata": metadata})


def bench(arm, **limits) -> Controller:
    return Controller(**{"name": "bench", "joint_names": arm.joint_names, "rate": 200.0, **limits})
