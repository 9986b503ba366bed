"""The nonlinear program of a motion: what its objectives and limits are at a sample, with exact derivatives.

The variables of a sample are u = (q, q̇, q̈, q⃛), linear in the positions q of a few samples (``Stencil``). Integral
objectives and user limits of that form are sums over samples of functions of u; limits bound u itself, or further
functions of u such as torque. The path is an equation in q at every sample.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.calculus.differentiation import gradient, hessian, used
from paretoik.calculus.expressions import Expression, Op, entry
from paretoik.calculus.machine import Program, program
from paretoik.errors import InvalidInput
from paretoik.refinement.compiled.interior_point import Compiled
from paretoik.robot.kinematics import chain
from paretoik.task.derivatives import TracedMotion, local, traced_sample
from paretoik.task.differences import rate, second_rate
from paretoik.task.motion_task import MotionTask

ORDERS = ("position", "velocity", "acceleration", "jerk")


@dataclass(frozen=True, kw_only=True, eq=False)
class Stencil:
    """u of sample i is Σ_k ``weights``[order, i, k] q of sample ``window``[i, k].

    The steps of sample i begin at ``place``[i] among the unknowns (−1: it cannot move), of which the last ``seam``
    belong to the border: those that couple the end of a cycle to its start.
    """

    window: Int[np.ndarray, "time width"]
    weights: Float[np.ndarray, "orders time width"]
    place: Int[np.ndarray, " time"]
    seam: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Slopes:
    """Which derivatives are not always 0: those of function ``function`` by variable ``variable``."""

    function: Int[np.ndarray, " entries"]
    variable: Int[np.ndarray, " entries"]


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionProgram:
    """Everything that a solver needs of a MotionTask.

    ``inputs`` (rows, time) has a row for each input of the programs: u first, then what is known, then at
    ``multipliers`` (path equations, sums, rows). ``value`` gives sums and rows; ``slope`` also their ``slopes``;
    ``curvature`` the ``second`` derivatives of the Lagrangian; ``track`` path equations and their Jacobian. ``lower``
    and ``upper`` (variables + rows, time) bound u and rows; ``caps`` (sums,) bound the sums.
    """

    task: MotionTask
    stencil: Stencil
    inputs: Float[np.ndarray, "inputs time"]
    multipliers: Int[np.ndarray, 3]
    sums: tuple[str, ...]
    rows: tuple[str, ...]
    value: Program
    slope: Program
    slopes: Slopes
    curvature: Program
    second: Slopes
    track: Program
    limited: Int[np.ndarray, "limits 2"]
    sides: Float[np.ndarray, " limits"]
    bounds: Float[np.ndarray, " limits"]

    @property
    def compiled(self) -> Compiled:
        """The program as compiled code takes it; each has registers of its own: one for every thread."""
        return Compiled(
            value=self.value.parts,
            slope=self.slope.parts,
            slope_of=self.slopes.function,
            slope_by=self.slopes.variable,
            curvature=self.curvature.parts,
            second_i=self.second.function,
            second_j=self.second.variable,
            track=self.track.parts,
            window=self.stencil.window,
            weights=self.stencil.weights,
            place=self.stencil.place,
            unknowns=int(self.stencil.place.max()) + self.task.redundancy,
            seam=self.stencil.seam,
            ones=np.ones(len(self.task.times)),
            quadrature=np.array(self.task.weights),
            inputs=self.inputs,
            multipliers=self.multipliers,
            limited=self.limited,
            sides=self.sides,
            bounds=self.bounds,
        )


def motion_program(task: MotionTask, divisors: Sequence[float] | np.ndarray | None = None) -> MotionProgram:
    """Return the nonlinear program of a task, its objectives divided by ``divisors``.

    Raises InvalidInput, naming the objective or limit, where there is none.
    """
    if task.stops:
        raise InvalidInput("end_velocity=0: a free end is wanted for refinement so far")
    motion = traced_sample(task)
    tape, n = motion.trace.tape, task.arm.dof
    shares = np.ones(len(task.objectives)) if divisors is None else 1.0 / np.asarray(divisors, dtype=float)
    sums = {
        o.name: _traced(motion, "objective", o, o.form, "integral", o.sign * float(share))
        for o, share in zip(task.objectives, shares, strict=True)
    }
    sums |= {
        c.name: _traced(motion, "constraint", c, c.form, "integral", 1.0)
        for c in task.constraints
        if c.form == "integral"
    }
    rows, bounds = _rows(motion)
    targets = task.targets.copy()
    if task.cyclic:
        targets[-1] = targets[0]
    wanted: list[Any] = [motion.trace.varying(column) for column in targets.T]
    links, begun = chain(task.arm, list(motion.q.entries)), 0
    path: list[Any] = []
    for part in task.tasks:
        path += part.equations(task.arm, links, wanted[begun : begun + part.numbers])
        begun += part.numbers
    u = list(tape.inputs[: 4 * n])
    functions = [entry(tape, f) for f in (*sums.values(), *rows.values())]
    multipliers = np.array([len(tape.inputs), len(tape.inputs) + len(path), len(tape.inputs) + len(path) + len(sums)])
    factors = [tape.input() for _ in range(len(path) + len(functions))]
    lagrangian: Any = 0.0
    for factor, f in zip(factors, (*path, *sums.values(), *rows.values()), strict=True):
        lagrangian = lagrangian + factor * f
    first = [gradient(tape, f, u) for f in functions]
    nothing = tape.constant(0.0)
    slopes = [(k, j, slope) for k, row in enumerate(first) for j, slope in enumerate(row) if slope != nothing]
    second = hessian(tape, entry(tape, lagrangian), u)
    equations = [entry(tape, h) for h in path]
    jacobian = [slope for h in equations for slope in gradient(tape, h, u[:n])]
    orders = 1 + max([1, *(j // n for _, j, _ in slopes), *(ORDERS.index(k) for k in task.bounds if k in ORDERS)])
    inputs = np.zeros((len(tape.inputs), len(task.times)))
    for i, values in motion.trace.data.items():
        inputs[tape.entries[i][1]] = values
    limited, sides, limits = _limits(task, orders, bounds)
    return MotionProgram(
        task=task,
        stencil=stencil(task, orders),
        inputs=inputs,
        multipliers=multipliers,
        sums=tuple(sums),
        rows=tuple(rows),
        value=program(tape, functions),
        slope=program(tape, [*functions, *(slope for *_, slope in slopes)]),
        slopes=_places([(k, j) for k, j, _ in slopes]),
        curvature=program(tape, list(second.values())),
        second=_places(list(second)),
        track=program(tape, [*equations, *jacobian]),
        limited=limited,
        sides=sides,
        bounds=limits,
    )


def stencil(task: MotionTask, orders: int) -> Stencil:
    """Return how rates at the samples follow from positions at the samples."""
    samples = len(task.times)
    level = [np.eye(samples)]
    level.append(rate(level[0], task.times, task.differences, cyclic=task.cyclic))
    level.append(second_rate(level[0], task.times, task.differences, cyclic=task.cyclic))
    level.append(rate(level[2], task.times, task.differences, cyclic=task.cyclic))
    known = np.stack(level[:orders])
    free = samples
    if task.cyclic:  # the last sample is the first
        known[..., 0] += known[..., -1]
        known[..., -1] = 0.0
        free = samples - 1
    touched = (known != 0).any(axis=0)
    width = int(touched.sum(axis=1).max())
    window = np.sort(np.argsort(~touched, axis=1, kind="stable")[:, :width], axis=1)
    weights = np.take_along_axis(known, np.broadcast_to(window, (orders, *window.shape)), axis=2)
    fixed = int(task.start is not None)
    place = np.where(np.arange(samples) < fixed, -1, (np.arange(samples) - fixed) * task.redundancy)
    if task.cyclic:
        place[-1] = place[0]
    reach = int(np.max(np.where(touched, np.abs(np.arange(samples) - np.arange(samples)[:, None]), 0)[: free // 2]))
    seam = 2 * (width - 1) if task.cyclic else 0
    assert not task.cyclic or free > 2 * seam, reach
    return Stencil(window=window, weights=np.ascontiguousarray(weights), place=place, seam=seam * task.redundancy)


def _traced(motion: TracedMotion, kind: str, given: Any, form: str, wanted: str, sign: float) -> Any:
    what = f"{kind} {given.name}"
    if form != wanted:
        raise InvalidInput(f"{what}: form 'integral' wanted for refinement, got {form!r}")
    value = local(motion, what, given.function)
    if value is None:
        raise InvalidInput(f"{what}: one sample at a time wanted for refinement, but it looks from one to another")
    if isinstance(value, Expression) and any(
        motion.trace.tape.entries[i][0] is Op.ABSOLUTE for i in used(motion.trace.tape, [value.index])
    ):
        raise InvalidInput(f"{what}: an absolute value has a kink where optima sit; a square is wanted so far")
    return sign * value


def _rows(motion: TracedMotion) -> tuple[dict[str, Any], list[np.ndarray]]:
    """Return the bounded functions of a sample by name, and their bounds (time, 2)."""
    task, samples = motion.task, len(motion.task.times)
    rows: dict[str, Any] = {}
    bounds: list[np.ndarray] = []
    series: dict[str, Callable[[], Any]] = {"torque": lambda: motion.torque, "power": lambda: motion.power}
    for kind, limits in task.bounds.items():
        for j, joint in enumerate(task.arm.joint_names if kind in series else ()):
            if np.isfinite(limits[:, j]).any():
                rows[f"{kind} of {joint}"] = series[kind]().entries[j]
                bounds.append(np.broadcast_to(limits[:, j], (samples, 2)))
    if task.obstacles:
        raise InvalidInput("obstacles: motions without them are wanted for refinement so far")
    for c in task.constraints:
        if c.form == "peak":
            rows[c.name] = _traced(motion, "constraint", c, c.form, "peak", 1.0)
            bounds.append(np.tile([c.lower, c.upper], (samples, 1)))
    return rows, bounds


def _limits(task: MotionTask, orders: int, rows: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    samples, n = len(task.times), task.arm.dof
    free = np.tile([-np.inf, np.inf], (samples, n, 1))
    simple = [np.broadcast_to(task.bounds.get(kind, free), free.shape) for kind in ORDERS[:orders]]
    both = np.concatenate([*simple, *(row[:, None] for row in rows)], axis=1)
    sample, which, side = np.nonzero(np.isfinite(both))
    moves = np.ones(len(sample), dtype=bool)
    if task.start is not None:
        moves = (sample > 0) | (which >= n)
    sample, which, side = sample[moves], which[moves], side[moves]
    return np.stack([which, sample], axis=1), 1.0 - 2.0 * side, both[sample, which, side]


def _places(pairs: list[tuple[int, int]]) -> Slopes:
    table = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return Slopes(function=np.ascontiguousarray(table[:, 0]), variable=np.ascontiguousarray(table[:, 1]))
