"""Finite-difference stencils of a task: rates at the samples from positions at the samples, and what can move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.errors import InvalidInput
from paretoik.task.differences import first_derivative, second_derivative
from paretoik.task.motion_task import MotionTask


@dataclass(frozen=True, kw_only=True, eq=False)
class Stencil:
    """u of sample i is Σ_k ``coefficients``[order, i, k] q of sample ``neighbours``[i, k].

    The unknowns of sample i begin at ``first_unknown``[i] (−1: it cannot move). The last ``border`` of them belong to
    the border of Newton's matrix: they couple the end of a cycle to its start. On a cycle the last sample moves with
    the first; where the motion ends at rest, with the one before, as far as the path lets it.
    """

    neighbours: Int[np.ndarray, "time width"]
    coefficients: Float[np.ndarray, "orders time width"]
    first_unknown: Int[np.ndarray, " time"]
    unknowns: int
    border: int

    @property
    def orders(self) -> int:
        """How many of position, velocity, acceleration and jerk u has."""
        return len(self.coefficients)


def stencil(task: MotionTask, orders: int) -> Stencil:
    """Return the stencil of a task for so many of position, velocity, acceleration and jerk."""
    samples = len(task.times)
    derivatives = [np.eye(samples)]
    derivatives.append(first_derivative(derivatives[0], task.times, task.differences, cyclic=task.cyclic))
    derivatives.append(second_derivative(derivatives[0], task.times, task.differences, cyclic=task.cyclic))
    derivatives.append(first_derivative(derivatives[2], task.times, task.differences, cyclic=task.cyclic))
    matrices = np.stack(derivatives[:orders])
    free = samples
    if task.cyclic:  # the last sample is the first
        matrices[..., 0] += matrices[..., -1]
        matrices[..., -1] = 0.0
        free = samples - 1
    nonzero = (matrices != 0).any(axis=0)
    width = int(nonzero.sum(axis=1).max())
    neighbours = np.sort(np.argsort(~nonzero, axis=1, kind="stable")[:, :width], axis=1)
    coefficients = np.take_along_axis(matrices, np.broadcast_to(neighbours, (orders, *neighbours.shape)), axis=2)
    fixed = int(task.start is not None)
    first_unknown = np.where(np.arange(samples) < fixed, -1, (np.arange(samples) - fixed) * task.redundancy)
    if task.cyclic:
        first_unknown[-1] = first_unknown[0]
    if task.ends_at_rest:
        first_unknown[-1] = first_unknown[-2]
    border = 2 * (width - 1) if task.cyclic else 0
    if task.cyclic and free <= 2 * border:
        raise InvalidInput(f"path: at least {2 * border + 2} samples of a cyclic motion wanted, got {samples}")
    return Stencil(
        neighbours=neighbours,
        coefficients=np.ascontiguousarray(coefficients),
        first_unknown=first_unknown,
        unknowns=int(first_unknown.max()) + task.redundancy,
        border=border * task.redundancy,
    )
