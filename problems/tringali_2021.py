"""Tringali & Cocuzza 2021: the four trajectories of Table 4, ten seconds each, from one configuration.

The paper resolves step by step; here is the global problem that it compares with: the least kinetic energy. Its own
method is ``pk.methods.PredictiveKineticEnergy``::

    pk.resolve(pk.arms.tringali_3r(), straight(0.4), pk.methods.PredictiveKineticEnergy(), start=START)
"""

from __future__ import annotations

import numpy as np

from paretoik import Arm, Motion, Path, Tracking, Tuning, arms, circle, kinetic_energy, line, measures, methods, plan

START = (0.0, 0.327, -0.754)  # rad
LENGTHS = (0.176, 0.176, 0.1375)
DIRECTION = np.array([-0.3695, 0.1526]) / np.hypot(0.3695, 0.1526)  # direction of the line in the paper of 2020
MIRROR = np.array([1.0, -1.0])  # along the unmirrored line, least-squares velocities meet a singularity
RADIUS = 0.05
DURATION = 10.0
SAMPLES = 1001  # Δt = 0.01 s


def begin() -> np.ndarray:
    """Return the tool's position at the start."""
    angles = np.cumsum(START)
    return np.array(LENGTHS) @ np.stack([np.cos(angles), np.sin(angles)], axis=1)


def straight(length: float, *, mirrored: bool = False, samples: int = SAMPLES) -> Path:
    """Return a rectilinear trajectory of a length [m]."""
    direction = DIRECTION * MIRROR if mirrored else DIRECTION
    return line(begin(), begin() + length * direction, duration=DURATION, samples=samples)


def round_trip(samples: int = SAMPLES, *, turns: int = 1) -> Path:
    """Return the circular trajectory, its centre toward the base; the paper does not give its direction."""
    return circle(begin() - np.array([RADIUS, 0.0]), RADIUS, duration=DURATION, samples=samples, turns=turns)


def trajectory(number: int, samples: int = SAMPLES) -> Path:
    """Return a trajectory of Table 4 by its number, 1 to 4."""
    if number == 2:
        return round_trip(samples)
    return straight({1: 0.1, 3: 0.4, 4: 0.7}[number], mirrored=number == 4, samples=samples)


def problem(number: int, arm: Arm | None = None, samples: int = SAMPLES) -> Tracking:
    """Return the least kinetic energy along a trajectory, from the paper's start."""
    return Tracking(
        arm or arms.tringali_3r(),
        trajectory(number, samples),
        objectives=[kinetic_energy],
        start=START,
        differences="backward",
    )


def trajectory_1() -> Tracking:
    """Least kinetic energy along 0.1 m."""
    return problem(1)


def trajectory_2() -> Tracking:
    """Least kinetic energy around a circle of 0.05 m radius."""
    return problem(2)


def trajectory_3() -> Tracking:
    """Least kinetic energy along 0.4 m, where least-squares velocities meet a singularity."""
    return problem(3)


def trajectory_4() -> Tracking:
    """Least kinetic energy along 0.7 m."""
    return problem(4)


def schedule() -> Tuning:
    """Find horizon, time step and updates of the prediction along 0.7 m: energy against work per update."""
    return schedule_along(4, optimum=plan(problem(4, samples=201)).best.motion)


def schedule_along(number: int, *, optimum: Motion, arm: Arm | None = None, samples: int = 201) -> Tuning:
    """Return the search for the parameters of predictive control; one objective is the distance from an optimum."""
    return Tuning(
        arm or arms.tringali_3r(),
        trajectory(number, samples),
        methods.PredictiveKineticEnergy(),
        parameters=["horizon", "prediction_time", "update_share", "terminal"],
        objectives=[kinetic_energy, measures.evaluations, measures.distance_to(optimum)],
        starts=[START],
    )
