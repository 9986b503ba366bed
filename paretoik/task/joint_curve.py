"""The curve of a motion between its samples, and the velocities and accelerations of its projection onto the path.

Where s(t) is the spline of a motion, J its tasks' Jacobian and W the joint scales, the projection moves along the
normal directions at s: q = s + D(s) λ with D = W² Jᵀ, until the tasks' equations g(q, t) = 0 hold. The derivatives of
both are linear systems for λ̇ and λ̈, of one matrix, ∂g/∂q D: the implicit function theorem.
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
from paretoik.task.retraction import OPTIONS
from paretoik.task.task import Task, path_equations, path_jacobian

Columns: TypeAlias = Float[np.ndarray, "points columns"]
Matrices: TypeAlias = Float[np.ndarray, "points rows columns"]


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


def project_rates(arm: Arm, tasks: Sequence[Task], spline: JointState, q: JointPaths, t: Times) -> JointState:
    """Return the state of a spline's projection onto the path at times t [s], where its positions are q.

    Exact up to rounding: no differences are taken. The system is regular where the projection succeeded, because
    that changes no determinant's sign. Raises InvalidInput where a path does not know its velocities.
    """
    rates = [task.target_rates(t) for task in tasks]
    targets = [
        np.concatenate(parts, axis=1)
        for parts in (
            [task.targets(t) for task in tasks],
            [first for first, _ in rates],
            [second for _, second in rates],
        )
    ]
    flat = [np.broadcast_to(part, (*q.shape[:-1], part.shape[-1])).reshape(-1, part.shape[-1]) for part in targets]
    state = [part.reshape(-1, arm.dof) for part in spline]
    dq, ddq = _differentiate(arm, tasks, state, q.reshape(-1, arm.dof), flat)
    return JointState(q, dq.reshape(q.shape), ddq.reshape(q.shape))


def _differentiate(
    arm: Arm, tasks: Sequence[Task], spline: Sequence[Columns], q: Columns, targets: Sequence[Columns]
) -> tuple[Columns, Columns]:
    s, ds, dds = spline
    squares, zero = joint_scales(arm) ** 2, np.zeros_like(q)
    normals, equations = _normals_evaluator(arm, tasks), _equations_evaluator(arm, tasks)
    rows = sum(task.rows for task in tasks)

    jacobian, _, _ = _evaluate(normals, rows, arm.dof, [*spline, np.zeros((len(q), rows))])
    directions = squares[:, None] * jacobian.swapaxes(-1, -2)  # D
    multipliers = _apply(np.linalg.pinv(directions), q - s)  # λ
    _, turn, bend = _evaluate(normals, rows, arm.dof, [*spline, multipliers])
    slopes, drift, _ = _evaluate(equations, rows, arm.dof, [q, zero, zero, *targets])
    matrix = slopes @ directions

    dq = ds + squares * turn  # ṡ + Ḋ λ, and then + D λ̇
    rate = np.linalg.solve(matrix, -(drift + _apply(slopes, dq))[..., None])[..., 0]
    dq = dq + _apply(directions, rate)

    _, turn, _ = _evaluate(normals, rows, arm.dof, [*spline, rate])
    _, _, drift = _evaluate(equations, rows, arm.dof, [q, dq, zero, *targets])
    ddq = dds + squares * (bend + 2 * turn)  # s̈ + D̈ λ + 2 Ḋ λ̇, and then + D λ̈
    rate = np.linalg.solve(matrix, -(drift + _apply(slopes, ddq))[..., None])[..., 0]
    return dq, ddq + _apply(directions, rate)


def _apply(matrices: Matrices, vectors: Columns) -> Columns:
    return np.einsum("pij,pj->pi", matrices, vectors)


def _evaluate(
    evaluator: Evaluator, rows: int, dof: int, columns: Sequence[Columns]
) -> tuple[Matrices, Columns, Columns]:
    """Return a matrix (points, rows, dof) and the two vectors (points, ...) that follow it."""
    values = evaluator(np.concatenate(columns, axis=1).T).T
    first, second = np.split(values[:, rows * dof :], 2, axis=1)
    return values[:, : rows * dof].reshape(-1, rows, dof), first, second


def _normals_evaluator(arm: Arm, tasks: Sequence[Task]) -> Evaluator:
    """Return the evaluator of J(s), and of (Jᵀ)˙ λ and (Jᵀ)¨ λ, at s, ṡ, s̈ and λ."""

    def build(tape: Tape) -> list[int]:
        s, ds, dds = _inputs(tape, arm.dof, 3)
        (multipliers,) = _inputs(tape, sum(task.rows for task in tasks), 1)
        jacobian = path_jacobian(arm, tasks, s)
        sums: list[Any] = [
            sum((m * entry for m, entry in zip(multipliers, jacobian[j :: arm.dof], strict=True)), start=0.0)
            for j in range(arm.dof)
        ]
        directions = _directions(s, ds)
        first = tangents(tape, [as_entry(tape, value) for value in sums], directions)
        second = tangents(tape, first, directions | _directions(ds, dds))
        return [*(as_entry(tape, entry) for entry in jacobian), *first, *second]

    return _cached("normals", arm, tasks, build)


def _equations_evaluator(arm: Arm, tasks: Sequence[Task]) -> Evaluator:
    """Return the evaluator of ∂g/∂q, and of ġ and g̈, at q, q̇ and q̈ and the targets with their derivatives."""

    def build(tape: Tape) -> list[int]:
        q, dq, ddq = _inputs(tape, arm.dof, 3)
        targets, rates, accelerations = _inputs(tape, sum(task.target_size for task in tasks), 3)
        equations = [as_entry(tape, value) for value in path_equations(arm, tasks, q, targets)]
        directions = _directions(q, dq) | _directions(targets, rates)
        first = tangents(tape, equations, directions)
        second = tangents(tape, first, directions | _directions(dq, ddq) | _directions(rates, accelerations))
        wrt = [value.index for value in q]
        return [*(entry for equation in equations for entry in gradient(tape, equation, wrt)), *first, *second]

    return _cached("equations", arm, tasks, build)


def _inputs(tape: Tape, count: int, kinds: int) -> list[list[Any]]:
    return [[tape.input() for _ in range(count)] for _ in range(kinds)]


def _directions(values: Sequence[Any], rates: Sequence[Any]) -> dict[int, int]:
    return {value.index: rate.index for value, rate in zip(values, rates, strict=True)}


def _cached(kind: str, arm: Arm, tasks: Sequence[Task], build: Any) -> Evaluator:
    key = kind, arm, *((task.frame, task.axes) for task in tasks)
    if key not in _EVALUATORS:
        tape = Tape()
        _EVALUATORS[key] = compile_evaluator(tape, build(tape))
        if len(_EVALUATORS) > OPTIONS.cache_size:
            _EVALUATORS.popitem(last=False)
    return _EVALUATORS[key]


_EVALUATORS: OrderedDict[Any, Evaluator] = OrderedDict()
