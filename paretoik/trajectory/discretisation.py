"""Stencils of a task: positions and rates at instants from samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from paretoik.errors import InvalidInput
from paretoik.task.differences import evaluate_with_midpoints, first_derivative, fit_spline, second_derivative
from paretoik.task.motion_task import MotionTask

WINDOW = 6  # number of samples that a spline's position, rates and jerk between two samples depend on


class Stencil(NamedTuple):
    """Coefficients of u: at instant i it is Σ_k ``coefficients``[order, i, k] · q[``neighbours``[i, k]].

    On a cycle the last sample moves with the first. If the motion ends at rest, the last sample moves with the one
    before, as far as the path allows.
    """

    neighbours: Int[np.ndarray, "instants width"]
    coefficients: Float[np.ndarray, "orders instants width"]
    first_unknown: Int[np.ndarray, " time"]  # index of the first unknown of each sample, −1 if it cannot move
    unknowns: int
    # number of the last unknowns: they couple the end of a cycle to its start, in the border of Newton's matrix
    border: int

    @property
    def orders(self) -> int:
        """Number of orders in u: position, velocity, acceleration and jerk."""
        return len(self.coefficients)


def stencil(task: MotionTask, orders: int) -> Stencil:
    """Return a task's stencil for the first orders, from position to jerk."""
    neighbours, coefficients = (_spline if task.differences == "spline" else _differences)(task, orders)
    samples, width = len(task.times), neighbours.shape[1]
    fixed = int(task.start is not None)
    first_unknown = np.where(np.arange(samples) < fixed, -1, (np.arange(samples) - fixed) * task.redundancy)
    if task.cyclic:
        first_unknown[-1] = first_unknown[0]
    if task.ties_end:
        first_unknown[-1] = first_unknown[-2]
    spline = task.differences == "spline"
    border = (width - 1) * (1 if spline else 2) if task.cyclic else 0
    if task.cyclic and samples - 1 <= 2 * border:
        raise InvalidInput(f"path must have at least {2 * border + 2} samples if the motion is cyclic, got {samples}")
    return Stencil(
        neighbours=neighbours,
        coefficients=np.ascontiguousarray(coefficients),
        first_unknown=first_unknown,
        unknowns=int(first_unknown.max()) + task.redundancy,
        border=border * task.redundancy,
    )


def _differences(task: MotionTask, orders: int) -> tuple[np.ndarray, np.ndarray]:
    """Return neighbours and coefficients of finite differences."""
    samples = len(task.times)
    derivatives = [np.eye(samples)]
    derivatives.append(first_derivative(derivatives[0], task.times, task.differences, cyclic=task.cyclic))
    derivatives.append(second_derivative(derivatives[0], task.times, task.differences, cyclic=task.cyclic))
    derivatives.append(first_derivative(derivatives[2], task.times, task.differences, cyclic=task.cyclic))
    matrices = np.stack(derivatives[:orders])
    if task.cyclic:  # the last sample is the first
        matrices[..., 0] += matrices[..., -1]
        matrices[..., -1] = 0.0
    nonzero = (matrices != 0).any(axis=0)
    width = int(nonzero.sum(axis=1).max())
    neighbours = np.sort(np.argsort(~nonzero, axis=1, kind="stable")[:, :width], axis=1)
    coefficients = np.take_along_axis(matrices, np.broadcast_to(neighbours, (orders, *neighbours.shape)), axis=2)
    return neighbours, coefficients


def _spline(task: MotionTask, orders: int) -> tuple[np.ndarray, np.ndarray]:
    """Return neighbours and coefficients of the spline and its derivatives.

    Unit samples that share no window are evaluated together.
    """
    samples = len(task.times)
    free = samples - task.cyclic
    width = min(WINDOW, free)
    sample = np.arange(len(task.instants)) // task.stride - 2
    first = sample if task.cyclic else np.clip(sample, 0, samples - width)
    neighbours = (first[:, None] + np.arange(width)) % free if task.cyclic else first[:, None] + np.arange(width)
    index = np.arange(free)
    colour = index % WINDOW + np.where(index < free - free % WINDOW, 0, WINDOW)
    units = np.zeros((samples, 2 * WINDOW))
    units[index, colour] = 1.0
    if task.cyclic:
        units[-1] = units[0]
    spline = fit_spline(units, task.times, cyclic=task.cyclic, ends_at_rest=task.ends_at_rest)
    _, q, derivatives = evaluate_with_midpoints(spline)
    values = np.stack([q, derivatives.dq, derivatives.ddq, derivatives.jerk][:orders])
    coefficients = values[:, np.arange(len(neighbours))[:, None], colour[neighbours]]
    return np.sort(neighbours, axis=1), np.take_along_axis(
        coefficients, np.broadcast_to(np.argsort(neighbours, axis=1), coefficients.shape), axis=2
    )
