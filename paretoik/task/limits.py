"""Limits on joints, and constraints that users define."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, get_args

import numpy as np
from jaxtyping import Bool, Float

from paretoik.errors import InvalidInput, warn_user
from paretoik.inputs import (
    check_choice,
    check_function,
    check_magnitude,
    check_size,
    check_text,
    degrees_hint,
    finite_number,
    function_name,
    likely_spelling,
    listed,
    positive_number,
    real_array,
    real_number,
    shown,
)
from paretoik.robot.arm import Arm, check_arm
from paretoik.robot.kinematics import characteristic_length, joint_scales
from paretoik.tables import represented
from paretoik.task.motion import Motion
from paretoik.task.objectives import Form, Function, evaluate_function, evaluate_integral

LIMIT_TOLERANCE = 1e-9  # share of a limit or its range that counts as rounding


class LimitKind(NamedTuple):
    """A kind of joint limit.

    values: field of ``Motion`` that it bounds
    units: unit for rotational joints, unit for prismatic joints
    declared: field of ``Arm`` with the arm's own limits, "" if an arm has none
    """

    values: str
    units: tuple[str, str]
    declared: str


LIMIT_KINDS = {
    "position": LimitKind("q", ("rad", "m"), "position_limits"),
    "velocity": LimitKind("dq", ("rad/s", "m/s"), "velocity_limits"),
    "acceleration": LimitKind("ddq", ("rad/s²", "m/s²"), "acceleration_limits"),
    "torque": LimitKind("torque", ("N m", "N"), "torque_limits"),
    "power": LimitKind("power", ("W", "W"), ""),
}
LIMITED = {kind: each.values for kind, each in LIMIT_KINDS.items()}
JOINT_UNITS = {kind: each.units for kind, each in LIMIT_KINDS.items()}
Bounds = Float[np.ndarray, "#time dof 2"]


def joint_units(arm: Arm, units: tuple[str, str]) -> str:
    """Return the unit of an arm's joints: that of its revolute joints, of its prismatic ones, or both."""
    (turning, straight), sliding = units, is_sliding(arm)
    return " or ".join(dict.fromkeys([turning] * bool((~sliding).any()) + [straight] * bool(sliding.any())))


def is_sliding(arm: Arm) -> Bool[np.ndarray, " dof"]:
    """Return which joints are prismatic."""
    return np.array([kind == "prismatic" for kind in arm.joint_types])


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class Limits:
    """Limits on joint position, velocity, acceleration, torque and power |τᵢ q̇ᵢ|.

    position, velocity, acceleration: joint limits [rad or m, per s, per s²]
    torque: joint torques [N m], forces [N] of prismatic joints
    power: mechanical power |τᵢ q̇ᵢ| of each joint [W]
    clearance: smallest distance from obstacles [m], if the problem has any
    margin: fraction of its range by which every joint limit moves inwards, at least 0 and less than 0.5

    A joint limit is a tuple (lower, upper), or a symmetric number or array: (dof,), or (time, dof) if it varies along
    the path. A mapping names joints; the others keep the arm's own limits. None takes the arm's own limit if there is
    one, np.inf means no limit. Refined motions of splines satisfy their limits at any time without a margin; other
    motions satisfy them at their samples, and may exceed them a little in between.

    Raises InvalidInput, with the limit's name, for impossible limits. Position limits of more than two turns on a
    rotational joint give a warning, because they are probably in degrees.

    >>> Limits(position=np.deg2rad([90, 120, 120]), velocity=3.8).velocity
    3.8
    """

    position: object = None
    velocity: object = None
    acceleration: object = None
    torque: object = None
    power: object = None
    clearance: float = 0.0
    margin: float = 0.0

    def __post_init__(self) -> None:
        for kind in LIMIT_KINDS:
            # the error names the impossible limit
            name = f"{kind} limit"
            limit = getattr(self, kind)
            if isinstance(limit, Mapping):
                for joint, value in limit.items():
                    _sides(f"{name} of {joint if isinstance(joint, str) else shown(joint)}", value)
            elif limit is not None:
                for side in limit if isinstance(limit, tuple) and len(limit) == 2 else (limit,):
                    values = real_array(name, side)
                    if values.size == 0 or values.ndim > 2:
                        raise InvalidInput(
                            f"{name} must be one number, one per joint or (samples, joints), got shape {values.shape}"
                        )
                    if np.isnan(values).any():
                        joint = f" of joint {np.argwhere(np.isnan(values))[0][-1] + 1}" if values.ndim else ""
                        raise InvalidInput(f"{name}{joint} must be lower ≤ upper, got nan")
                    check_magnitude(name, values, "")
        finite_number("clearance limit", self.clearance)
        if not 0 <= finite_number("margin", self.margin) < 0.5:
            raise InvalidInput(f"margin must be a fraction of at least 0 and less than 0.5, got {shown(self.margin)}")

    def bounds(self, arm: Arm, samples: int) -> dict[str, Bounds]:
        """Return the limits that have a finite side, by kind.

        Each is an array (1 or time, dof, 2) of (lower, upper).

        Raises InvalidInput, naming limit and joint, for wrong shapes, NaN, or a lower limit above the upper.
        """
        check_arm("arm", arm)
        check_size("samples", samples, 1)
        every = {kind: _bounds(kind, getattr(self, kind), arm, samples) for kind in LIMIT_KINDS}
        for j in np.flatnonzero(arm.periodic) if self.position is not None else ():
            own = every["position"][:, j] == arm.position_limits[j]
            if hint := degrees_hint(every["position"][:, j][~own]):
                warn_user(f"position limit of {arm.joint_names[j]}: {hint}; np.inf means no limit")
                break
        inwards = self.margin * np.array([1.0, -1.0])
        return {
            kind: bounds + inwards * limit_ranges(bounds[..., 0], bounds[..., 1])[..., None] if self.margin else bounds
            for kind, bounds in every.items()
            if np.isfinite(bounds).any()
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Constraint:
    """A user's limit on a function of motions, made with ``@constraint``."""

    function: Function
    name: str
    unit: str
    form: Form
    lower: float
    upper: float
    scale: float

    def violation(self, motion: Motion) -> np.ndarray:
        """Return the largest violation (*batch,) divided by ``scale``, at most 0 if satisfied."""
        shares = self.shares(motion.instants)
        return np.asarray(shares.max(axis=-1) if self.form == "peak" else shares)

    def shares(self, motion: Motion) -> np.ndarray:
        """Return violations divided by ``scale``; one per instant if the form is "peak".

        Raises InvalidInput and EvaluationFailed as objectives do.
        """
        name = f"constraint {self.name}"
        if self.form == "integral":
            values = evaluate_integral(name, self, motion)
        else:
            values = evaluate_function(name, self.function, motion, self.form)
        return np.asarray(np.maximum(values - self.upper, self.lower - values) / self.scale)


def constraint(
    *,
    unit: str,
    form: Form = "peak",
    lower: float = -np.inf,
    upper: float = np.inf,
    scale: float | None = None,
    name: str | None = None,
) -> Callable[[Function], Constraint]:
    """Return a decorator that makes a limit lower ≤ function(motion) ≤ upper.

    unit: unit of the function's value
    form: "peak" for a limit at every sample; other forms as for objectives
    lower, upper: bounds, at least one of them finite
    scale: divisor of violations; None for upper − lower, or the size of the only bound, or 1 if that is zero
    name: name of the constraint, None for the function's

    Raises InvalidInput for an unknown form, no bound, or lower > upper.

    >>> @constraint(unit="m", lower=0.0)
    ... def above_table(motion):
    ...     return motion.tool[..., 2]
    >>> above_table.scale
    1.0
    """
    check_choice("form", form, get_args(Form))
    for key, text in (("unit", unit), ("name", "" if name is None else name)):
        check_text(key, text)
    lower, upper = real_number("lower", lower), real_number("upper", upper)
    if scale is not None:
        scale = positive_number("scale", scale, unit)
    if not lower <= upper or not (np.isfinite(lower) or np.isfinite(upper)):
        raise InvalidInput(f"constraint must have at least one finite bound and lower ≤ upper, got {lower} and {upper}")
    width = upper - lower if np.isfinite(upper - lower) else abs(upper if np.isfinite(upper) else lower)
    size = scale or width or 1.0

    def wrap(function: Function) -> Constraint:
        check_function("constraint", function)
        label = name or function_name(function, f"lambda in [{lower:g}, {upper:g}] {unit}".rstrip())
        return Constraint(function=function, name=label, unit=unit, form=form, lower=lower, upper=upper, scale=size)

    return wrap


def relative_violation(kind: str, bounds: Bounds, motion: Motion) -> Float[np.ndarray, "*batch time dof"]:
    """Return the violation of a joint limit as a share of its range, at each sample; at most 0 if satisfied."""
    lower, upper = bounds[..., 0], bounds[..., 1]
    values = getattr(motion, LIMITED[kind])
    if kind == "velocity" and motion.derivatives is not None:
        values = motion.derivatives.velocity_bounds
    usual = usual_ranges(kind, motion.arm, float(np.ptp(motion.time)))
    return np.maximum(values - upper, lower - values) / limit_ranges(lower, upper, usual)


def limit_ranges(lower: np.ndarray, upper: np.ndarray, usual: np.ndarray | float = 1.0) -> np.ndarray:
    """Return the widths of limits, or the size of the only finite bound; ``usual`` if this is 0."""
    width = upper - lower
    one_sided = np.where(np.isfinite(upper), np.abs(upper), np.abs(lower))
    size = np.where(np.isfinite(width), width, np.where(np.isfinite(one_sided), one_sided, 0.0))
    return np.where(size > 0, size, usual)


def usual_ranges(kind: str, arm: Arm, duration: float) -> Float[np.ndarray, " dof"]:
    """Return the usual size of values of a kind.

    It is the range of limits that have no range of their own, such as a single bound of 0. For positions it is 1 rad or
    the arm's length; for velocities and accelerations this is divided by the duration or its square. The usual torque
    accelerates the arm by its length per squared duration and holds it against gravity; it is 1 N m without masses.
    """
    joint, length = joint_scales(arm), characteristic_length(arm)
    weight = sum(body.mass for body in arm.bodies) * (length / duration**2 + float(np.linalg.norm(arm.gravity)))
    work = weight * length or 1.0
    return {
        "position": joint,
        "velocity": joint / duration,
        "acceleration": joint / duration**2,
        "torque": work / joint,
        "power": np.full(arm.dof, work / duration),
    }[kind]


def position_ranges(arm: Arm, limits: Float[np.ndarray, "*times dof 2"]) -> Float[np.ndarray, "*times dof"]:
    """Return the ranges [rad, m] between position limits, inf without limits.

    If there is only one limit, the range is a whole turn or the arm's length.
    """
    span = limits[..., 1] - limits[..., 0]
    one_sided = np.isfinite(limits).any(axis=-1) & np.isinf(span)
    return np.where(one_sided, np.where(arm.periodic, 2 * np.pi, joint_scales(arm)), span)


def _sides(name: str, value: object) -> tuple[float, float]:
    """Return (lower, upper) of one joint's limit, given as such a tuple or a symmetric number. Raises InvalidInput."""
    if isinstance(value, tuple) and len(value) == 2:
        low, high = real_number(name, value[0]), real_number(name, value[1])
    else:
        high = real_number(name, value)
        low = -high
    check_magnitude(name, (low, high), "")
    return low, high


def _bounds(kind: str, limit: object, arm: Arm, samples: int) -> Bounds:
    """Return limits of a kind (1 or time, dof, 2); joints without a given limit have the arm's own."""
    if limit is None or isinstance(limit, Mapping):
        declared = LIMIT_KINDS[kind].declared
        own = getattr(arm, declared) if declared else None
        own = np.full(arm.dof, np.inf) if own is None else own
        bounds = own.copy() if own.ndim == 2 else np.stack([-own, own], axis=-1)
        for joint, value in (limit or {}).items():
            if joint not in arm.joint_names:
                hint = likely_spelling(joint, arm.joint_names)
                wish = f"must name joints among {listed(arm.joint_names)}"
                raise InvalidInput(f"{kind} limit {wish}, got {shown(joint)}{hint}")
            sides = _sides(f"{kind} limit of {joint}", value)
            if not sides[0] <= sides[1]:
                raise InvalidInput(f"{kind} limit of {joint} must be lower ≤ upper, got {sides[0]} and {sides[1]}")
            bounds[arm.joint_names.index(joint)] = sides
        return bounds[None]
    arrays = list[np.ndarray]()
    for side in limit if isinstance(limit, tuple) and len(limit) == 2 else (limit,):
        array = real_array(f"{kind} limit", side)
        if array.shape not in ((), (arm.dof,), (samples, arm.dof)):
            raise InvalidInput(
                f"{kind} limit must be one number, {arm.dof} (one per joint) or an array ({samples}, {arm.dof}), got "
                f"shape {array.shape}; a lower and an upper limit are a tuple (lower, upper) of these, such as "
                "tuple(arm.position_limits.T)"
            )
        arrays.append(np.broadcast_to(array, (samples if array.ndim == 2 else 1, arm.dof)))
    low, high = np.broadcast_arrays(arrays[0] if len(arrays) == 2 else -arrays[0], arrays[-1])
    for sample, joint in np.argwhere(~(low <= high)):
        raise InvalidInput(
            f"{kind} limit of {arm.joint_names[joint]} must be lower ≤ upper, got {low[sample, joint]} and "
            f"{high[sample, joint]}"
        )
    return np.stack([low, high], axis=-1)
