"""The curve of a motion: its spline projected onto the path, with exact velocities and accelerations.

The spline is s(t), J the tasks' Jacobian and W the joint scales. The projection moves along directions D(t),
q = s + D λ, until the tasks' equations g(q, t) = 0 hold. At the samples and the middles between them D spans the normal
directions W² Jᵀ at s and stands still; in between it blends from one to the next, with two continuous derivatives. The
derivatives of λ follow from linear systems of one matrix, ∂g/∂q D: the implicit function theorem.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from paretoik.arrays import JointPaths, Series, Times
from paretoik.autodiff.differentiation import gradient, tangents
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.tape import Tape, as_entry
from paretoik.robot.arm import Arm
from paretoik.robot.scales import joint_scales
from paretoik.tables import field_representation, html_representation
from paretoik.task.retraction import OPTIONS, compiled_steps, row_scales
from paretoik.task.task import Task, path_equations

Frames: TypeAlias = Float[np.ndarray, "*batch instants dof rows"]


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
    """Return the cubic spline through samples (*batch, time, dof) at times t [s], or its derivative of an ``order``."""
    ends = "periodic" if cyclic else "not-a-knot"
    flat, times = q.reshape(-1, *q.shape[-2:]), time.reshape(-1, time.shape[-1])
    if np.all(times == times[0]):
        values = CubicSpline(times[0], flat, axis=1, bc_type=ends)(t, order)
    else:
        values = np.stack([CubicSpline(s, q, bc_type=ends)(t, order) for s, q in zip(times, flat, strict=True)])
    return values.reshape(*q.shape[:-2], len(t), q.shape[-1])


class Directions(NamedTuple):
    """Directions of the projection (*batch, instants, dof, rows), and their first and second derivatives."""

    at: Frames
    first: Frames
    second: Frames


def blend_directions(nodes: Frames, node_times: Series, t: Times) -> Directions:
    """Return directions at increasing times t [s] from those at the nodes, where they stand still."""
    times = node_times.reshape(-1, node_times.shape[-1])
    rows = times[:1] if np.all(times == times[0]) else times
    index = np.stack([np.clip(np.searchsorted(row, t, side="right") - 1, 0, len(row) - 2) for row in rows])
    begin, end = (np.take_along_axis(rows, index + k, axis=1) for k in (0, 1))
    step = end - begin
    x = np.clip((t - begin) / step, 0.0, 1.0)
    # the polynomial from 0 to 1 whose first and second derivatives vanish at both ends
    weights = x**3 * (10 - 15 * x + 6 * x**2), 30 * (x * (1 - x)) ** 2 / step, 60 * x * (1 - x) * (1 - 2 * x) / step**2
    flat = nodes.reshape(-1, *nodes.shape[-3:])
    index = np.broadcast_to(index, (len(flat), len(t)))
    before, after = (np.take_along_axis(flat, (index + k)[..., None, None], axis=1) for k in (0, 1))
    shape = (*nodes.shape[:-3], len(t), *nodes.shape[-2:])
    value, first, second = (w[..., None, None] * (after - before) for w in weights)
    return Directions((before + value).reshape(shape), first.reshape(shape), second.reshape(shape))


def target_rates(tasks: Sequence[Task], t: Times) -> tuple[Float[np.ndarray, "time numbers"], ...]:
    """Return the targets of all tasks at times t [s], and their first and second derivatives."""
    rates = [task.target_rates(t) for task in tasks]
    parts = [task.targets(t) for task in tasks], [first for first, _ in rates], [second for _, second in rates]
    return tuple(np.concatenate(part, axis=1) for part in parts)


def project_rates(
    arm: Arm,
    tasks: Sequence[Task],
    spline: JointState,
    directions: Directions,
    q: JointPaths,
    targets: Sequence[Float[np.ndarray, "*#batch instants numbers"]],
) -> JointState:
    """Return the state of a spline's projection along directions, where its positions are q on the path.

    Exact up to rounding: no differences are taken. The system is regular where the projection succeeded, because
    that changes no determinant's sign.
    """
    points, n = int(np.prod(q.shape[:-1])), arm.dof
    moving, *turning = (np.ascontiguousarray(part.reshape(points, *part.shape[-2:])) for part in directions)
    given = [np.broadcast_to(part, (*q.shape[:-1], part.shape[-1])).reshape(points, -1) for part in targets]
    inputs = np.concatenate([np.zeros((3 * n, points)), *(part.T for part in given)])
    before = np.stack([part.reshape(points, n) for part in spline])
    evaluator, rows = rate_evaluator(arm, tasks), moving.shape[-1]
    state = np.stack([q.reshape(points, n), *before[1:]])
    compiled_steps().project_rates(
        evaluator.arrays,
        inputs,
        np.empty((len(evaluator.outputs), points)),
        joint_scales(arm),
        before,
        moving,
        *turning,
        state,
        np.empty((3, points, rows)),
    )
    return JointState(*state.reshape(3, *q.shape))


def rate_evaluator(arm: Arm, tasks: Sequence[Task]) -> Evaluator:
    """Return the evaluator of ∂g/∂q, ġ and g̈ at q, q̇ and q̈ and the targets with their derivatives.

    The path equations g are relative to ``row_scales``.
    """
    key = arm, *((task.frame, task.axes) for task in tasks)
    if key not in _EVALUATORS:
        tape, (q, *_), rates = trace_path(arm, tasks)
        slopes = [entry for equation in rates[0] for entry in gradient(tape, equation, q)]
        _EVALUATORS[key] = compile_evaluator(tape, [*slopes, *rates[1], *rates[2]])
        if len(_EVALUATORS) > OPTIONS.cache_size:
            _EVALUATORS.popitem(last=False)
    return _EVALUATORS[key]


def trace_path(arm: Arm, tasks: Sequence[Task]) -> tuple[Tape, list[list[int]], list[list[int]]]:
    """Return a tape, the entries of q, q̇ and q̈ on it, and those of g, ġ and g̈.

    Its inputs are q, q̇ and q̈, then the targets with their first and their second derivatives.
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


_EVALUATORS: OrderedDict[Any, Evaluator] = OrderedDict()
