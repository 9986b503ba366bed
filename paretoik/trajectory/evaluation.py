"""The values of a motion's program: objectives and constraints at one motion on the path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.trajectory.program import MotionProgram


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionValues:
    """Objectives F and constraints of a program at a motion.

    ``inputs`` are those of its evaluators, slack and epigraph variables at their true values; ``inequalities`` the
    limits, divided by their ranges, positive where they hold; ``ties`` those that tie slack and epigraph variables;
    ``parts`` the smooth parts of every function of the whole motion.
    """

    inputs: Float[np.ndarray, "inputs time"]
    objectives: Float[np.ndarray, " objectives"]
    inequalities: Float[np.ndarray, " inequalities"]
    ties: Float[np.ndarray, " ties"]
    parts: tuple[np.ndarray, ...]


def evaluate(program: MotionProgram, q: Float[np.ndarray, "time dof"]) -> MotionValues:
    """Return the values of a program at a motion on the path."""
    stencil, n = program.stencil, q.shape[1]
    orders, inputs = len(stencil.coefficients), program.inputs.copy()
    u = np.einsum("oik,ikj->oji", stencil.coefficients, q[stencil.neighbours])
    inputs[: orders * n] = u.reshape(orders * n, -1)
    auxiliary = program.variables[orders * n :]
    if program.slacks:
        inputs[auxiliary[: program.slacks]] = program.evaluators.slack(inputs)
    values = program.evaluators.value(inputs)
    if program.peaks:
        peaks = np.full(program.peaks, -np.inf)
        np.maximum.at(peaks, program.epigraph_peaks, -values[program.sums + program.epigraph_rows].min(axis=1))
        inputs[auxiliary[program.slacks :]] = peaks[:, None]
        values[program.sums + program.epigraph_rows] += peaks[program.epigraph_peaks, None]
    parts = tuple(each.value(whole_inputs(program, inputs)[:, None])[:, 0] for each in program.whole_functions)
    objectives = [
        values[total.index] @ program.task.weights
        if total.kind == "sum"
        else float(inputs[auxiliary[program.slacks + total.index], 0])
        if total.kind == "peak"
        else program.whole_functions[total.index].combine(parts[total.index])
        for total in program.totals
    ]
    inequalities, ties = limit_values(program, inputs, values)
    return MotionValues(
        inputs=inputs, objectives=np.array(objectives), inequalities=inequalities, ties=ties, parts=parts
    )


def limit_values(
    program: MotionProgram, inputs: Float[np.ndarray, "inputs time"], values: Float[np.ndarray, "functions time"]
) -> tuple[Float[np.ndarray, " inequalities"], Float[np.ndarray, " ties"]]:
    """Return the limits, divided by their ranges, and the ties, from inputs and values of the functions of a sample."""
    every = np.concatenate([inputs[program.variables], values[program.sums :]])
    row, sample = program.limited.T
    limits = program.sides * (every[row, sample] - program.bounds)
    count = program.elastic
    return limits[:count] / program.ranges[:count], limits[count:]


def whole_inputs(
    program: MotionProgram, inputs: Float[np.ndarray, "inputs time"]
) -> Float[np.ndarray, " whole_inputs"]:
    """Return the inputs of functions of the whole motion: position, velocity, acceleration, jerk (time, dof) each."""
    orders, n = len(program.stencil.coefficients), program.task.arm.dof
    u = inputs[: orders * n].reshape(orders, n, -1).swapaxes(1, 2)
    return np.concatenate([u.ravel(), np.zeros((4 - orders) * u[0].size)])
