"""Arrays that project a spline's instants onto their path, for ``curve_state_kernel``.

Programs bound and minimise functions of the curve's state. Its first derivatives are exact; second derivatives lack the
terms that are proportional to the spline's distance from the path.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from paretoik.autodiff.differentiation import gradient, tangents
from paretoik.autodiff.tape import Expression, Tape, as_entry
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import joint_scales
from paretoik.task.joint_curve import normal_evaluator, rate_evaluator, scaled_jacobian, target_rates, trace_path
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import ON_PATH_TOLERANCE, OPTIONS, error_evaluator, path_evaluator, row_scales
from paretoik.task.task import Task
from paretoik.trajectory.curve_state_kernel import Curve


def curve_arrays(task: MotionTask) -> Curve:
    """Return the arrays, with registers, that project a task's instants."""
    arm, tasks, (targets, inputs) = task.arm, task.tasks, _targets(task)
    return Curve(
        projects=task.differences == "spline",
        errors=error_evaluator(arm, tasks).arrays,
        normals=normal_evaluator(arm, tasks).arrays,
        rates=rate_evaluator(arm, tasks).arrays,
        slopes=path_evaluator("slopes", arm, tasks, lambda: _trace_gradients(arm, tasks)).arrays,
        turns=path_evaluator("turns", arm, tasks, lambda: _trace_slopes(arm, tasks, transposed=True)).arrays,
        twists=path_evaluator("twists", arm, tasks, lambda: _trace_slopes(arm, tasks, transposed=False)).arrays,
        targets=targets,
        inputs=inputs,
        row_scales=row_scales(arm, tasks),
        scales=joint_scales(arm),
        retraction=(OPTIONS.tolerance, OPTIONS.max_step, OPTIONS.max_iterations),
        on_path=ON_PATH_TOLERANCE,
    )


@lru_cache(maxsize=32)
def _targets(task: MotionTask) -> tuple[np.ndarray, np.ndarray]:
    """Return targets (instants, numbers) and the array of inputs.

    The inputs are space for q, q̇ and q̈, then targets and their derivatives.
    """
    parts = instant_targets(task)
    space = np.zeros((3 * task.arm.dof, len(task.instants)))
    return np.ascontiguousarray(parts[0]), np.concatenate([space, *(part.T for part in parts)])


def instant_targets(task: MotionTask) -> tuple[np.ndarray, ...]:
    """Return all tasks' targets (instants, numbers), and their first and second derivatives."""
    targets = target_rates(task.tasks, task.instants)
    for part in targets if task.cyclic else ():
        part[-1] = part[0]
    return targets


def _trace_gradients(arm: Arm, tasks: Sequence[Task]) -> tuple[Tape, list[int]]:
    """Return the tape of J, B and C, with the inputs of ``rate_evaluator``."""
    tape, (q, *_), parts = trace_path(arm, tasks)
    return tape, [entry for part in parts for each in part for entry in gradient(tape, each, q)]


def _trace_slopes(arm: Arm, tasks: Sequence[Task], *, transposed: bool) -> tuple[Tape, list[int]]:
    """Return the tape of gradients by s of J ρ, or of Jᵀ λ if ``transposed``.

    The gradients of their first and second time derivatives follow. The inputs are s, ṡ and s̈, then ρ, ρ̇ and ρ̈, or
    λ, λ̇ and λ̈.
    """
    tape, n = Tape(), arm.dof
    count = sum(task.rows for task in tasks) if transposed else n
    s, ds, dds = ([tape.input() for _ in range(n)] for _ in range(3))
    factors, first, second = ([tape.input() for _ in range(count)] for _ in range(3))
    jacobian: list[Any] = [Expression(tape, i) for i in scaled_jacobian(tape, arm, tasks, s)]
    rows = (
        [jacobian[j::n] for j in range(n)] if transposed else [jacobian[i : i + n] for i in range(0, len(jacobian), n)]
    )
    products = (sum((m * each for m, each in zip(factors, row, strict=True)), 0.0) for row in rows)
    values = [as_entry(tape, product) for product in products]
    entries = [[value.index for value in part] for part in ([*s, *factors], [*ds, *first], [*dds, *second])]
    moving = dict(zip(entries[0], entries[1], strict=True))
    rates = tangents(tape, values, moving)
    bends = tangents(tape, rates, moving | dict(zip(entries[1], entries[2], strict=True)))
    return tape, [slope for each in (*values, *rates, *bends) for slope in gradient(tape, each, entries[0][:n])]
