"""Excesses of a motion over its limits, computed again, and the worst of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from paretoik.inputs import first_line
from paretoik.verification.arm_model import ArmModel
from paretoik.verification.measured_motion import MeasuredMotion, nearest_pair
from paretoik.verification.objectives import form_value
from paretoik.verification.run_contents import Worst

LIMITED = {  # by kind: bounded attribute of a motion, unit for rotational joints, unit for prismatic joints
    "position": ("q", "rad", "m"),
    "velocity": ("velocity_bounds", "rad/s", "m/s"),  # for a spline, Bernstein coefficients at midpoints
    "acceleration": ("ddq", "rad/s²", "m/s²"),
    "jerk": ("jerk", "rad/s³", "m/s³"),
    "torque": ("torque", "N m", "N"),
    "power": ("power", "W", "W"),
}


def excesses(task: Any, motion: MeasuredMotion) -> Iterator[tuple[str, float, Worst | None, str]]:
    """Yield (subject, worst excess as a share of its range, its place or None, fault) of every limit."""
    for kind, values, limits, size in joint_limits(task, motion):
        units = LIMITED[kind][1:]
        yield f"{kind} limits", *worst_joint(motion.model, kind, motion.time[0], values, limits, size, units), ""
    if task.obstacles:
        instant = int(motion.clearance.argmin())
        smallest, limit = float(motion.clearance[0, instant]), float(task.min_clearance)
        pair = nearest_pair(task.obstacles, motion.links[0, instant], motion.link_radius)
        time = float(motion.time[0, instant])
        place = Worst(what="clearance", joint=pair, time=time, value=smallest, limit=limit, unit="m")
        excess = float(task.min_clearance - smallest) / clearance_range(task, motion.model)
        yield "clearance at samples", excess, place, ""
    for each in task.constraints:
        # An integral may have kinks, and is then limited on the spline: the smaller excess of spline and curve counts.
        name, motions = f"constraint {each.name}", (motion, motion.spline) if each.form == "integral" else (motion,)
        try:
            if each.form == "peak":
                values = np.asarray(each.function(motion), dtype=float)
                beyond = np.maximum(values - each.upper, each.lower - values).reshape(-1)
                instant = int(np.argmax(np.where(np.isnan(beyond), np.inf, beyond)))
                value, time = float(values.reshape(-1)[instant]), float(motion.time[0, instant])
            else:
                every = [form_value(each.form, each.function(one), one, maximise=False) for one in motions]
                shares = [max(one - each.upper, each.lower - one) for one in every]
                value, time = every[shares.index(min(shares))], np.nan
        except Exception as fault:  # a user's function may raise anything
            yield name, np.nan, None, f"its function fails here: {first_line(fault)}"
            continue
        limit = float(each.upper if value - each.upper >= each.lower - value else each.lower)
        excess = max(value - each.upper, each.lower - value) / float(each.scale)
        worst = Worst(what=each.name, time=time, value=value, limit=limit, unit=each.unit)
        yield name, excess if np.isfinite(value) else float("nan"), worst, ""


def worst_joint(
    model: ArmModel,
    what: str,
    time: np.ndarray,
    values: np.ndarray,
    limits: np.ndarray,
    size: np.ndarray,
    units: tuple[str, str] = ("", ""),
) -> tuple[float, Worst]:
    """Return the largest excess of values (time, dof) over limits, as a share of ``size``, and its place."""
    limits = np.broadcast_to(limits, (*values.shape, 2))
    share = limit_shares(values, limits, size)
    instant, joint = np.unravel_index(int(share.argmax()), share.shape)
    value, (low, high) = float(values[instant, joint]), limits[instant, joint]
    return float(share[instant, joint]), Worst(
        what=what,
        joint=model.arm.joint_names[joint],
        time=float(time[instant]),
        value=value,
        limit=float(high if value - high >= low - value else low),
        unit=units[0 if model.turning[joint] else 1],
    )


def limit_shares(values: np.ndarray, limits: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the excesses over limits (..., 2), as shares of ``size``; −inf without a limit."""
    return np.asarray(np.maximum(values - limits[..., 1], limits[..., 0] - values) / size)


def joint_limits(task: Any, motion: MeasuredMotion) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield each kind of limit with values (time, dof), limits (time, dof, 2) and ranges (time, dof).

    A range is the width of limits, the size of a single one, or a usual size for an arm.
    """
    model, duration = motion.model, float(np.ptp(motion.time))
    force = sum(float(body.mass) for body in model.arm.bodies)
    force *= model.length / duration**2 + float(np.linalg.norm(model.arm.gravity))
    work = force * model.length or 1.0
    usual = {
        "position": model.scales,
        "velocity": model.scales / duration,
        "acceleration": model.scales / duration**2,
        "jerk": model.scales / duration**3,
        "torque": work / model.scales,
        "power": np.full(model.dof, work / duration),
    }
    for kind, bounds in task.bounds.items():
        limits = limits_at(bounds, np.asarray(task.times), motion.time[0])
        lower, upper = limits[..., 0], limits[..., 1]
        with np.errstate(invalid="ignore"):
            width = upper - lower
        one = np.where(np.isfinite(upper), np.abs(upper), np.where(np.isfinite(lower), np.abs(lower), 0.0))
        size = np.where(np.isfinite(width), width, one)
        yield kind, getattr(motion, LIMITED[kind][0])[0], limits, np.where(size > 0, size, usual[kind])


def limits_at(bounds: np.ndarray, samples: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return limits (time, dof, 2) at times, linear between those (1 or time, dof, 2) of samples."""
    if len(bounds) == 1:
        return np.broadcast_to(bounds, (len(t), *bounds.shape[1:]))
    if len(bounds) == len(t) and np.array_equal(samples, t):
        return np.asarray(bounds)
    after = np.clip(np.searchsorted(samples, t), 0, len(samples) - 1)
    exact = np.isclose(samples[after], t, rtol=0, atol=1e-12)
    limits = np.empty((len(t), *bounds.shape[1:]))
    for joint in range(bounds.shape[1]):
        for side, none in enumerate((-np.inf, np.inf)):
            column = bounds[:, joint, side]
            finite = np.isfinite(column)
            between = np.interp(t, samples, np.where(finite, column, 0.0))
            bounded = finite[after] & (exact | finite[np.maximum(after - 1, 0)])  # finite at both ends of an interval
            limits[:, joint, side] = np.where(bounded, between, none)
    return limits


def clearance_range(task: Any, model: ArmModel) -> float:
    """Return the scale of clearance violations [m]: the required clearance, at least 1 % of the arm's length."""
    return max(float(task.min_clearance), 0.01 * model.length)
