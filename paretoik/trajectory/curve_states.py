"""What projects the instants of a task's spline onto its path, as arrays for ``compiled.curve_states``.

Programs bound and minimise functions of the curve's state. Its first derivatives are exact. Second ones leave out how
the directions of the projection turn: this counts times the spline's distance from the path.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from paretoik.autodiff.differentiation import gradient
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Tape, as_entry
from paretoik.robot.arm import Arm
from paretoik.robot.scales import joint_scales
from paretoik.task.joint_curve import rate_evaluator, target_rates, trace_path
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import ON_PATH_TOLERANCE, OPTIONS, error_evaluator, row_scales
from paretoik.task.task import Task, path_jacobian
from paretoik.trajectory.compiled.curve_states import Curve


class _Slopes(NamedTuple):
    """Evaluators of J, B and C at the curve's state, and of ∂(Jᵀ λ)/∂s at the spline's."""

    slopes: Evaluator
    turns: Evaluator


def curve_arrays(task: MotionTask) -> Curve:
    """Return what projects the instants of a task; its registers are its own: one for a thread."""
    arm, tasks, derivatives = task.arm, task.tasks, _slopes(task.arm, task.tasks)
    targets = instant_targets(task)
    return Curve(
        projects=task.differences == "spline",
        errors=error_evaluator(arm, tasks).arrays,
        rates=rate_evaluator(arm, tasks).arrays,
        slopes=derivatives.slopes.arrays,
        turns=derivatives.turns.arrays,
        targets=np.ascontiguousarray(targets[0]),
        inputs=np.concatenate([np.zeros((3 * arm.dof, len(targets[0]))), *(part.T for part in targets)]),
        row_scales=row_scales(arm, tasks),
        scales=joint_scales(arm),
        retraction=(OPTIONS.tolerance, OPTIONS.max_step, OPTIONS.max_iterations),
        on_path=ON_PATH_TOLERANCE,
    )


def instant_targets(task: MotionTask) -> tuple[np.ndarray, ...]:
    """Return the targets (instants, numbers) of all tasks and their first and second derivatives."""
    targets = target_rates(task.tasks, task.instants)
    for part in targets if task.cyclic else ():
        part[-1] = part[0]
    return targets


def _slopes(arm: Arm, tasks: Sequence[Task]) -> _Slopes:
    key = arm, *((task.frame, task.axes) for task in tasks)
    if key not in _EVALUATORS:
        tape, (q, *_), (equations, first, second) = trace_path(arm, tasks)
        slopes = [entry for part in (equations, first, second) for each in part for entry in gradient(tape, each, q)]
        other, rows = Tape(), len(equations)
        s: list[Any] = [other.input() for _ in range(arm.dof)]
        factors: list[Any] = [other.input() for _ in range(rows)]
        jacobian: Any = path_jacobian(arm, tasks, s)
        turns = []
        for j in range(arm.dof):
            component = sum((factors[i] * jacobian[i * arm.dof + j] for i in range(rows)), start=0.0)
            turns += gradient(other, as_entry(other, component), [value.index for value in s])
        _EVALUATORS[key] = _Slopes(compile_evaluator(tape, slopes), compile_evaluator(other, turns))
        if len(_EVALUATORS) > OPTIONS.cache_size:
            _EVALUATORS.popitem(last=False)
    return _EVALUATORS[key]


_EVALUATORS: OrderedDict[Any, _Slopes] = OrderedDict()
