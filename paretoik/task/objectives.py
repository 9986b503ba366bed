"""Objectives: NumPy functions of a batch of motions, the library's and users'."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args

import numpy as np

from paretoik.arrays import Values
from paretoik.errors import InvalidInput
from paretoik.inputs import (
    cause_of,
    check_choice,
    check_flag,
    check_function,
    check_text,
    function_name,
    limited_call,
    user_function,
)
from paretoik.tables import html_representation
from paretoik.task.motion import Motion
from paretoik.task.traced_motion import has_kinks

Form = Literal["integral", "peak", "terminal", "general"]
Function = Callable[[Motion], np.ndarray]
if TYPE_CHECKING:
    AnyMotion: TypeAlias = Motion
    AnyValues: TypeAlias = np.ndarray
else:
    AnyMotion = AnyValues = Any  # for derivatives: a TracedMotion, and traced arrays


@dataclass(frozen=True, kw_only=True, eq=False)
class Objective:
    """A named function of motions with its unit, made with ``@objective``.

    function: function of a motion
    name: name of the objective
    unit: unit of its value
    form: "integral", "peak", "terminal" or "general", see ``objective``
    maximise: whether larger values are better
    """

    function: Function
    name: str
    unit: str
    form: Form
    maximise: bool = False

    def __post_init__(self) -> None:
        """Take over the function's docstring, for ``help``."""
        object.__setattr__(self, "__doc__", inspect.getdoc(self.function) or f"{self!r}.")

    def __call__(self, motion: Motion) -> Values:
        """Return the objective's values (*batch,), in the user's own sign.

        Raises InvalidInput for values of another shape or type, EvaluationFailed if the function raises.
        """
        name = f"objective {self.name}"
        if not hasattr(motion, "q"):
            raise InvalidInput(f"{name} must get a Motion, got {type(motion).__name__}")
        if self.form == "integral":
            return evaluate_integral(name, self, motion)
        values = evaluate_function(name, self.function, motion.instants, self.form)
        if self.form == "peak":
            return np.asarray(values.min(axis=-1) if self.maximise else values.max(axis=-1))
        return values

    def __repr__(self) -> str:
        direction = ", maximised" if self.maximise else ""
        unit = f" [{self.unit}]" if self.unit else ""
        return f"Objective {self.name}{unit}, {self.form}{direction}"

    _repr_html_ = html_representation

    @property
    def sign(self) -> float:
        """−1 if the objective is maximised, else 1: sign · value is minimised."""
        return -1.0 if self.maximise else 1.0


def objective(
    *, unit: str, form: Form, maximise: bool = False, name: str | None = None
) -> Callable[[Function], Objective]:
    """Return a decorator that makes an objective of a function of motions.

    unit: unit of the objective's value
    form: "integral" for values (*batch, time) that are integrated over time; "peak" for values (*batch, time) whose
        largest counts (the smallest if maximised); "terminal" for values (*batch,) that depend only on the ends of the
        motion; "general" for values (*batch,) that depend on all of it
    maximise: True if larger values are better; fronts show values in the user's own sign
    name: name of the objective, None for the function's

    The function must return real numbers of the form's shape, not change its input (arrays are read-only) and work for
    any batch.

    Raises InvalidInput for an unknown form, or names and units that are not printable text.

    >>> @objective(unit="rad²/s", form="integral")
    ... def wrist_effort(motion):
    ...     return motion.dq[..., -1] ** 2
    >>> wrist_effort
    Objective wrist_effort [rad²/s], integral
    """
    check_choice("form", form, get_args(Form))
    check_flag("maximise", maximise)
    for label, text in (("unit", unit), ("name", "" if name is None else name)):
        check_text(label, text)

    def wrap(function: Function) -> Objective:
        check_function("objective", function)
        label = name or function_name(function)
        return Objective(function=function, name=label, unit=unit, form=form, maximise=maximise)

    return wrap


def evaluate_function(name: str, function: Function, motion: Motion, form: Form) -> np.ndarray:
    """Return a function's checked values; errors begin with ``name``.

    Raises EvaluationFailed if the function raises, InvalidInput for values of another shape or type.
    """
    of_times = form in ("integral", "peak")
    shape = motion.q.shape[:-1] if of_times else motion.q.shape[:-2]
    wish = f"({form}) must return shape {'(*batch, time)' if of_times else '(*batch,)'}, here {shape}"
    with user_function(name), limited_call(name):
        values = function(motion)
    if values is None:
        raise InvalidInput(f"{name} {wish}, got None (is a return missing?)")
    try:
        array = np.asarray(values)
    except ValueError:
        raise InvalidInput(f"{name} {wish}, got rows of unequal length") from None
    except Exception as error:  # a foreign array may raise anything
        raise InvalidInput(f"{name} {wish}, got {cause_of(error)}") from None
    if np.ma.is_masked(values):
        raise InvalidInput(f"{name} must return real numbers, got masked ones")
    if array.dtype.kind not in "fiub":
        raise InvalidInput(f"{name} must return real numbers, got {array.dtype}")
    if array.shape != shape:
        count = int(np.prod(motion.q.shape[:-2]))
        each = "the motion" if motion.q.ndim == 2 else f"each of {count} motion{'s' * (count != 1)}"
        if of_times:
            between = motion.differences == "spline" and motion.derivatives is not None
            each = f"each of {motion.q.shape[-2]} times{' (samples and between them)' * between} of {each}"
        raise InvalidInput(
            f"{name} {wish}, got {array.shape}; return a value for {each}; arrays of motions are (*batch, time, "
            "joints), so that dq[..., 0] is of the first joint"
        )
    return array.astype(float)


def evaluate_integral(name: str, term: Any, motion: Motion) -> np.ndarray:
    """Return the integrals (*batch,) of a function, on ``of_spline`` if it has kinks."""
    instants = motion.instants
    if motion.differences == "spline" and has_kinks(
        term, motion.arm, motion.tasks, motion.obstacles, motion.link_radius
    ):
        instants = motion.of_spline
    return instants.integral(evaluate_function(name, term.function, instants, "integral"))


@objective(unit="J s", form="integral")
def kinetic_energy(motion: AnyMotion) -> AnyValues:
    """∫ ½ q̇ᵀ M q̇ dt. Source: Tringali & Cocuzza 2020, Eq. 3."""
    return motion.kinetic_energy


@objective(unit="N²m²s", form="integral")
def torque_norm(motion: AnyMotion) -> AnyValues:
    """∫ τᵀτ dt. Source: Tringali & Cocuzza 2020, Eq. 5."""
    return np.sum(motion.torque**2, axis=-1)


@objective(unit="J", form="integral")
def mechanical_energy(motion: AnyMotion) -> AnyValues:
    """∫ Σ |τᵢ q̇ᵢ| dt: work done and absorbed, without recovery of energy."""
    return np.sum(np.abs(motion.power), axis=-1)


@objective(unit="rad", form="integral")
def joint_travel(motion: AnyMotion) -> AnyValues:
    """∫ Σ |q̇ᵢ| dt: the distance that all joints travel (prismatic joints in m)."""
    return np.sum(np.abs(motion.dq), axis=-1)


@objective(unit="rad", form="terminal")
def joint_drift(motion: AnyMotion) -> AnyValues:
    """‖q_N − q₀‖ / dof. Source: Marcos et al. 2012, Eq. 25."""
    return np.linalg.norm(motion.q[..., -1, :] - motion.q[..., 0, :], axis=-1) / motion.arm.dof


@objective(unit="", form="integral")
def joint_limit_distance(motion: AnyMotion) -> AnyValues:
    """Mean over time of 1/(2 dof) Σ ((qᵢ − mid)/(upper − lower))².

    Source: Liégeois 1977; Tringali & Cocuzza 2020, Eq. 14. Only joints with two different limits count. Raises
    InvalidInput if no joint has such limits.
    """
    limited, lower, upper = _limited_joints("joint_limit_distance", "position", *motion.arm.position_limits.T)
    ratio = (motion.q[..., limited] - (lower + upper) / 2) / (upper - lower)
    return np.sum(ratio**2, axis=-1) / (2 * motion.arm.dof) / motion.duration[..., None]


@objective(unit="s", form="integral")
def joint_limit_nearness(motion: AnyMotion) -> AnyValues:
    """∫ Σ (upper − lower)²/(4 (upper − qᵢ)(qᵢ − lower)) dt.

    The integrand is 1 for each joint in the middle of its range, and infinite at a limit.

    Source: Chan & Dubey 1995; Wan et al. 2018, Eq. 11. Joints without limits at both ends do not count; the
    distance to a limit counts as at least 0.1 % of the range. Raises InvalidInput if no joint has such limits.
    """
    return _nearness("joint_limit_nearness", "position", motion.q, *motion.arm.position_limits.T)


@objective(unit="s", form="integral")
def velocity_limit_nearness(motion: AnyMotion) -> AnyValues:
    """As ``joint_limit_nearness``, for velocities. Source: Wan et al. 2018, Eq. 36."""
    limits = motion.arm.velocity_limits
    return _nearness("velocity_limit_nearness", "velocity", motion.dq, -limits, limits)


@objective(unit="", form="integral", maximise=True)
def manipulability(motion: AnyMotion) -> AnyValues:
    """Mean over time of √det(J Jᵀ), the tasks' manipulability; maximised.

    J is the Jacobian of the tasks. Source: Yoshikawa 1985.
    """
    return motion.manipulability / motion.duration[..., None]


@objective(unit="rad/s", form="peak")
def peak_velocity(motion: AnyMotion) -> AnyValues:
    """Largest joint speed (prismatic joints in m/s), also between the samples of a spline."""
    return np.max(np.maximum(np.abs(motion.dq), np.abs(motion.velocity_bounds)), axis=-1)


@objective(unit="N m", form="peak")
def peak_torque(motion: AnyMotion) -> AnyValues:
    """Largest joint torque (prismatic joints in N)."""
    return np.max(np.abs(motion.torque), axis=-1)


@objective(unit="rad²/s⁵", form="integral")
def jerk(motion: AnyMotion) -> AnyValues:
    """∫ ‖d³q/dt³‖² dt."""
    return np.sum(motion.jerk**2, axis=-1)


@objective(unit="m", form="peak", maximise=True)
def obstacle_clearance(motion: AnyMotion) -> AnyValues:
    """Smallest distance between links and obstacles, negative inside; maximised.

    Raises InvalidInput if the problem has no obstacles.
    """
    if not motion.obstacles:
        raise InvalidInput(
            "obstacle_clearance must have obstacles, got a problem without any (Tracking(..., obstacles=[...]))"
        )
    return motion.clearance


def _nearness(name: str, kind: str, values: Any, lower: np.ndarray, upper: np.ndarray) -> AnyValues:
    limited, lower, upper = _limited_joints(name, kind, lower, upper)
    edge = 1e-3 * (upper - lower)  # smallest distance to a limit that counts
    inside = np.clip(values[..., limited], lower + edge, upper - edge)
    return np.sum((upper - lower) ** 2 / (4 * (upper - inside) * (inside - lower)), axis=-1)


def _limited_joints(
    name: str, kind: str, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which joints have two different limits, and these limits. Raises InvalidInput if none has."""
    limited = np.isfinite(upper - lower) & (upper > lower)
    if not limited.any():
        raise InvalidInput(f"{name} must have {kind} limits at both ends, got an arm without any")
    return limited, lower[limited], upper[limited]
