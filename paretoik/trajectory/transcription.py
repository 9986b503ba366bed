"""The transcription of a task into its nonlinear program (``motion_terms`` states it).

Functions are traced, kinks reformulated, derivatives compiled, and limits listed.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from paretoik.autodiff.differentiation import dependencies, gradient, hessian, tangents
from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.kinks import reformulate_choices, reformulate_kinks, remaining_kinks
from paretoik.autodiff.opcodes import Op
from paretoik.autodiff.tape import Expression, Tape, as_entry
from paretoik.errors import InvalidInput
from paretoik.robot.kinematics import joint_scales
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import row_scales
from paretoik.task.task import path_equations
from paretoik.trajectory import motion_kernel as _steps  # noqa: F401  registers the steps of solvers on these arrays
from paretoik.trajectory.curve_states import curve_arrays, instant_targets
from paretoik.trajectory.discretisation import stencil
from paretoik.trajectory.functions import Functions, function_names, trace_functions
from paretoik.trajectory.kernel_arrays import MotionKernel
from paretoik.trajectory.motion_terms import ORDERS, Evaluators, MotionTerms, Sparsity


@dataclass(frozen=True, kw_only=True)
class TranscriptionOptions:
    """Settings of probing functions for kinks, and of the evaluators in memory."""

    probes: int = 64  # number of random inputs
    probe_range: tuple[float, ...] = (2.0, 1.0, 3.0, 10.0)  # standard deviations, in rad over powers of duration
    cache_size: int = 16  # number of sets of evaluators; levels of samples and scales of objectives share them


OPTIONS = TranscriptionOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionProgram(MotionTerms):
    """The nonlinear program of a MotionTask; its fields are those of ``MotionTerms``."""

    @property
    def kernel(self) -> MotionKernel | None:
        """The program for interior-point methods; each thread needs its own."""
        return motion_kernel(self) if not self.unsupported else None


def motion_program(task: MotionTask, scales: Sequence[float] | np.ndarray | None = None) -> MotionProgram:
    """Return the nonlinear program of a task, its objectives divided by ``scales``.

    Raises InvalidInput, naming the objective or limit, if there is no program.
    """
    if task.ends_at_rest and task.differences == "central":
        raise InvalidInput(
            "differences must be 'spline' or 'backward' to refine motions with end_velocity=0, got 'central'"
        )
    divisors = np.ones(len(task.objectives)) if scales is None else np.asarray(scales, dtype=float)
    functions = trace_functions(task, 1.0 / divisors)
    tape, instants, n = functions.motion.trace.tape, len(task.instants), task.arm.dof
    # number of orders (position, velocity, acceleration, jerk) that functions and limits need, at least 2; whether
    # functions need the spline's own
    entries = [*functions.sums, *functions.rows, *functions.epigraph_rows]
    numbers = [tape.entries[i][1] for i in dependencies(tape, entries) if tape.entries[i][0] is Op.INPUT]
    local = [i % (4 * n) // n for i in numbers if i < 8 * n]
    local += [ORDERS.index(kind) for kind in task.bounds if kind in ORDERS]
    wholes = [int(i) // (n * len(task.instants)) for each in functions.whole_functions for i in each.columns]
    orders, kinked = 1 + max([1, *local, *wholes]), any(4 * n <= i < 8 * n for i in numbers)
    evaluators = _evaluators(functions, _path_equations(functions, orders))
    inputs = np.zeros((evaluators.inputs, instants))
    for i, values in functions.motion.trace.parameters.items():
        inputs[tape.entries[i][1]] = values
    ties = len(functions.epigraph_rows) + evaluators.ties
    bounds = functions.bounds + [np.tile([0.0, np.inf, 1.0], (instants, 1))] * ties
    states = np.concatenate([np.arange(orders * n), *([4 * n + np.arange(orders * n)] if kinked else [])])
    free = len(states) - orders * n + len(evaluators.auxiliary)
    limited, sides, limits, ranges = _limits(task, orders, free, bounds)
    # derivatives sorted by the variables: inputs ``states``, then v and σ
    place = np.zeros(8 * n + len(evaluators.auxiliary), dtype=np.int64)
    place[np.append(states, np.arange(8 * n, len(place)))] = np.arange(len(states) + len(evaluators.auxiliary))
    first, second = evaluators.gradient_sparsity, evaluators.hessian_sparsity
    placed = replace(
        evaluators,
        gradient_sparsity=Sparsity(rows=first.rows, columns=place[first.columns]),
        hessian_sparsity=Sparsity(rows=place[second.rows], columns=place[second.columns]),
    )
    return MotionProgram(
        task=task,
        scales=divisors,
        stencil=stencil(task, orders),
        totals=tuple(functions.totals),
        evaluators=placed,
        inputs=inputs,
        variables=np.append(states, evaluators.auxiliary),
        peaks=len(functions.epigraph_variables),
        sums=len(functions.sums),
        rows=tuple(functions.names),
        epigraph_rows=len(functions.rows) + np.arange(len(functions.epigraph_rows)),
        epigraph_peaks=np.array(functions.epigraph_peaks, dtype=np.int64),
        limited=limited,
        sides=sides,
        bounds=limits,
        ranges=ranges,
        kinks=ties * instants,
        whole_functions=tuple(functions.whole_functions),
    )


_EVALUATORS: OrderedDict[Any, Evaluators] = OrderedDict()


def _evaluators(functions: Functions, path: list[int]) -> Evaluators:
    """Return the evaluators of functions and path, from the cache if they are known."""
    tape = functions.motion.trace.tape
    entries = functions.sums, functions.rows, functions.epigraph_rows, functions.epigraph_variables, path
    sides = [tuple(np.isfinite(bounds[:, :2]).any(axis=0)) for bounds in functions.bounds]
    key = (tuple(tape.entries), tuple(tape.values.items()), tuple(map(tuple, entries)), tuple(sides))
    if key not in _EVALUATORS:
        _EVALUATORS[key] = _differentiate(functions, path)
        if len(_EVALUATORS) > OPTIONS.cache_size:
            _EVALUATORS.popitem(last=False)
    _EVALUATORS.move_to_end(key)
    return _EVALUATORS[key]


def _differentiate(functions: Functions, path: list[int]) -> Evaluators:
    """Return compiled values, gradients and Hessian by u, v and σ."""
    task, motion, n = functions.task, functions.motion, functions.task.arm.dof
    tape, rng = motion.trace.tape, np.random.default_rng(0)
    # sums, rows and epigraph rows, with their kinks reformulated
    probes = np.zeros((len(tape.inputs), OPTIONS.probes))
    for order, deviation in enumerate(OPTIONS.probe_range):
        for first in (order * n, (4 + order) * n):
            probes[first : first + n] = deviation / motion.duration**order * rng.normal(size=(n, OPTIONS.probes))
    for i, values in motion.trace.parameters.items():
        probes[tape.entries[i][1]] = rng.choice(values, OPTIONS.probes)
    sides = [1] * len(functions.sums)
    for bounds in functions.bounds:
        low, high = np.isfinite(bounds[:, :2]).any(axis=0)
        sides.append(int(high) - int(low))
    sides += [-1] * len(functions.epigraph_rows)
    names = function_names(functions.totals, functions.names, functions.epigraph_peaks)
    every, distances = [*functions.sums, *functions.rows, *functions.epigraph_rows], functions.distances
    reformulation = reformulate_choices(tape, every, names, probes, distances)
    smooth = reformulate_kinks(tape, reformulation, sides, probes, distances)
    entries = [*smooth.functions, *smooth.constraints]
    kinks = remaining_kinks(tape, smooth, distances)
    equations, of_curve = path[: task.rows], path if task.differences == "spline" else []
    multipliers = len(tape.inputs) + np.cumsum([0, task.rows + len(of_curve), len(functions.sums)])
    at_samples = _weighted_sum(tape, equations)
    lagrangian = _weighted_sum(tape, [*of_curve, *entries])
    u, auxiliary = list(tape.inputs[: 8 * n]), [*smooth.epigraph_variables, *functions.epigraph_variables]
    gradients = [gradient(tape, f, [*u, *auxiliary]) for f in entries]
    zero = tape.constant(0.0)
    slopes = {(k, j): slope for k, row in enumerate(gradients) for j, slope in enumerate(row) if slope != zero}
    second = hessian(tape, lagrangian, [*u, *smooth.epigraph_variables])
    turns = hessian(tape, at_samples, u[:n])
    jacobian = [slope for h in equations for slope in gradient(tape, h, u[:n])]
    return Evaluators(
        inputs=len(tape.inputs),
        auxiliary=np.array([tape.entries[i][1] for i in auxiliary], dtype=np.int64),
        multipliers=multipliers,
        slacks=len(smooth.epigraph_variables),
        ties=len(smooth.constraints),
        signs=tuple(smooth.signs),
        slack=compile_evaluator(tape, smooth.nodes),
        kinked=tuple(kink[0] for kink in kinks),
        kink_operands=compile_evaluator(tape, [operand for kink in kinks for operand in kink[1:]]),
        value=compile_evaluator(tape, entries),
        gradient=compile_evaluator(tape, [*entries, *slopes.values()]),
        gradient_sparsity=_sparsity(list(slopes)),
        hessian=compile_evaluator(tape, list(second.values())),
        hessian_sparsity=_sparsity(list(second)),
        path=compile_evaluator(tape, [*equations, *jacobian]),
        path_hessian=compile_evaluator(tape, [turns.get((max(k), min(k)), zero) for k in np.ndindex(n, n)]),
    )


def _weighted_sum(tape: Tape, entries: list[int]) -> int:
    """Return the sum of entries times multipliers, which are new inputs."""
    factors = [tape.input() for _ in entries]
    return as_entry(tape, sum((m * Expression(tape, f) for m, f in zip(factors, entries, strict=True)), 0.0))


def _path_equations(functions: Functions, orders: int) -> list[int]:
    """Return an instant's path equations, for a spline with their time derivatives."""
    motion, task = functions.motion, functions.task
    tape = motion.trace.tape
    parameters: list[list[Any]] = [[motion.trace.parameter(x) for x in part.T] for part in instant_targets(task)]
    shares = 1.0 / row_scales(task.arm, task.tasks)
    errors = path_equations(task.arm, task.tasks, list(motion.q.entries), parameters[0])
    equations = [as_entry(tape, error * share) for error, share in zip(errors, shares, strict=True)]
    if task.differences != "spline":
        return equations
    n = task.arm.dof
    q, dq, ddq = (list(tape.inputs[k * n : (k + 1) * n]) for k in range(3))
    x, dx, ddx = ([value.index for value in part] for part in parameters)
    moving = dict(zip([*q, *x], [*dq, *dx], strict=True))
    first = tangents(tape, equations, moving)
    second = tangents(tape, first, moving | dict(zip([*dq, *dx], [*ddq, *ddx], strict=True)))
    return [entry for part in (equations, first, second)[:orders] for entry in part]


def _limits(
    task: MotionTask, orders: int, unlimited: int, rows: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return ``limited``, ``sides``, ``bounds`` and ``ranges``, with rows last.

    rows: lower bounds, upper bounds and ranges (instants, 3) of rows
    unlimited: number of variables without limits before the rows
    """
    instants, n = len(task.instants), task.arm.dof
    free, simple = np.tile([-np.inf, np.inf, 1.0], (instants, n, 1)), list[np.ndarray]()
    for kind in ORDERS[:orders]:
        bounded = free
        if kind in task.bounds:
            bounds = np.array(np.broadcast_to(task.bounds_at(kind, task.instants), (instants, n, 2)))
            bounded = np.concatenate([bounds, task.limit_ranges(kind, bounds)[..., None]], axis=-1)
            if kind == "velocity" and task.stride > 1:  # its coefficients are limited between samples
                bounded[1 :: task.stride, :, :2] = free[1 :: task.stride, :, :2]
            bounded /= joint_scales(task.arm)[:, None]
        simple.append(bounded)
    none = np.tile([-np.inf, np.inf, 1.0], (instants, unlimited, 1))
    table = np.concatenate([*simple, none, *(row[:, None] for row in rows)], axis=1)
    both = table[..., :2]
    which, instant, side = np.nonzero(np.isfinite(both.transpose(1, 0, 2)))  # variables first, kinks last
    if task.start is not None:
        moves = (instant > 0) | (which >= n)
        which, instant, side = which[moves], instant[moves], side[moves]
    ranges = table[instant, which, 2]
    return np.stack([which, instant], axis=1), 1.0 - 2.0 * side, both[instant, which, side], ranges


def _sparsity(places: list[tuple[int, int]]) -> Sparsity:
    table = np.array(places, dtype=np.int64).reshape(-1, 2)
    return Sparsity(rows=np.ascontiguousarray(table[:, 0]), columns=np.ascontiguousarray(table[:, 1]))


# Programs of motions as arrays, for compiled solvers.


def motion_kernel(program: MotionTerms) -> MotionKernel:
    """Return a program of sums and peaks as arrays, with new registers."""
    evaluators = program.evaluators
    variables, auxiliary = len(program.variables), len(program.variables) - program.rates
    rows = len(program.rows) + len(program.epigraph_rows)
    row = program.limited[:, 0]
    limits = row < variables + rows  # the ties of slacks, which come last, are satisfied by definition
    row = np.where(row >= variables, row - auxiliary, row)
    row_peaks = np.full(rows, -1, dtype=np.int64)
    row_peaks[program.epigraph_rows] = program.epigraph_peaks
    # table of slacks, innermost first: input, variable, sign and first tie of each; and the depth of nested kinks
    count, first_tie = program.slacks, program.sums + len(program.rows) + len(program.epigraph_rows)
    function, variable = program.evaluators.gradient_sparsity.rows, program.evaluators.gradient_sparsity.columns
    inner = [set[int]() for _ in range(count)]
    for tie, column in zip(function - first_tie, variable - program.rates, strict=True):
        if tie >= 0 and 0 <= column < count and column != tie // 2:
            inner[tie // 2].add(int(column))
    order, depths = list[int](), dict[int, int]()
    while len(order) < count:
        for j in range(count):
            if j not in depths and inner[j] <= depths.keys():
                depths[j] = 1 + max((depths[k] for k in inner[j]), default=0)
                order.append(j)
    table = [
        (program.slack_inputs[j], program.rates + j, program.evaluators.signs[j], first_tie + 2 * j) for j in order
    ]
    kinks, nesting = np.array(table, dtype=np.int64).reshape(-1, 4), max(depths.values(), default=0)
    return MotionKernel(
        value=evaluators.value.arrays,
        slope=evaluators.gradient.arrays,
        slope_of=evaluators.gradient_sparsity.rows,
        slope_by=evaluators.gradient_sparsity.columns,
        curvature=evaluators.hessian.arrays,
        second_i=evaluators.hessian_sparsity.rows,
        second_j=evaluators.hessian_sparsity.columns,
        track=evaluators.path.arrays,
        track_curvature=evaluators.path_hessian.arrays,
        curve=curve_arrays(program.task),
        kinked=program.rates > program.states,
        stencil=program.stencil,
        stride=program.task.stride,
        stops=program.task.ties_end,
        ones=np.ones(len(program.task.instants)),
        quadrature=np.array(program.task.weights),
        inputs=program.inputs,
        multipliers=evaluators.multipliers,
        limited=np.stack([row, program.limited[:, 1]], axis=1)[limits],
        factors=program.sides[limits] / program.ranges[limits],
        bounds=program.bounds[limits],
        scales=joint_scales(program.task.arm),
        totals=np.array([each.index if each.kind == "sum" else -1 - each.index for each in program.totals]),
        peak_inputs=program.peak_inputs,
        row_peaks=row_peaks,
        kinks=kinks,
        nesting=nesting,
        smoothing=float(len(kinks) * len(program.task.instants)),
    )
