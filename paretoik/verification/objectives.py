"""Objectives computed again: the library's by the definitions below, users' by their functions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from paretoik.verification.measured_motion import MeasuredMotion

LIBRARY = "paretoik.task.objectives"  # defines the library's own objectives


def objective_value(objective: Any, motion: MeasuredMotion) -> float:
    """Return an objective of a motion, in its own sign."""
    return form_value(objective.form, objective_function(objective)(motion), motion, maximise=objective.maximise)


def stated_value(objective: Any, motion: MeasuredMotion, stated: float) -> float:
    """Return an objective of a motion, in its own sign, as a table states it.

    Integrals with kinks are stated for the spline before its projection onto the path. A user's integral may have
    kinks: the value on the spline or on the curve that is nearer to ``stated`` counts.
    """
    name, value = _library_name(objective), objective_value(objective, motion)
    if objective.form != "integral" or (name and name not in KINKED_INTEGRALS):
        return value
    of_spline = objective_value(objective, motion.spline)
    return min((of_spline,) if name else (value, of_spline), key=lambda each: abs(each - stated))


def objective_size(entry: Mapping[str, Any], value: float) -> float:
    """Return the larger of an objective's value and its range in `run.json`."""
    low, high = entry.get("range", (0.0, 0.0))
    return max(abs(value), abs(float(high) - float(low)), 1e-12)


def objective_function(objective: Any) -> Callable[[Any], Any]:
    """Return the definition of a library's objective, or the user's function."""
    return DEFINITIONS.get(_library_name(objective), objective.function)


def _library_name(objective: Any) -> str:
    """Return the name of a library objective, "" for a user's."""
    own = getattr(objective.function, "__module__", None) == LIBRARY
    return str(objective.function.__name__) if own else ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """A function as a weighted sum, or the maximum, of terms.

    pieces: pieces (pieces, terms), smooth if the function is the library's; a term is its largest piece
    instants: instants (terms,), −1 for the whole motion
    weights: weights (terms,), None if the largest term counts
    """

    pieces: np.ndarray
    instants: np.ndarray
    weights: np.ndarray | None


def is_own_integral(objective: Any) -> bool:
    """Return whether an objective is a user's integral, which may have kinks."""
    return bool(objective.form == "integral") and not _library_name(objective)


def objective_terms(objective: Any, motion: MeasuredMotion, factor: float, *, own_kinks: bool = False) -> Terms:
    """Return an objective times a factor, negative if maximised, as terms to minimise.

    Integrals with kinks are evaluated on the spline; users' integrals too if ``own_kinks``.
    """
    name, count = _library_name(objective), motion.time.shape[1]
    if objective.form == "integral" and (name in KINKED_INTEGRALS or (own_kinks and not name)):
        motion = motion.spline
    instants, weights = np.arange(count), motion.weights if objective.form == "integral" else None
    if name in ABSOLUTE and factor > 0:
        values = factor * ABSOLUTE[name](motion)[0]
        dof = values.shape[1]
        weights = weights if weights is None else np.repeat(weights, dof)
        pieces = np.stack([values.ravel(), -values.ravel()])
        return Terms(pieces=pieces, instants=np.repeat(instants, dof), weights=weights)
    if name == "obstacle_clearance" and factor < 0:
        distances = factor * motion.pair_clearances.reshape(count, -1)
        pairs = distances.shape[1]
        return Terms(pieces=distances.reshape(1, -1), instants=np.repeat(instants, pairs), weights=None)
    values = factor * np.asarray(objective_function(objective)(motion), dtype=float).reshape(1, -1)
    if objective.form in ("integral", "peak"):
        return Terms(pieces=values, instants=instants, weights=weights)
    return Terms(pieces=values, instants=np.array([-1]), weights=np.ones(1))


def form_value(form: str, values: Any, motion: MeasuredMotion, *, maximise: bool) -> float:
    """Return the objective's value from a function's values and form."""
    array = np.asarray(values, dtype=float)
    if form == "integral":
        return float(motion.integral(array)[0])
    if form == "peak":
        return float(array.min() if maximise else array.max())
    return float(array.reshape(-1)[0])


def _joint_limit_distance(motion: MeasuredMotion) -> np.ndarray:
    total = np.zeros(motion.time.shape)
    for joint, (low, high) in enumerate(np.array(motion.arm.position_limits, dtype=float)):
        if np.isfinite(high - low) and high > low:
            total += ((motion.q[..., joint] - (high + low) / 2) / (high - low)) ** 2
    return total / (2 * motion.q.shape[-1] * motion.duration[:, None])


def _nearness(values: np.ndarray, limits: Iterable[Any]) -> np.ndarray:
    total = np.zeros(values.shape[:-1])
    for joint, (low, high) in enumerate(limits):
        if np.isfinite(high - low) and high > low:
            range_ = high - low
            inside = np.minimum(np.maximum(values[..., joint], low + 1e-3 * range_), high - 1e-3 * range_)
            total += range_**2 / (4 * (high - inside) * (inside - low))
    return total


ABSOLUTE: dict[str, Callable[[MeasuredMotion], np.ndarray]] = {
    "mechanical_energy": lambda motion: motion.power,
    "joint_travel": lambda motion: motion.dq,
    "peak_velocity": lambda motion: np.concatenate([motion.dq, motion.velocity_bounds], axis=-1),
    "peak_torque": lambda motion: motion.torque,
}
"""Values (1, time, dof) whose absolute values are summed over joints, or whose largest absolute value counts."""

KINKED_INTEGRALS = ("mechanical_energy", "joint_travel", "joint_limit_nearness", "velocity_limit_nearness")

DEFINITIONS: dict[str, Callable[[MeasuredMotion], np.ndarray]] = {
    "kinetic_energy": lambda motion: motion.kinetic_energy,
    "torque_norm": lambda motion: np.einsum("...j,...j->...", motion.torque, motion.torque),
    "mechanical_energy": lambda motion: np.abs(motion.power).sum(axis=-1),
    "joint_travel": lambda motion: np.abs(motion.dq).sum(axis=-1),
    "joint_drift": lambda motion: np.linalg.norm(motion.q[:, -1] - motion.q[:, 0], axis=-1) / motion.q.shape[-1],
    "joint_limit_distance": _joint_limit_distance,
    "joint_limit_nearness": lambda motion: _nearness(motion.q, np.array(motion.arm.position_limits, dtype=float)),
    "velocity_limit_nearness": lambda motion: _nearness(
        motion.dq, [(-limit, limit) for limit in np.array(motion.arm.velocity_limits, dtype=float)]
    ),
    "manipulability": lambda motion: motion.manipulability / motion.duration[:, None],
    "peak_velocity": lambda motion: np.abs(ABSOLUTE["peak_velocity"](motion)).max(axis=-1),
    "peak_torque": lambda motion: np.abs(motion.torque).max(axis=-1),
    "jerk": lambda motion: np.einsum("...j,...j->...", motion.jerk, motion.jerk),
    "obstacle_clearance": lambda motion: motion.clearance,
}
