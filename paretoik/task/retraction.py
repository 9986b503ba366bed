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
FIRST_STEPS = 5  # after these, most have arrived
LONGEST_STEP = 1.0  # rad or m, in any one direction
SAMPLES = BLOCK


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
    q, left, upright = start.copy(), np.full(len(start), np.inf), np.zeros(len(start), dtype=bool)
    going = np.arange(len(start))
    for steps in (FIRST_STEPS, ITERATIONS - FIRST_STEPS):  # the few that need more are gathered from all blocks
        for first in range(0, len(going), SAMPLES):
            part = going[first : first + SAMPLES]
            q[part], left[part], upright[part] = _newton(
                arm, tasks, q[part], targets[part], directions[part], steps=steps
            )
        going = going[left[going] > TOLERANCE]
    return Retraction(q=q, error=left, on_path=upright & (left <= ACCEPTED))


def _newton(
    arm: Arm, tasks: Sequence[Task], start: np.ndarray, targets: np.ndarray, directions: np.ndarray, *, steps: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (q, error before the last step, whether the determinant is positive)."""
    count, _, rows = directions.shape
    left, upright = np.full(count, np.inf), np.zeros(count, dtype=bool)
    found, going = start.copy(), np.arange(count)
    q, wanted, along = (np.ascontiguousarray(np.moveaxis(array, 0, -1)) for array in (start, targets, directions))
    for _ in range(steps):
        error, jacobian = _evaluate(arm, tasks, list(q), list(wanted))
        matrix = [[sum_of(jacobian[i], list(along[:, j])) for j in range(rows)] for i in range(rows)]
        step, determinant = eliminate(matrix, error)
        size = np.max([np.abs(value) for value in np.broadcast_arrays(*error)], axis=0)
        left[going], upright[going] = size, determinant > 0
        further = size > TOLERANCE
        move = np.clip(np.broadcast_arrays(*step), -LONGEST_STEP, LONGEST_STEP)
        if not further.all():
            found[going[~further]] = q[:, ~further].T
            q, wanted, along, move = (array[..., further] for array in (q, wanted, along, move))
            going = going[further]
        if len(going) == 0:
            break
        q = q + np.array([sum_of(list(slopes), list(move)) for slopes in along])
    found[going] = q.T
    return found, left, upright


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
        if isinstance(total, np.ndarray):
            total += a * b  # in place: this is where a retraction spends its time
        elif isinstance(a, np.ndarray) or a != 0.0:
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
