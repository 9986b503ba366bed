"""Limits of a motion, as shares of their ranges."""

from __future__ import annotations

from typing import Any

import numpy as np

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.library_objectives import form_value
from paretoik.verification.measured_motion import MeasuredMotion

QUANTITIES = {"position": "q", "velocity": "dq", "acceleration": "ddq", "torque": "torque", "power": "power"}


def limit_excess(task: Any, motion: MeasuredMotion) -> dict[str, tuple[float, str]]:
    """Return of every kind of limit the largest excess, as a share of its range, and where it is, in words."""
    worst = {}
    for kind, share in limit_shares(task, motion).items():
        instant, joint = np.unravel_index(int(np.nanargmax(share)), share.shape)
        where = f"{kind} of {motion.arm.joint_names[joint]} at {motion.time[0, instant]:.4g} s"
        worst[kind] = float(share[instant, joint]), where
    return worst


def limit_shares(task: Any, motion: MeasuredMotion) -> dict[str, np.ndarray]:
    """Return by how much joint limits are exceeded (time, dof), as shares of their ranges; −inf without a limit.

    With differences="spline" velocities count between the middles too: a parabola lies within its control points.
    """
    shares = {}
    for kind, bounds in task.bounds.items():
        values = np.array(getattr(motion, QUANTITIES[kind])[0])
        limits = limits_at(bounds, np.asarray(task.times), motion.time[0])
        if kind == "velocity" and len(values) == 2 * len(task.times) - 1:
            values[1::2] = 2 * values[1::2] - (values[:-1:2] + values[2::2]) / 2
        size = ranges(kind, limits, motion.model, float(np.ptp(motion.time)))
        shares[kind] = np.maximum(values - limits[..., 1], limits[..., 0] - values) / size
    return shares


def limits_at(bounds: np.ndarray, samples: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return limits (1 or time, dof, 2) at times (time, dof, 2), linear between the samples."""
    if len(bounds) == 1:
        return np.broadcast_to(bounds, (len(t), *bounds.shape[1:]))
    if len(bounds) == len(t) and np.array_equal(samples, t):
        return np.asarray(bounds)
    limits = np.empty((len(t), *bounds.shape[1:]))
    for joint in range(bounds.shape[1]):
        for side in range(2):
            column = bounds[:, joint, side]
            finite = np.isfinite(column)
            if finite.all():
                limits[:, joint, side] = np.interp(t, samples, column)
            else:  # none in an interval with an end that has none
                after = np.clip(np.searchsorted(samples, t), 0, len(samples) - 1)
                exact = np.isclose(samples[after], t, rtol=0, atol=1e-12)
                bounded = finite[after] & (exact | finite[np.maximum(after - 1, 0)])
                none = np.inf if side else -np.inf
                limits[:, joint, side] = np.where(bounded, np.interp(t, samples, np.where(finite, column, 0.0)), none)
    return limits


def ranges(kind: str, limits: np.ndarray, model: ArmModel, duration: float) -> np.ndarray:
    """Return the ranges of limits (..., dof, 2): their width, the size of the only one, or what is usual for an arm."""
    lower, upper = limits[..., 0], limits[..., 1]
    with np.errstate(invalid="ignore"):
        width = upper - lower
    one = np.where(np.isfinite(upper), np.abs(upper), np.where(np.isfinite(lower), np.abs(lower), 0.0))
    size = np.where(np.isfinite(width), width, one)
    return np.where(size > 0, size, _usual(kind, model, duration))


def clearance_range(task: Any, model: ArmModel) -> float:
    """Return what violations of clearance are divided by [m]: its limit, 1 % of the arm's length at least."""
    return max(float(task.min_clearance), 0.01 * model.length)


def constraint_excess(constraint: Any, motion: MeasuredMotion) -> float:
    """Return by how much a user's own limit is exceeded, as a share of its scale."""
    values = np.asarray(constraint.function(motion), dtype=float)
    if constraint.form == "peak":
        return float(np.maximum(values - constraint.upper, constraint.lower - values).max() / constraint.scale)
    value = form_value(constraint.form, values, motion, maximise=False)
    return max(value - constraint.upper, constraint.lower - value) / float(constraint.scale)


def _usual(kind: str, model: ArmModel, duration: float) -> np.ndarray:
    mass = sum(float(body.mass) for body in model.arm.bodies)
    force = mass * (model.length / duration**2 + float(np.linalg.norm(model.arm.gravity)))
    work = force * model.length or 1.0
    if kind in ("torque", "power"):
        return work / model.scales if kind == "torque" else np.full(model.dof, work / duration)
    return model.scales / duration ** {"position": 0, "velocity": 1, "acceleration": 2}[kind]
