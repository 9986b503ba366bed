"""The state of a motion's curve as expressions: what functions and limits of a program see of a spline.

A motion is its spline s projected onto the path (``task.joint_curve``). At an instant the projection moves along the
columns of D = W² Jᵀ there, and D stands still, so that with the path equations g(q, t) and K = D (J D)⁻¹

    q = s − K g(s, t), again from there,   q̇ = ṡ − K ġ(q, ṡ, t),   q̈ = s̈ − K g̈(q, q̇, s̈, t)

up to the fourth power of the spline's distance from the path: Newton's first two steps. First derivatives are exact.
Second ones take K for a constant: its own derivatives count times g, ġ and g̈ only, and would take most of the time.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.differentiation import dependencies, tangents
from paretoik.autodiff.rewriting import copy_entries, substitute
from paretoik.autodiff.tape import Expression, Tape, as_entry
from paretoik.autodiff.tracing import Trace, TracedArray
from paretoik.robot.arm import Arm
from paretoik.robot.scales import joint_scales
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import OPTIONS
from paretoik.task.task import Task, path_equations, path_jacobian
from paretoik.task.traced_motion import TracedMotion


@dataclass(frozen=True, kw_only=True, eq=False)
class _Projection:
    """The projection of one instant on a tape of its own.

    ``inputs`` are s, ṡ and s̈, then the targets with their first and second derivatives; ``outputs`` are q, q̇ and q̈,
    ``frozen`` the entries of K.
    """

    tape: Tape
    inputs: list[int]
    outputs: list[int]
    frozen: list[int]


def project_motion(motion: TracedMotion) -> tuple[TracedMotion, frozenset[int]]:
    """Return one sample of a motion with the state of its curve, and the entries that second derivatives take as fixed.

    Only splines of a task with a path are projected. ``motion`` is one of ``trace_sample``.
    """
    task, trace = motion.task, motion.trace
    if task.differences != "spline":
        return motion, frozenset()
    columns, tape, projection = target_states(task), trace.tape, _projection(task.arm, task.tasks)
    targets = [tape.input() for _ in range(columns.shape[1])]
    trace.parameters |= {x.index: values for x, values in zip(targets, columns.T, strict=True)}
    state = np.stack([part.entries for part in (motion.q, motion.dq, motion.ddq)])
    outputs, count = [*projection.outputs, *projection.frozen], len(projection.outputs)
    copies = _copy(projection, outputs, tape, [*state.ravel(), *targets])
    q, dq, ddq = (_array(trace, part) for part in np.reshape(copies[:count], state.shape).tolist())
    return replace(motion, q=q, dq=dq, ddq=ddq), frozenset(copies[count:]).difference(tape.values)


def project_values(motion: TracedMotion, values: Sequence[Expression | float]) -> list[Expression | float]:
    """Return values of a whole motion's spline as those of its curve; ``motion`` is one of ``trace_motion``."""
    task, tape = motion.task, motion.trace.tape
    if task.differences != "spline":
        return list(values)
    outputs, projection = [as_entry(tape, value) for value in values], _projection(task.arm, task.tasks)
    used, replacements = set(dependencies(tape, outputs)), dict[int, int]()
    state = np.stack([part.entries for part in (motion.q, motion.dq, motion.ddq)], axis=-2)
    for spline, targets in zip(state, target_states(task), strict=True):
        before = [as_entry(tape, value) for value in spline.ravel()]
        if used.isdisjoint(before):
            continue
        after = _copy(projection, projection.outputs, tape, [*spline.ravel(), *targets])
        replacements |= dict(zip(before, after, strict=True))
    return [Expression(tape, i) for i in substitute(tape, outputs, replacements)]


def target_states(task: MotionTask) -> Float[np.ndarray, "instants numbers"]:
    """Return the targets of all tasks at the instants, then their first and their second derivatives."""
    rates = [each.target_rates(task.instants) for each in task.tasks]
    targets = [each.targets(task.instants) for each in task.tasks]
    return np.concatenate([*targets, *(first for first, _ in rates), *(second for _, second in rates)], axis=1)


def _copy(projection: _Projection, outputs: Sequence[int], tape: Tape, values: Sequence[Any]) -> list[int]:
    """Return outputs of the projection on another tape, at values of its inputs there."""
    inputs = dict(zip(projection.inputs, (as_entry(tape, value) for value in values), strict=True))
    return copy_entries(projection.tape, outputs, tape, inputs)


def _array(trace: Trace, entries: Sequence[int]) -> TracedArray:
    values = np.empty(len(entries), dtype=object)
    values[:] = [Expression(trace.tape, i) for i in entries]
    return TracedArray(trace, values, shared=True)


_PROJECTIONS: OrderedDict[Any, _Projection] = OrderedDict()


def _projection(arm: Arm, tasks: tuple[Task, ...]) -> _Projection:
    """Return the projection onto paths of some tasks, from memory if they were met before on any path."""
    key = arm, *((task.frame, task.axes) for task in tasks)
    if key not in _PROJECTIONS:
        _PROJECTIONS[key] = _trace_projection(arm, tasks)
        if len(_PROJECTIONS) > OPTIONS.cache_size:
            _PROJECTIONS.popitem(last=False)
    return _PROJECTIONS[key]


def _trace_projection(arm: Arm, tasks: tuple[Task, ...]) -> _Projection:
    tape, n, size = Tape(), arm.dof, sum(task.target_size for task in tasks)
    state: list[list[Any]] = [[tape.input() for _ in range(n)] for _ in range(3)]
    targets: list[list[Any]] = [[tape.input() for _ in range(size)] for _ in range(3)]
    (s, ds, dds), (x, dx, ddx) = state, targets
    flat: Any = path_jacobian(arm, tasks, s)
    rows, squares = len(flat) // n, joint_scales(arm) ** 2
    directions = [[float(squares[j]) * flat[k * n + j] for k in range(rows)] for j in range(n)]

    def eliminated(jacobian: Sequence[Any]) -> tuple[list[list[Any]], dict[tuple[int, int], Any]]:
        matrix = [
            [_sum(jacobian[i * n + j] * directions[j][k] for j in range(n)) for k in range(rows)] for i in range(rows)
        ]
        return matrix, _eliminate(matrix)

    def correct(values: Sequence[Any], errors: Sequence[Any]) -> list[Any]:
        step = _substitute(system[0], system[1], errors)
        return [
            v - _sum(d * k for d, k in zip(row, step, strict=True)) for v, row in zip(values, directions, strict=True)
        ]

    def entries(values: Sequence[Any]) -> list[int]:
        return [as_entry(tape, value) for value in values]

    def expressions(indices: Sequence[int]) -> list[Any]:
        return [Expression(tape, i) for i in indices]

    def along(values: Sequence[Any], rates: Sequence[Any]) -> dict[int, int]:
        return dict(zip(entries(values), entries(rates), strict=True))

    system = eliminated(flat)
    frozen = [*chain(*directions, *system[0]), *system[1].values()]
    q = correct(s, path_equations(arm, tasks, s, x))
    system = eliminated(path_jacobian(arm, tasks, q))
    frozen += [*chain(*system[0]), *system[1].values()]
    q = correct(q, path_equations(arm, tasks, q, x))
    errors, moving = entries(path_equations(arm, tasks, q, x)), along(x, dx)
    dq = correct(ds, expressions(tangents(tape, errors, moving | along(q, ds))))
    moving |= along(q, dq)
    rates = tangents(tape, errors, moving)
    ddq = correct(dds, expressions(tangents(tape, rates, moving | along(dq, dds) | along(dx, ddx))))
    return _Projection(
        tape=tape,
        inputs=entries([*s, *ds, *dds, *x, *dx, *ddx]),
        outputs=entries([*q, *dq, *ddq]),
        frozen=entries(frozen),
    )


def _sum(terms: Any) -> Any:
    return sum(terms, start=0.0)


def _eliminate(matrix: list[list[Any]]) -> dict[tuple[int, int], Any]:
    """Make a matrix upper triangular, in place, by Gaussian elimination; return its factors."""
    factors, size = {}, len(matrix)
    for k in range(size):
        for i in range(k + 1, size):
            factors[i, k] = matrix[i][k] / matrix[k][k]
            for j in range(k + 1, size):
                matrix[i][j] = matrix[i][j] - factors[i, k] * matrix[k][j]
    return factors


def _substitute(upper: list[list[Any]], factors: dict[tuple[int, int], Any], right: Sequence[Any]) -> list[Any]:
    """Return the solution of a system after its elimination."""
    values, size = list(right), len(right)
    for (i, k), factor in factors.items():
        values[i] = values[i] - factor * values[k]
    for k in reversed(range(size)):
        values[k] = (values[k] - _sum(upper[k][j] * values[j] for j in range(k + 1, size))) / upper[k][k]
    return values
