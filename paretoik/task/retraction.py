"""Back onto the path: Newton's method for many postures at once, each along its own few directions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from paretoik.robot.arm import Arm
from paretoik.robot.chain import BLOCK
from paretoik.robot.components import Component
from paretoik.robot.kinematics import chain
from paretoik.task.task import Task

TOLERANCE = 1e-12  # m and rad: where Newton stops; its last step squares the error
ACCEPTED = 1e-10  # m and rad: rounding may keep a long arm from TOLERANCE, but not from this
ITERATIONS = 12
LONGEST_STEP = 1.0  # rad or m, in any one direction


@dataclass(frozen=True, kw_only=True, eq=False)
class Retraction:
    """Postures that were led to the path.

    ``error`` [m, rad] is what is left; ``on_path`` says which arrived, on the sheet that they left from.
    """

    q: Float[np.ndarray, "samples dof"]
    error: Float[np.ndarray, " samples"]
    on_path: Bool[np.ndarray, " samples"]


def task_errors(
    arm: Arm, tasks: Sequence[Task], q: Float[np.ndarray, "samples dof"], targets: Float[np.ndarray, "samples numbers"]
) -> tuple[Float[np.ndarray, "rows samples"], Float[np.ndarray, "rows dof samples"]]:
    """Return the errors of all tasks and their Jacobian at postures, sample by sample."""
    rows = sum(task.rows for task in tasks)
    error, jacobian = np.empty((rows, len(q))), np.empty((rows, arm.dof, len(q)))
    for start in range(0, len(q), BLOCK):
        part = slice(start, start + BLOCK)
        found = _evaluate(arm, tasks, _columns(q[part]), _columns(targets[part]))
        for row, (value, slopes) in enumerate(zip(*found, strict=True)):
            error[row, part] = value
            for joint, slope in enumerate(slopes):
                jacobian[row, joint, part] = slope
    return error, jacobian


def retract(
    arm: Arm,
    tasks: Sequence[Task],
    start: Float[np.ndarray, "samples dof"],
    targets: Float[np.ndarray, "samples numbers"],
    directions: Float[np.ndarray, "samples dof rows"],
) -> Retraction:
    """Return q = start + directions · z on the path, z by Newton's method from 0.

    Every sample is on its own: its result does not depend on what else is in the batch. Samples whose Newton matrix has
    changed the sign of its determinant have crossed a fold, where the answer would belong to another sheet of the
    self-motion manifold; they count as not on the path.
    """
    q = np.empty_like(start)
    error, on_path = np.empty(len(start)), np.empty(len(start), dtype=bool)
    for first in range(0, len(start), BLOCK):
        part = slice(first, first + BLOCK)
        q[part], error[part], on_path[part] = _retract_block(arm, tasks, start[part], targets[part], directions[part])
    return Retraction(q=q, error=error, on_path=on_path)


def _retract_block(
    arm: Arm, tasks: Sequence[Task], start: np.ndarray, targets: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    count, _, rows = directions.shape
    q, wanted = np.ascontiguousarray(start.T), np.ascontiguousarray(targets.T)
    along = np.ascontiguousarray(np.moveaxis(directions, 0, -1))
    left, upright = np.full(count, np.inf), np.zeros(count, dtype=bool)
    active = np.arange(count)
    for _ in range(ITERATIONS):
        here, slope = q[:, active], along[:, :, active]
        error, jacobian = _evaluate(arm, tasks, list(here), list(wanted[:, active]))
        matrix = [[sum_of(jacobian[i], list(slope[:, j])) for j in range(rows)] for i in range(rows)]
        step, determinant = eliminate(matrix, error)
        left[active] = np.max([np.abs(value) for value in np.broadcast_arrays(*error)], axis=0)
        upright[active] = determinant > 0
        going = left[active] > TOLERANCE
        if not going.any():
            break
        active, step = active[going], [np.clip(np.broadcast_to(z, going.shape)[going], -1, 1) for z in step]
        q[:, active] += np.einsum("djn,jn->dn", slope[:, :, going], np.array(step) * LONGEST_STEP)
    return q.T, left, upright & (left <= ACCEPTED)


def eliminate(matrix: Sequence[Sequence[Component]], right: Sequence[Component]) -> tuple[list[np.ndarray], np.ndarray]:
    """Solve small systems, given as components; return (solution, determinant).

    By elimination without exchange of rows: for the retraction, directions are ordered so that the matrix starts
    lower triangular with a positive diagonal.
    """
    rows = [list(row) for row in matrix]
    known, size = list(right), len(right)
    determinant: Component = 1.0
    with np.errstate(all="ignore"):  # a vanishing pivot gives inf or nan, which no later test accepts
        for i in range(size):
            determinant = determinant * rows[i][i]
            inverse = 1.0 / np.asarray(rows[i][i])
            for k in range(i + 1, size):
                factor = rows[k][i] * inverse
                rows[k] = [rows[k][j] - factor * rows[i][j] if j > i else 0.0 for j in range(size)]
                known[k] = known[k] - factor * known[i]
        solution: list[np.ndarray] = [np.empty(0)] * size
        for i in reversed(range(size)):
            rest = known[i]
            for j in range(i + 1, size):
                rest = rest - rows[i][j] * solution[j]
            solution[i] = np.nan_to_num(np.asarray(rest / np.asarray(rows[i][i])), nan=0.0)
    return solution, np.asarray(determinant)


def sum_of(first: Sequence[Component], second: Sequence[Component]) -> Component:
    """Return Σ aᵢ bᵢ over components."""
    total: Component = 0.0
    for a, b in zip(first, second, strict=True):
        if isinstance(a, np.ndarray) or a != 0.0:
            total = total + a * b
    return total


def _evaluate(
    arm: Arm, tasks: Sequence[Task], q: Sequence[Component], targets: Sequence[Component]
) -> tuple[list[Component], list[list[Component]]]:
    links = chain(arm, q)
    error: list[Component] = []
    jacobian: list[list[Component]] = []
    start = 0
    for task in tasks:
        found, slopes = task.errors(arm, links, targets[start : start + task.numbers])
        error, jacobian, start = error + found, jacobian + slopes, start + task.numbers
    return error, jacobian


def _columns(array: np.ndarray) -> list[np.ndarray]:
    return [np.ascontiguousarray(array[:, j]) for j in range(array.shape[1])]
