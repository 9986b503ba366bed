"""Retraction onto the path by Newton's method, for many postures at once."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Tape, as_entry
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import characteristic_length, geometry_key, joint_scales
from paretoik.task.task import Task, frame_of, path_errors, path_jacobian

ON_PATH_TOLERANCE = 1e-10  # share of the arm's length, and rad: larger than rounding errors, unlike Newton's tolerance


@dataclass(frozen=True, kw_only=True)
class RetractionOptions:
    """Settings of Newton's method onto the path."""

    tolerance: float = 1e-12  # share of the arm's length, and rad
    max_iterations: int = 12
    max_step: float = 1.0  # rad or the arm's length, along any direction
    cache_size: int = 64  # evaluators in memory: six for each arm geometry with frames and axes


OPTIONS = RetractionOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Retraction:
    """Postures after Newton's method."""

    q: Float[np.ndarray, "*batch dof"]
    error: Float[np.ndarray, "*batch"]  # largest task error [rad, or share of the arm's length]
    on_path: Bool[np.ndarray, "*batch"]  # whether a posture converged on the sheet that it started from


def task_errors(
    arm: Arm, tasks: Sequence[Task], q: Float[np.ndarray, "*batch dof"], targets: Float[np.ndarray, "*#batch numbers"]
) -> tuple[Float[np.ndarray, "*batch rows"], Float[np.ndarray, "*batch rows dof"]]:
    """Return the errors [m, rad] of all tasks and their Jacobian at postures."""
    batch, rows = q.shape[:-1], sum(task.rows for task in tasks)
    inputs = np.concatenate([q, np.broadcast_to(targets, (*batch, targets.shape[-1]))], axis=-1)
    values = error_evaluator(arm, tasks)(inputs.reshape(-1, inputs.shape[-1]).T).T
    return values[:, :rows].reshape(*batch, rows), values[:, rows:].reshape(*batch, rows, arm.dof)


def relative_errors(
    arm: Arm, tasks: Sequence[Task], q: Float[np.ndarray, "*batch dof"], targets: Float[np.ndarray, "*#batch numbers"]
) -> tuple[Float[np.ndarray, "*batch rows"], Float[np.ndarray, "*batch rows dof"]]:
    """Return all tasks' errors and Jacobian: lengths in arm lengths, angles in rad."""
    error, jacobian = task_errors(arm, tasks, q, targets)
    scales = row_scales(arm, tasks)
    return error / scales, jacobian * joint_scales(arm) / scales[:, None]


def row_scales(arm: Arm, tasks: Sequence[Task]) -> Float[np.ndarray, " rows"]:
    """Return the unit of each task error: the arm's length [m] or 1 rad."""
    length = characteristic_length(arm)
    rows = [[length] * task.position_rows + [1.0] * (task.rows - task.position_rows) for task in tasks]
    return np.concatenate(rows)


def retract(
    arm: Arm,
    tasks: Sequence[Task],
    start: Float[np.ndarray, "*batch dof"],
    targets: Float[np.ndarray, "*#batch numbers"],
    directions: Float[np.ndarray, "*batch dof rows"],
) -> Retraction:
    """Return postures q = start + directions · z on the path.

    Newton's method finds z from 0. A sample's result does not depend on other samples in the batch. If the
    determinant of the Newton matrix changes its sign, the sample has crossed a fold to another sheet of the self-motion
    manifold and is not on the path.
    """
    batch = start.shape[:-1]
    q, error, same_sheet = start.copy(), np.empty(batch), np.empty(batch, dtype=bool)
    targets = np.broadcast_to(targets, (*batch, targets.shape[-1])).reshape(-1, targets.shape[-1])
    directions = directions.reshape(-1, *directions.shape[-2:])
    compiled_steps().newton(
        error_evaluator(arm, tasks).arrays,
        np.require(targets, float, ["C", "W"]),  # a read-only array would need another compilation
        np.ascontiguousarray(directions, dtype=float),
        row_scales(arm, tasks),
        (OPTIONS.tolerance, OPTIONS.max_step, OPTIONS.max_iterations),
        q.reshape(-1, arm.dof),
        error.reshape(-1),
        same_sheet.reshape(-1),
    )
    return Retraction(q=q, error=error, on_path=np.asarray(same_sheet & (error <= ON_PATH_TOLERANCE)))


def retract_nearest(
    arm: Arm,
    tasks: Sequence[Task],
    start: Float[np.ndarray, "*batch dof"],
    targets: Float[np.ndarray, "*#batch numbers"],
) -> Retraction:
    """Return postures retracted the shortest way: along the row space of the Jacobian at ``start``."""
    return retract(arm, tasks, start, targets, normal_directions(arm, tasks, start, targets))


def normal_directions(
    arm: Arm, tasks: Sequence[Task], q: Float[np.ndarray, "*batch dof"], targets: Float[np.ndarray, "*#batch numbers"]
) -> Float[np.ndarray, "*batch dof rows"]:
    """Return a basis [rad, m] normal to the self-motion, orthonormal in scaled joints."""
    return row_space_basis(relative_errors(arm, tasks, q, targets)[1]) * joint_scales(arm)[:, None]


def row_space_basis(jacobian: Float[np.ndarray, "*batch rows dof"]) -> Float[np.ndarray, "*batch dof rows"]:
    """Return an orthonormal basis of the row space of J; J · basis is lower triangular."""
    orthonormal, upper = np.linalg.qr(jacobian.swapaxes(-1, -2))
    signs = np.where(np.diagonal(upper, axis1=-2, axis2=-1) < 0, -1.0, 1.0)
    return orthonormal * signs[..., None, :]


def solve_small_systems(
    matrix: Float[np.ndarray, "count size size"], right: Float[np.ndarray, "count size"]
) -> tuple[Float[np.ndarray, "count size"], Float[np.ndarray, " count"]]:
    """Return solutions and determinants by Gaussian elimination without pivoting.

    A pivot of 0 gives a solution that is not finite, or a determinant of 0.
    """
    solution, determinant = np.array(right, dtype=float, order="C"), np.empty(len(matrix))
    compiled_steps().solve_small_systems(np.array(matrix, dtype=float, order="C"), solution, determinant)
    return solution, determinant


@cache
def compiled_steps() -> Any:
    """Return the compiled steps of the projection onto paths."""
    from paretoik.task import retraction_kernel as compiled  # here: numba is slow to load

    return compiled


def error_evaluator(arm: Arm, tasks: Sequence[Task]) -> Evaluator:
    """Return the evaluator of the tasks' errors, then Jacobian entries, at joint positions and targets."""

    def build() -> tuple[Tape, list[int]]:
        tape = Tape()
        q: list[Any] = [tape.input() for _ in range(arm.dof)]
        targets: list[Any] = [tape.input() for task in tasks for _ in range(task.target_size)]
        values = [*path_errors(arm, tasks, q, targets), *path_jacobian(arm, tasks, q)]
        return tape, [as_entry(tape, value) for value in values]

    return path_evaluator("errors", arm, tasks, build)


def path_evaluator(
    kind: str, arm: Arm, tasks: Sequence[Task], build: Callable[[], tuple[Tape, list[int]]]
) -> Evaluator:
    """Return the evaluator of a tape's outputs, shared by arms of the same geometry."""
    frames = [frame_of(arm, task.frame) for task in tasks]
    places = [(frame.link, frame.pose.position.tobytes(), frame.pose.quaternion.tobytes()) for frame in frames]
    key = kind, geometry_key(arm), *zip(places, (task.axes for task in tasks), strict=True)
    if key not in _EVALUATORS:
        _EVALUATORS[key] = compile_evaluator(*build())
        if len(_EVALUATORS) > OPTIONS.cache_size:
            _EVALUATORS.popitem(last=False)
    _EVALUATORS.move_to_end(key)
    return _EVALUATORS[key]


_EVALUATORS: OrderedDict[Any, Evaluator] = OrderedDict()
