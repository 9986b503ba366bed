"""The curve of a motion: its spline projected onto the path, with exact velocities and accelerations.

The spline is s(t), J the tasks' Jacobian there and W the joint scales. The projection moves along the normal directions
D = W² Jᵀ, q = s + D λ, until the tasks' equations g(q, t) = 0 hold. The derivatives of λ follow from linear systems
with the same matrix ∂g/∂q D: the implicit function theorem.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from paretoik.arrays import JointPaths, Series, Times
from paretoik.autodiff.differentiation import gradient, tangents
from paretoik.autodiff.evaluator import Evaluator
from paretoik.autodiff.tape import Tape, as_entry
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import joint_scales
from paretoik.tables import field_representation, html_representation
from paretoik.task.retraction import compiled_steps, path_evaluator, row_scales
from paretoik.task.task import Task, path_equations, path_jacobian, path_targets


class JointState(NamedTuple):
    """Joint positions, velocities and accelerations (*batch, instants, dof) [rad, m; per s; per s²]."""

    q: JointPaths
    dq: JointPaths
    ddq: JointPaths

    def __repr__(self) -> str:
        return field_representation(self)

    def _repr_html_(self) -> str:
        return html_representation(self)


def interpolate(q: JointPaths, time: Series, t: Times, *, cyclic: bool, order: int = 0) -> JointPaths:
    """Return the cubic spline through samples (*batch, time, dof) at t [s], or a derivative of it."""
    ends = "periodic" if cyclic else "not-a-knot"
    flat, times = q.reshape(-1, *q.shape[-2:]), time.reshape(-1, time.shape[-1])
    if np.all(times == times[0]):
        values = CubicSpline(times[0], flat, axis=1, bc_type=ends)(t, order)
    else:
        values = np.stack([CubicSpline(s, q, bc_type=ends)(t, order) for s, q in zip(times, flat, strict=True)])
    return values.reshape(*q.shape[:-2], len(t), q.shape[-1])


def target_rates(tasks: Sequence[Task], t: Times) -> tuple[Float[np.ndarray, "time numbers"], ...]:
    """Return the targets of all tasks at times t [s], and their first two time derivatives."""
    first, second = zip(*(task.target_rates(t) for task in tasks), strict=True)
    return path_targets(tasks, t), np.concatenate(first, axis=1), np.concatenate(second, axis=1)


def project_rates(
    arm: Arm,
    tasks: Sequence[Task],
    spline: JointState,
    q: JointPaths,
    targets: Sequence[Float[np.ndarray, "*#batch instants numbers"]],
) -> JointState:
    """Return the exact state of a spline's projection q onto the path.

    The linear systems are regular if the projection succeeded: the sign of their determinant has not changed.
    """
    points, n, rows, steps = int(np.prod(q.shape[:-1])), arm.dof, sum(task.rows for task in tasks), compiled_steps()
    given = [np.broadcast_to(part, (*q.shape[:-1], part.shape[-1])).reshape(points, -1) for part in targets]
    inputs = np.concatenate([np.zeros((3 * n, points)), *(part.T for part in given)])
    before, scales = np.stack([part.reshape(points, n) for part in spline]), joint_scales(arm)
    state, directions = np.stack([q.reshape(points, n), *before[1:]]), np.empty((3, points, n, rows))
    steps.write_directions(normal_evaluator(arm, tasks).arrays, before, scales, directions)
    rates, multipliers = rate_evaluator(arm, tasks).arrays, np.empty((3, points, rows))
    steps.project_rates(rates, inputs, scales, before, directions, state, multipliers)
    return JointState(*state.reshape(3, *q.shape))


def rate_evaluator(arm: Arm, tasks: Sequence[Task]) -> Evaluator:
    """Return the evaluator of ∂g/∂q, ġ and g̈ in units of ``row_scales``.

    The inputs are q, q̇, q̈ and the targets with their derivatives.
    """

    def build() -> tuple[Tape, list[int]]:
        tape, (q, *_), (equations, first, second) = trace_path(arm, tasks)
        slopes = [entry for equation in equations for entry in gradient(tape, equation, q)]
        return tape, [*slopes, *first, *second]

    return path_evaluator("rates", arm, tasks, build)


def normal_evaluator(arm: Arm, tasks: Sequence[Task]) -> Evaluator:
    """Return the evaluator of J, J̇ and J̈ at s, ṡ and s̈. Rows are divided by ``row_scales``."""

    def build() -> tuple[Tape, list[int]]:
        tape = Tape()
        s, ds, dds = _inputs(tape, arm.dof)
        jacobian = scaled_jacobian(tape, arm, tasks, s)
        first = tangents(tape, jacobian, _directions(s, ds))
        return tape, [*jacobian, *first, *tangents(tape, first, _directions(s, ds) | _directions(ds, dds))]

    return path_evaluator("normals", arm, tasks, build)


def scaled_jacobian(tape: Tape, arm: Arm, tasks: Sequence[Task], q: list[Any]) -> list[int]:
    """Return the entries of the tasks' Jacobian on a tape by rows, in units of ``row_scales``."""
    shares = np.repeat(1.0 / row_scales(arm, tasks), arm.dof)
    return [as_entry(tape, slope * share) for slope, share in zip(path_jacobian(arm, tasks, q), shares, strict=True)]


def trace_path(arm: Arm, tasks: Sequence[Task]) -> tuple[Tape, list[list[int]], list[list[int]]]:
    """Return a tape, its entries of (q, q̇, q̈), and those of (g, ġ, g̈).

    The inputs are q, q̇ and q̈, then the targets with their first and second derivatives.
    """
    tape = Tape()
    q, dq, ddq = _inputs(tape, arm.dof)
    targets, speeds, accelerations = _inputs(tape, sum(task.target_size for task in tasks))
    shares = 1.0 / row_scales(arm, tasks)
    errors = path_equations(arm, tasks, q, targets)
    equations = [as_entry(tape, error * share) for error, share in zip(errors, shares, strict=True)]
    moving = _directions(q, dq) | _directions(targets, speeds)
    first = tangents(tape, equations, moving)
    second = tangents(tape, first, moving | _directions(dq, ddq) | _directions(speeds, accelerations))
    return tape, [[value.index for value in part] for part in (q, dq, ddq)], [equations, first, second]


def _inputs(tape: Tape, count: int) -> list[list[Any]]:
    return [[tape.input() for _ in range(count)] for _ in range(3)]


def _directions(values: Sequence[Any], rates: Sequence[Any]) -> dict[int, int]:
    return {value.index: rate.index for value, rate in zip(values, rates, strict=True)}
