"""The library's objectives from their definitions, on motions measured again; a user's by their own functions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.measured_motion import MeasuredMotion, nearest_pair
from paretoik.verification.run_contents import Worst, first_line

LIBRARY = "paretoik.task.objectives"  # defines the library's own objectives


def objective_value(objective: Any, motion: MeasuredMotion) -> float:
    """Return an objective of a motion, in its own sign."""
    return form_value(objective.form, objective_function(objective)(motion), motion, maximise=objective.maximise)


def stated_value(objective: Any, motion: MeasuredMotion, stated: float) -> float:
    """Return an objective of a motion, in its own sign, as a table states it.

    Integrals with kinks are stated for the spline before its projection onto the path. A user's integral may have
    kinks: of both values, the one nearer to ``stated`` counts.
    """
    name, value = _library_name(objective), objective_value(objective, motion)
    if objective.form != "integral" or (name and name not in KINKED_INTEGRALS):
        return value
    of_spline = objective_value(objective, motion.spline)
    return min((of_spline,) if name else (value, of_spline), key=lambda each: abs(each - stated))


def objective_size(entry: Mapping[str, Any], value: float) -> float:
    """Return the size of an objective: its value, or the range of its entry in `run.json` if that is larger."""
    low, high = entry.get("range", (0.0, 0.0))
    return max(abs(value), abs(float(high) - float(low)), 1e-12)


def objective_function(objective: Any) -> Callable[[Any], Any]:
    """Return an objective's function: the definition below for the library's own, else the user's."""
    return DEFINITIONS.get(_library_name(objective), objective.function)


def _library_name(objective: Any) -> str:
    """Return the name of one of the library's own objectives; "" for a user's."""
    own = getattr(objective.function, "__module__", None) == LIBRARY
    return str(objective.function.__name__) if own else ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """A function as a weighted sum of terms, or the largest of them, each the largest of its ``pieces``.

    ``pieces`` (pieces, terms) are smooth if the function is a library's own. ``instants`` (terms,) are those of the
    terms, −1 for the whole motion. ``weights`` (terms,) are None if the largest term counts.
    """

    pieces: np.ndarray
    instants: np.ndarray
    weights: np.ndarray | None


def is_own_integral(objective: Any) -> bool:
    """Return whether an objective is a user's integral: it may have kinks."""
    return bool(objective.form == "integral") and not _library_name(objective)


def objective_terms(objective: Any, motion: MeasuredMotion, factor: float, *, own_kinks: bool = False) -> Terms:
    """Return an objective times a factor, which is negative if it is maximised, as terms to minimise.

    Integrals with kinks are those of the spline; users' too if ``own_kinks`` says that they have kinks.
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
    """Return the objective that a function's values give in its form."""
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


# Limits of a motion, as shares of their ranges.


LIMITED = {  # by kind: the bounded attribute of a motion, its unit for joints that turn, and for those that slide
    "position": ("q", "rad", "m"),
    "velocity": ("velocity_bounds", "rad/s", "m/s"),  # for a spline Bernstein points at the middles of intervals
    "acceleration": ("ddq", "rad/s²", "m/s²"),
    "jerk": ("jerk", "rad/s³", "m/s³"),
    "torque": ("torque", "N m", "N"),
    "power": ("power", "W", "W"),
}


def excesses(task: Any, motion: MeasuredMotion) -> Iterator[tuple[str, float, Worst | None, str]]:
    """Yield every limit's subject, worst excess as a share of its range, and place, or why these are unknown."""
    for kind, values, limits, size in joint_limits(task, motion):
        units = LIMITED[kind][1:]
        yield f"{kind} limits", *worst_joint(motion.model, kind, motion.time[0], values, limits, size, units), ""
    if task.obstacles:
        instant = int(motion.clearance.argmin())
        smallest, limit = float(motion.clearance[0, instant]), float(task.min_clearance)
        pair, time = nearest_pair(task.obstacles, motion.links[0, instant]), float(motion.time[0, instant])
        place = Worst(what="clearance", joint=pair, time=time, value=smallest, limit=limit, unit="m")
        excess = float(task.min_clearance - smallest) / clearance_range(task, motion.model)
        yield "clearance at samples", excess, place, ""
    for each in task.constraints:
        try:
            yield f"constraint {each.name}", *_worst_of_constraint(each, motion), ""
        except Exception as fault:  # a user's function may raise anything
            yield f"constraint {each.name}", np.nan, None, f"its function fails here: {first_line(fault)}"


def worst_joint(
    model: ArmModel,
    what: str,
    time: np.ndarray,
    values: np.ndarray,
    limits: np.ndarray,
    size: np.ndarray,
    units: tuple[str, str] = ("", ""),
) -> tuple[float, Worst]:
    """Return the excess, as a share of ``size``, and place of the value (time, dof) farthest beyond its limits."""
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
    """Return how much limits (..., 2) are exceeded, as shares of ``size``; −inf without a limit."""
    return np.asarray(np.maximum(values - limits[..., 1], limits[..., 0] - values) / size)


def joint_limits(task: Any, motion: MeasuredMotion) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield for each kind of limit the bounded values (time, dof), limits (time, dof, 2) and ranges (time, dof).

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
    """Return limits (1 or time, dof, 2) at times (time, dof, 2), linear between the samples."""
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
            bounded = finite[after] & (exact | finite[np.maximum(after - 1, 0)])  # at both ends of an interval
            limits[:, joint, side] = np.where(bounded, between, none)
    return limits


def clearance_range(task: Any, model: ArmModel) -> float:
    """Return the scale of violations of clearance [m]: its limit, at least 1 % of the arm's length."""
    return max(float(task.min_clearance), 0.01 * model.length)


def _worst_of_constraint(constraint: Any, motion: MeasuredMotion) -> tuple[float, Worst]:
    """Return the excess of a user's own limit, as a share of its scale, and its place.

    An integral may have kinks, and is then limited on the spline: the smaller excess of spline and curve counts.
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
