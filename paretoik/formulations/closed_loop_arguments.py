"""Checks of a closed loop's arguments: objectives, weights, limits, times, steps, a start."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times
from paretoik.closed_loop.control_step import describe_nearest_obstacle, excess_clearance
from paretoik.closed_loop.objectives import StepObjective, as_step_objective
from paretoik.closed_loop.workspace import OPTIONS
from paretoik.errors import InvalidInput
from paretoik.front.preferences import Weights
from paretoik.inputs import check_size, finite_array, likely_spelling, read_list, real_array, shown
from paretoik.task.limits import LIMITED, Limits
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective


def check_objectives(objectives: Sequence[StepObjective | Objective]) -> tuple[StepObjective, ...]:
    """Return objectives of a step; raises InvalidInput for what is none, no objective at all, and names that repeat."""
    if not isinstance(objectives, Sequence):
        raise InvalidInput(f"objectives: a list of them wanted, got {shown(objectives)}")
    if not objectives:
        raise InvalidInput("objectives: wants at least one, got none")
    of_step = tuple(as_step_objective(each) for each in objectives)
    names = [each.name for each in of_step]
    if len(set(names)) != len(names):
        raise InvalidInput(f"objectives: names must differ, got {', '.join(names)}")
    return of_step


def normalise_weights(
    weights: Weights | Sequence[float] | np.ndarray | None, names: tuple[str, ...]
) -> Float[np.ndarray, " n_obj"]:
    """Return weights in the order of the names, their sum 1; equal ones for None. Raises InvalidInput for others."""
    if isinstance(weights, Weights):
        unknown = [name for name in weights.weights if name not in names]
        if unknown:
            hint = likely_spelling(unknown[0], names)
            raise InvalidInput(f"weights: wanted names among {', '.join(names)}, got {shown(unknown[0])}{hint}")
        weights = [weights.weights.get(name, 0.0) for name in names]
    values = np.ones(len(names)) if weights is None else finite_array("weights", weights, shape=(len(names),))
    if (values < 0).any() or values.sum() <= 0:
        raise InvalidInput(f"weights: none below 0 and one above it wanted, got {values.tolist()}")
    return np.asarray(values / values.sum())


def check_limits(limits: Limits | None, *, supported: tuple[str, ...], where: str) -> None:
    """Raise InvalidInput for limits of other kinds than are ``supported`` there."""
    if not isinstance(limits, Limits | None):
        raise InvalidInput(f"limits: Limits wanted, got {shown(limits)}")
    for kind in LIMITED if limits is not None else ():
        limit = getattr(limits, kind)
        if kind not in supported and limit is not None and not (isinstance(limit, float) and limit == np.inf):
            raise InvalidInput(f"limits: of {', '.join(supported[:-1])} and {supported[-1]} wanted {where}, got {kind}")


def check_even(times: Times) -> None:
    """Raise InvalidInput where times are not evenly spaced, up to rounding."""
    steps = np.diff(times)
    if np.ptp(steps) > 1e-9 * steps.mean():
        raise InvalidInput("path: samples evenly spaced in time wanted, one a control step")


def check_longest_step(longest_step: object) -> float:
    """Return the most that a joint may move in a step; raises InvalidInput for what is no positive number."""
    longest = real_array("longest_step", longest_step)
    if longest.shape != () or not longest > 0:
        raise InvalidInput(f"longest_step: a positive number wanted, got {shown(longest_step)}")
    return float(longest)


def read_steps(record_steps: object) -> tuple[Any, ...]:
    """Return the items of a list of steps, unchecked; raises InvalidInput for what is no list."""
    return read_list("record_steps", record_steps, object, "a list of steps")


def check_steps(record_steps: Sequence[int], last: int) -> frozenset[int]:
    """Return the steps of a loop to record; raises InvalidInput for others than 1 to the last."""
    for step in read_steps(record_steps):
        check_size("record_steps", step, 1)
        if step > last:
            raise InvalidInput(f"record_steps: steps from 1 to {last} wanted, got {step}")
    return frozenset(int(step) for step in record_steps)


def check_start(
    task: MotionTask, start: Sequence[float] | np.ndarray, *, name: str = "start"
) -> Float[np.ndarray, " dof"]:
    """Return joint positions to begin in. Raises InvalidInput if they exceed a limit or meet an obstacle."""
    q: np.ndarray = finite_array(name, start, shape=(task.arm.dof,))
    lower, upper = task.arm.position_limits.T
    tolerance = OPTIONS.bound_tolerance
    outside = np.flatnonzero((q < lower - tolerance) | (q > upper + tolerance))
    if outside.size:
        k = int(outside[0])
        raise InvalidInput(
            f"{name}: {task.arm.joint_names[k]} must lie within {lower[k]:.6g} to {upper[k]:.6g}, got {q[k]:.6g}"
        )
    distance = float(excess_clearance(task, q))
    if distance <= 0:
        nearest = describe_nearest_obstacle(task, q)
        raise InvalidInput(f"{name}: must be clear of obstacles, got {distance:.3g} m from {nearest}")
    return q
