"""Limits of a motion, as shares of their ranges."""

from __future__ import annotations

from typing import Any

import numpy as np

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.library_objectives import form_value
from paretoik.verification.measured_motion import MeasuredMotion
from paretoik.verification.obstacle_distances import nearest_pair
from paretoik.verification.report import Worst

QUANTITIES = {
    "position": "q",
    "velocity": "dq",
    "acceleration": "ddq",
    "jerk": "jerk",
    "torque": "torque",
    "power": "power",
}
UNITS = {  # of joints that turn, and of those that slide
    "position": ("rad", "m"),
    "velocity": ("rad/s", "m/s"),
    "acceleration": ("rad/s²", "m/s²"),
    "jerk": ("rad/s³", "m/s³"),
    "torque": ("N m", "N"),
    "power": ("W", "W"),
}


def worst_of_limits(task: Any, motion: MeasuredMotion) -> dict[str, tuple[float, Worst]]:
    """Return by kind the largest excess of a joint limit, as a share of its range, and its place."""
    worst = {}
    for kind, share in limit_shares(task, motion).items():
        instant, joint = np.unravel_index(int(np.argmax(share)), share.shape)
        value = float(limited_values(task, motion, kind)[instant, joint])
        bounds = limits_at(task.bounds[kind], np.asarray(task.times), motion.time[0])[instant, joint]
        above = value - bounds[1] >= bounds[0] - value
        place = Worst(
            what=kind,
            joint=motion.arm.joint_names[joint],
            time=float(motion.time[0, instant]),
            value=value,
            limit=float(bounds[1] if above else bounds[0]),
            unit=UNITS[kind][int(not motion.model.turning[joint])],
        )
        worst[kind] = float(share[instant, joint]), place
    return worst


def worst_of_clearance(task: Any, motion: MeasuredMotion) -> tuple[float, Worst]:
    """Return how far the least clearance is below its limit, as a share of its range, and its place."""
    instant = int(motion.clearance.argmin())
    smallest = float(motion.clearance[0, instant])
    pair = nearest_pair(task.obstacles, motion.links[0, instant])
    place = Worst(
        what="clearance",
        joint=pair,
        time=float(motion.time[0, instant]),
        value=smallest,
        limit=float(task.min_clearance),
        unit="m",
    )
    return float(task.min_clearance - smallest) / clearance_range(task, motion.model), place


def worst_of_constraint(constraint: Any, motion: MeasuredMotion) -> tuple[float, Worst]:
    """Return the excess of a user's own limit, as a share of its scale, and its place.

    An integral may have kinks, and is limited on the spline then: the lesser excess of spline and curve counts.
    """
    if constraint.form == "peak":
        values = np.asarray(constraint.function(motion), dtype=float)
        excess = np.maximum(values - constraint.upper, constraint.lower - values).reshape(-1)
        instant = int(np.argmax(np.where(np.isnan(excess), np.inf, excess)))
        value, time = float(values.reshape(-1)[instant]), float(motion.time[0, instant])
    else:
        motions = (motion, motion.spline) if constraint.form == "integral" else (motion,)
        every = [form_value(constraint.form, constraint.function(each), each, maximise=False) for each in motions]
        value, time = min(every, key=lambda each: max(each - constraint.upper, constraint.lower - each)), np.nan
    above = value - constraint.upper >= constraint.lower - value
    limit = float(constraint.upper if above else constraint.lower)
    excess_of_it = max(value - constraint.upper, constraint.lower - value) / float(constraint.scale)
    worst = Worst(what=constraint.name, time=time, value=value, limit=limit, unit=constraint.unit)
    return excess_of_it if np.isfinite(value) else float("nan"), worst


def limit_shares(task: Any, motion: MeasuredMotion) -> dict[str, np.ndarray]:
    """Return by how much joint limits are exceeded (time, dof), as shares of their ranges; −inf without a limit."""
    shares = {}
    for kind, bounds in task.bounds.items():
        limits = limits_at(bounds, np.asarray(task.times), motion.time[0])
        size = ranges(kind, limits, motion.model, float(np.ptp(motion.time)))
        values = limited_values(task, motion, kind)
        shares[kind] = np.maximum(values - limits[..., 1], limits[..., 0] - values) / size
    return shares


def limited_values(task: Any, motion: MeasuredMotion, kind: str) -> np.ndarray:
    """Return the values (time, dof) that a kind of limit bounds.

    With differences="spline" velocities at the middles of intervals are Bernstein points.
    """
    return np.asarray(getattr(motion, "velocity_bounds" if kind == "velocity" else QUANTITIES[kind])[0])


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


def _usual(kind: str, model: ArmModel, duration: float) -> np.ndarray:
    mass = sum(float(body.mass) for body in model.arm.bodies)
    force = mass * (model.length / duration**2 + float(np.linalg.norm(model.arm.gravity)))
    work = force * model.length or 1.0
    if kind in ("torque", "power"):
        return work / model.scales if kind == "torque" else np.full(model.dof, work / duration)
    return model.scales / duration ** {"position": 0, "velocity": 1, "acceleration": 2, "jerk": 3}[kind]
