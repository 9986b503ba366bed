"""Velocities and accelerations that the path allows: those of a spline once its curve is projected onto the path.

A spline is on the path at its samples alone. Where its task error is e, the projected curve is q − J⁺ e, and as e and ė
are small beside ë, its velocity is q̇ − J⁺ ė and its acceleration q̈ − J⁺ ë, up to what J⁺ changes. Limits on
acceleration, torque and power are those of that curve. J⁺ is taken at a motion near by: what it changes on the way to
another counts times ë.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import JointPaths
from paretoik.autodiff.differentiation import tangents
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.autodiff.tracing import TracedArray
from paretoik.robot.scales import joint_scales
from paretoik.task.between import OPTIONS as REFINEMENT
from paretoik.task.between import differentiate_pieces
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import relative_errors, row_scales
from paretoik.task.task import path_equations
from paretoik.task.traced_motion import TracedMotion


def project_rates(motion: TracedMotion, near: JointPaths) -> TracedMotion:
    """Return one sample of a motion with velocities and accelerations as the path allows them.

    ``motion`` is one of ``trace_sample`` whose inputs are measured in ``joint_scales``, its differences "spline";
    ``near`` (time, dof) a motion on the path.
    """
    task, trace = motion.task, motion.trace
    tape, n, scales = trace.tape, task.arm.dof, joint_scales(task.arm)
    q, dq, ddq = (list(tape.inputs[k * n : (k + 1) * n]) for k in range(3))
    path: Any = path_equations  # typed for arrays; it takes expressions as well
    targets, first, second = ([trace.parameter(c) for c in values.T] for values in _targets(task))
    shares = 1.0 / row_scales(task.arm, task.tasks)
    equations = path(task.arm, task.tasks, list(motion.q.entries), targets)
    error = [as_entry(tape, e * share) for e, share in zip(equations, shares, strict=True)]
    directions = dict(zip(q, dq, strict=True)) | _by_entry(targets, first)
    error_rate = tangents(tape, error, directions)
    directions = dict(zip(dq, ddq, strict=True)) | _by_entry(first, second) | directions
    error_acceleration = tangents(tape, error_rate, directions)
    instants = task.motion(near).instants.q
    inverse = np.linalg.pinv(relative_errors(task.arm, task.tasks, instants, _targets(task)[0])[1])

    def correct(rates: TracedArray, errors: list[int]) -> TracedArray:
        corrected: list[Any] = []
        for j, rate in enumerate(rates.entries):
            terms = (trace.parameter(inverse[:, j, k]) * Expression(tape, e) for k, e in enumerate(errors))
            corrected.append(rate - float(scales[j]) * sum(terms, start=0.0))
        return TracedArray(trace, np.array(corrected, dtype=object), shared=True)

    return replace(motion, dq=correct(motion.dq, error_rate), ddq=correct(motion.ddq, error_acceleration))


def _by_entry(values: list[Expression], rates: list[Expression]) -> dict[int, int]:
    return {value.index: rate.index for value, rate in zip(values, rates, strict=True)}


def _targets(task: MotionTask) -> tuple[Float[np.ndarray, "instants numbers"], ...]:
    """Return the targets of all tasks at the instants, and their first and second derivatives."""
    count, step = REFINEMENT.steps, np.diff(task.times)
    finer = np.append((task.times[:-1, None] + step[:, None] * np.arange(count) / count).ravel(), task.times[-1])
    targets = np.concatenate([each.targets(finer) for each in task.tasks], axis=1)
    rates = (differentiate_pieces(targets, step / count, order, cyclic=task.cyclic) for order in (1, 2))
    return tuple(values[:: count // task.stride] for values in (targets, *rates))
