"""The library's objectives from their definitions, on motions measured anew; a user's by their own functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from paretoik.verification.measured_motion import MeasuredMotion

LIBRARY = "paretoik.task.objectives"  # where the library's own are defined


def objective_value(objective: Any, motion: MeasuredMotion) -> float:
    """Return an objective of a motion, in its own sign."""
    return form_value(objective.form, objective_function(objective)(motion), motion, maximise=objective.maximise)


def objective_function(objective: Any) -> Callable[[Any], Any]:
    """Return the function of an objective: the definition below of the library's own, else the user's."""
    function: Callable[[Any], Any] = objective.function
    if getattr(function, "__module__", None) == LIBRARY and function.__name__ in DEFINITIONS:
        return DEFINITIONS[function.__name__]
    return function


def form_value(form: str, values: Any, motion: MeasuredMotion, *, maximise: bool) -> float:
    """Return what a function's values are as an objective of its form."""
    array = np.asarray(values, dtype=float)
    if form == "integral":
        return float(motion.integral(array)[0])
    if form == "peak":
        return float(array.min() if maximise else array.max())
    return float(array.reshape(-1)[0])


def _kinetic_energy(motion: MeasuredMotion) -> np.ndarray:
    return motion.kinetic_energy


def _torque_norm(motion: MeasuredMotion) -> np.ndarray:
    return np.einsum("...j,...j->...", motion.torque, motion.torque)


def _mechanical_energy(motion: MeasuredMotion) -> np.ndarray:
    return np.abs(motion.torque * motion.dq).sum(axis=-1)


def _joint_travel(motion: MeasuredMotion) -> np.ndarray:
    return np.abs(motion.dq).sum(axis=-1)


def _joint_drift(motion: MeasuredMotion) -> np.ndarray:
    return np.linalg.norm(motion.q[:, -1] - motion.q[:, 0], axis=-1) / motion.q.shape[-1]


def _joint_limit_distance(motion: MeasuredMotion) -> np.ndarray:
    lower, upper = np.array(motion.arm.position_limits, dtype=float).T
    total = np.zeros(motion.time.shape)
    for joint, (low, high) in enumerate(zip(lower, upper, strict=True)):
        if np.isfinite(high - low) and high > low:
            total += ((motion.q[..., joint] - (high + low) / 2) / (high - low)) ** 2
    return total / (2 * motion.q.shape[-1] * motion.duration[:, None])


def _nearness(values: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    total = np.zeros(values.shape[:-1])
    for joint, (low, high) in enumerate(zip(lower, upper, strict=True)):
        if np.isfinite(high - low) and high > low:
            range_ = high - low
            inside = np.minimum(np.maximum(values[..., joint], low + 1e-3 * range_), high - 1e-3 * range_)
            total += range_**2 / (4 * (high - inside) * (inside - low))
    return total


def _joint_limit_nearness(motion: MeasuredMotion) -> np.ndarray:
    return _nearness(motion.q, *np.array(motion.arm.position_limits, dtype=float).T)


def _velocity_limit_nearness(motion: MeasuredMotion) -> np.ndarray:
    limits = np.array(motion.arm.velocity_limits, dtype=float)
    return _nearness(motion.dq, -limits, limits)


def _manipulability(motion: MeasuredMotion) -> np.ndarray:
    return motion.manipulability / motion.duration[:, None]


def _peak_velocity(motion: MeasuredMotion) -> np.ndarray:
    return np.abs(motion.dq).max(axis=-1)


def _peak_torque(motion: MeasuredMotion) -> np.ndarray:
    return np.abs(motion.torque).max(axis=-1)


def _jerk(motion: MeasuredMotion) -> np.ndarray:
    return np.einsum("...j,...j->...", motion.jerk, motion.jerk)


def _obstacle_clearance(motion: MeasuredMotion) -> np.ndarray:
    return motion.clearance


DEFINITIONS: dict[str, Callable[[MeasuredMotion], np.ndarray]] = {
    "kinetic_energy": _kinetic_energy,
    "torque_norm": _torque_norm,
    "mechanical_energy": _mechanical_energy,
    "joint_travel": _joint_travel,
    "joint_drift": _joint_drift,
    "joint_limit_distance": _joint_limit_distance,
    "joint_limit_nearness": _joint_limit_nearness,
    "velocity_limit_nearness": _velocity_limit_nearness,
    "manipulability": _manipulability,
    "peak_velocity": _peak_velocity,
    "peak_torque": _peak_torque,
    "jerk": _jerk,
    "obstacle_clearance": _obstacle_clearance,
}
