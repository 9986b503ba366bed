"""Wan, Yao, Zhang & Wu 2018: a 7R arm along two paths that end beyond its reach.

Positions move along a line by the modified trapezoidal law, Euler angles by a polynomial of fifth order. The paper does
not say which Euler angles: intrinsic ZYZ come nearest to its Table 2, extrinsic xyz to its Table 3 (rows of
``studies.wan_2018``), and ZYZ are the default. It prints neither the duration of the motions nor their starts:
durations are parameters with defaults that fit the times of its text, and starts are spread over the self-motion of
the first pose::

    method = pk.methods.WeightedGradientProjection(feedback=80.0)
    pk.resolve(pk.arms.wan_7r(), simulation(), method, start=q, unreachable="track")
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from paretoik import Path, Pose, Tuning, arms, joint_limit_nearness, methods, poses, velocity_limit_nearness

STEP = 0.005  # s
FEEDBACK = 80.0  # 1/s
REGION = DAMPING = 0.02  # ε and ρ_max
BUFFER, REPULSION, BAND = 0.25, np.pi, 0.3  # Ω, t_rmax, λ
GAIN_POSITIONS, GAIN_VELOCITIES = 0.1, 0.05  # |k_H| and |k_G| of the gradient projection method
ENDS = {  # positions [m] and Euler angles [°]
    "simulation": (
        ([0.3174, -0.2065, 0.6469], [-90.0, 90.0, 90.0]),
        ([0.37, 0.0068, 0.1707], [-1.0036, 94.9841, -116.8194]),
    ),
    "experiment": (
        ([0.4063, -0.238, 0.5969], [-80.8661, 92.267, 79.244]),
        ([0.5917, -0.2083, 0.104], [-92.1895, 125.3982, 43.4023]),
    ),
}
EULER = "ZYZ"
DAMPING_RANGE = methods.Parameter("damping", 1e-3, 1e-1, scale="log", fields=("region", "damping"))


def simulation(duration: float = 0.3, euler: str = EULER) -> Path:
    """Return the path of section 3.1, one way in ``duration`` [s]; ``euler``: axes of its angles."""
    return _path("simulation", np.linspace(0.0, 1.0, round(duration / STEP) + 1), euler)


def experiment(duration: float = 1.855, euler: str = EULER) -> Path:
    """Return the path of section 3.2, one way in ``duration`` [s] and back; ``euler``: axes of its angles."""
    fractions = np.linspace(0.0, 1.0, round(duration / STEP) + 1)
    return _path("experiment", np.concatenate([fractions, fractions[-2::-1]]), euler)


def weighted_gains(judged_starts: int = 5) -> Tuning:
    """Find the parameters of weighted gradient projection along the path of section 3.2, velocities limited."""
    method = methods.WeightedGradientProjection(criteria=[velocity_limit_nearness])
    names: list[str | methods.Parameter] = [
        "start",
        "feedback",
        DAMPING_RANGE,
        "buffer",
        "repulsion",
        "band",
        "gain of velocity_limit_nearness",
    ]
    return _tuning(method, names, judged_starts)


def plain_gains(judged_starts: int = 5) -> Tuning:
    """Find the parameters of gradient projection along the same path, positions and velocities limited."""
    criteria = [velocity_limit_nearness, joint_limit_nearness]
    names: list[str | methods.Parameter] = [
        "start",
        "feedback",
        DAMPING_RANGE,
        *(f"gain of {each.name}" for each in criteria),
    ]
    return _tuning(methods.GradientProjection(criteria=criteria), names, judged_starts)


def _tuning(method: methods.GradientProjection, names: list[str | methods.Parameter], judged_starts: int) -> Tuning:
    """Return the search for a method's parameters, without a tolerance: the path leaves the arm's reach."""
    return Tuning(arms.wan_7r(), experiment(), method, parameters=names, judged_starts=judged_starts, tolerance=None)


def modified_trapezoid(u: np.ndarray) -> np.ndarray:
    """Return the share of the path at shares ``u`` of the time; accelerations change as quarters of a sine."""
    fine = np.linspace(0.0, 1.0, 8001)
    folded = np.minimum(fine, 1.0 - fine)
    rising = np.where(folded < 0.125, np.sin(4 * np.pi * folded), np.cos(4 * np.pi * np.maximum(folded - 0.375, 0.0)))
    acceleration = np.where(fine < 0.5, rising, -rising)
    travel = cumulative_simpson(cumulative_simpson(acceleration, x=fine, initial=0), x=fine, initial=0)
    return np.asarray(np.interp(u, fine, travel / travel[-1]))


def _path(name: str, u: np.ndarray, euler: str) -> Path:
    (place, turn), (last_place, last_turn) = (tuple(np.array(part) for part in end) for end in ENDS[name])
    along, turned = modified_trapezoid(u)[:, None], (u**3 * (10 - 15 * u + 6 * u**2))[:, None]
    places = place + along * (last_place - place)
    matrices = Rotation.from_euler(euler, turn + turned * (last_turn - turn), degrees=True).as_matrix()
    return poses(STEP * np.arange(len(u)), [Pose.from_matrix(m, p) for m, p in zip(matrices, places, strict=True)])
