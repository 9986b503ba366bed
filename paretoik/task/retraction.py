"""Back onto the path: Newton's method for many postures at once, each along its own few directions."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Tape, as_entry
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import link_frames
from paretoik.task.task import Task

TOLERANCE = 1e-12  # m and rad: where Newton stops; its last step squares the error
ACCEPTED = 1e-10  # m and rad: rounding may keep a long arm from TOLERANCE, but not from this
ITERATIONS = 12
LONGEST_STEP = 1.0  # rad or m, in any one direction
REMEMBERED = 64  # programs: of arms and what tasks ask of them


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
    found = _written(arm, tasks)(np.concatenate([q, targets], axis=1).T)
    return found[:rows], found[rows:].reshape(rows, arm.dof, len(q))


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
    q, left, upright = start.copy(), np.empty(len(start)), np.empty(len(start), dtype=bool)
    limits = TOLERANCE, LONGEST_STEP, ITERATIONS
    given = (np.ascontiguousarray(array, dtype=float) for array in (targets, directions))
    _compiled().newton(_written(arm, tasks).arrays, *given, limits, q, left, upright)
    return Retraction(q=q, error=left, on_path=upright & (left <= ACCEPTED))


@cache
def _compiled() -> Any:
    """Return what runs compiled; compiled once, then cached."""
    from paretoik.task import compiled  # here: numba takes its time

    return compiled


def eliminate(
    matrix: Float[np.ndarray, "count size size"], right: Float[np.ndarray, "count size"]
) -> tuple[Float[np.ndarray, "count size"], Float[np.ndarray, " count"]]:
    """Return (solutions, determinants) of small systems, by elimination without exchange of rows.

    A pivot that vanishes gives a solution that is not finite, or a determinant of 0.
    """
    solution, determinant = np.array(right, dtype=float), np.empty(len(matrix))
    _compiled().eliminate(np.array(matrix, dtype=float), solution, determinant)
    return solution, determinant


def _written(arm: Arm, tasks: Sequence[Task]) -> Evaluator:
    """Return the program of all errors, then all entries of the Jacobian, at joint positions and targets."""
    key = arm, *((task.frame, task.axes) for task in tasks)
    if key not in _WRITTEN:
        tape = Tape()
        q: list[Any] = [tape.input() for _ in range(arm.dof)]
        links = link_frames(arm, q)
        errors: list[Any] = []
        jacobian: list[Any] = []
        for task in tasks:
            targets: list[Any] = [tape.input() for _ in range(task.numbers)]
            found, slopes = task.errors(arm, links, targets)
            errors, jacobian = errors + found, jacobian + [slope for row in slopes for slope in row]
        _WRITTEN[key] = compile_evaluator(tape, [as_entry(tape, value) for value in (*errors, *jacobian)])
        if len(_WRITTEN) > REMEMBERED:
            _WRITTEN.popitem(last=False)
    return _WRITTEN[key]


_WRITTEN: OrderedDict[Any, Evaluator] = OrderedDict()
