"""Objectives of a control step: the paper's, users', and the library's.

A step objective is a plain NumPy function of a batch of ``Step``; it returns one value per step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.inputs import check_flag, check_function, check_text, function_name, shown
from paretoik.tables import html_representation
from paretoik.task.motion import Motion
from paretoik.task.objectives import Objective

if TYPE_CHECKING:
    MotionLike: TypeAlias = Motion
    Numbers: TypeAlias = np.ndarray
else:
    MotionLike = Numbers = Any  # expressions in and out if traced


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """A batch of steps (..., time): the last samples up to each step's end.

    motion: positions, rates, torques and the other fields of a ``Motion``
    home: joint positions (dof,) in which the loop began
    position_error: distance of the tool from its target (..., time, axes) [m]
    rotation_error: rotation of the tool away from its target (..., time, axes) [rad]
    dt: time between steps [s]
    """

    motion: MotionLike
    home: Numbers
    position_error: Numbers
    rotation_error: Numbers
    dt: float


Function = Callable[[Step], Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class StepObjective:
    """A named function of steps with its unit; made with ``@step_objective``."""

    function: Function
    name: str
    unit: str
    maximise: bool = False

    def __repr__(self) -> str:
        return f"StepObjective {self.name} [{self.unit}]{', maximised' if self.maximise else ''}"

    _repr_html_ = html_representation

    @property
    def sign(self) -> float:
        """−1 if the objective is maximised, so that sign · value is always minimised."""
        return -1.0 if self.maximise else 1.0


def step_objective(
    *, unit: str, maximise: bool = False, name: str | None = None
) -> Callable[[Function], StepObjective]:
    """Return a decorator that makes an objective of a function of steps.

    Raises InvalidInput unless name and unit are printable text.

    >>> @step_objective(unit="rad")
    ... def wrist_drift(step):
    ...     return np.abs(step.motion.q[..., -1] - step.home[..., -1])
    >>> wrist_drift
    StepObjective wrist_drift [rad]
    """
    check_flag("maximise", maximise)
    for label, text in (("unit", unit), ("name", "" if name is None else name)):
        check_text(label, text)

    def wrap(function: Function) -> StepObjective:
        check_function("step_objective", function)
        return StepObjective(function=function, name=name or function_name(function), unit=unit, maximise=maximise)

    return wrap


@step_objective(unit="rad²/s²")
def joint_displacement(step: Step) -> Numbers:
    """‖q̇‖² + ‖(q − q₀) / Δt‖². Source: Marcos et al. 2012, Eq. 17."""
    drift = (step.motion.q - step.home) / step.dt
    return np.sum(step.motion.dq**2, axis=-1) + np.sum(drift**2, axis=-1)  # Eq. 17


@step_objective(unit="m")
def position_error(step: Step) -> Numbers:
    """Distance of the tool from its target. Source: Marcos et al. 2012, Eq. 18."""
    return np.sqrt(np.sum(step.position_error**2, axis=-1))


@step_objective(unit="rad")
def rotation_error(step: Step) -> Numbers:
    """Angle by which the tool is turned away from its target."""
    return np.sqrt(np.sum(step.rotation_error**2, axis=-1))


def as_step_objective(objective: StepObjective | Objective) -> StepObjective:
    """Return an objective of motions as one of steps.

    Its value is the integrand, or the peak's series, at the step's end. Raises InvalidInput for anything else, and for
    objectives of a whole motion.
    """
    if isinstance(objective, StepObjective):
        return objective
    if not isinstance(objective, Objective):
        raise InvalidInput(
            f"objectives must be functions decorated with @objective or @step_objective, got {shown(objective)}"
        )
    if objective.form not in ("integral", "peak"):
        raise InvalidInput(
            f"objective {objective.name} must be of form integral or peak, or a @step_objective, got one of "
            f"a whole motion ({objective.form})"
        )
    function = objective.function
    return StepObjective(
        function=lambda step: function(step.motion),
        name=objective.name,
        unit=objective.unit,
        maximise=objective.maximise,
    )
